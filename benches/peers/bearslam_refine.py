#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Refinement by bearslam of every scene of a file that scenes.py wrote.

    python benches/peers/bearslam_refine.py FILE [--repeat N]

Times the whole call from Python, including checks and packing of the answer, with default options.
Prints one line per scene: m n median_us least_us iterations cost, with the cost as the sum of squared
residuals [rad^2] and the times over N repetitions.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from functools import partial
from pathlib import Path

from scenes import measure, read_scenes

SKIPPED = 77  # exit status that run.py reports as "not installed", as automake does

try:
    bearslam = importlib.import_module("bearslam")
except ModuleNotFoundError as error:
    print(f"{error}: build and install the package first", file=sys.stderr)
    sys.exit(SKIPPED)


def main() -> None:
    """Refine every scene."""
    parser = argparse.ArgumentParser(description="Refine scenes by bearslam and time it.")
    parser.add_argument("file", type=Path)
    parser.add_argument("--repeat", type=int, default=15)
    args = parser.parse_args()
    for scene in read_scenes(args.file):
        m, n = scene.bearings.shape
        start = (scene.start_poses, scene.start_landmarks)
        prepare = partial(partial, bearslam.refine, scene.bearings, start)
        median, least, found = measure(prepare, args.repeat)
        cost = scene.cost(found.poses, found.landmarks)
        print(f"{m} {n} {median:.3f} {least:.3f} {found.iterations} {cost:.12e}")


if __name__ == "__main__":
    main()
