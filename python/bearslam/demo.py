# SPDX-License-Identifier: MIT OR Apache-2.0
"""The paper's two robot experiments, simulated: from bearings to a picture."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TextIO

from bearslam.maps import Map, compare
from bearslam.reconstruction import Reconstruction
from bearslam.simulate import Layout, Scene, simulate
from bearslam.solve import initialize, solve

__all__ = ["EXPERIMENTS", "Experiment", "run"]

WIDTH, HEIGHT = 7.0, 5.0
REPEATS = 25


@dataclass(frozen=True)
class Experiment:
    """One experiment of section 4.3 of the paper, and the figure that shows it there."""

    name: str
    title: str
    layout: Layout
    landmarks: int
    noise_deg: float
    seed: int


EXPERIMENTS = (
    Experiment("figure_9", "Four robots among nine landmarks", "mixed", 9, 2.23, 0),
    Experiment("figure_10", "Four robots ringed by nine landmarks", "enclosed", 9, 1.53, 0),
)
