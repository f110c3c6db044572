#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Scenes and starts for every refiner of this comparison: the writer, and a reader for Python.

    python benches/peers/scenes.py [FILE]          # default: target/peers/scenes.txt

Plain text: numbers separated by blanks, one block per scene, radians and metres. One block:

    scene m n           the word "scene", then the numbers of views and of landmarks
    b b ... b           m lines of n bearings, one line per view, all seen
    x y theta           m lines: start poses
    x y                 n lines: start landmarks
    x y theta           m lines: true poses
    x y                 n lines: true landmarks

Robots and landmarks are mixed in a room of 7 m x 5 m, no two closer than 0.4 m; 1 degree of noise on
the bearings; the start is the truth with Gaussian noise of 0.1 m and 5 degrees. Fifty scenes each of
4 x 7, 8 x 11 and 12 x 15, seeded. Starts that do not lead to the optimum of the truth are kept:
run.py counts the refiners that arrive.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
DEFAULT = ROOT / "target" / "peers" / "scenes.txt"
SIZES = ((4, 7), (8, 11), (12, 15))
NOISE_RAD = math.radians(1.0)
START_M, START_RAD = 0.1, math.radians(5.0)
MIN_DISTANCE = 0.4


def wrap(angle: Array) -> Array:
    """Angle in [-pi, pi]."""
    return np.arctan2(np.sin(angle), np.cos(angle))


def points(rng: np.random.Generator, count: int) -> Array:
    """Draw points in the room, one at a time, so that none comes too close to another."""
    found: list[Array] = []
    while len(found) < count:
        point = rng.uniform([0.0, 0.0], [7.0, 5.0])
        if all(np.hypot(*(point - other)) > MIN_DISTANCE for other in found):
            found.append(point)
    return np.array(found)


def rows(values: Iterable[Array]) -> list[str]:
    """One line per row, with all digits."""
    return [" ".join(repr(float(x)) for x in row) for row in values]


def block(rng: np.random.Generator, m: int, n: int) -> str:
    """One scene as text."""
    xy = points(rng, m + n)
    poses = np.column_stack([xy[:m], rng.uniform(-math.pi, math.pi, m)])
    landmarks = xy[m:]
    delta = landmarks[None] - poses[:, None, :2]
    bearings = np.arctan2(delta[..., 1], delta[..., 0]) - poses[:, 2:]
    bearings = wrap(bearings + NOISE_RAD * rng.standard_normal((m, n)))
    start_poses = poses + rng.standard_normal((m, 3)) * [START_M, START_M, START_RAD]
    start_landmarks = landmarks + START_M * rng.standard_normal((n, 2))
    parts = (bearings, start_poses, start_landmarks, poses, landmarks)
    return "\n".join([f"scene {m} {n}", *(line for part in parts for line in rows(part))])


@dataclass(frozen=True)
class Scene:
    """One block of the file."""

    bearings: Array
    start_poses: Array
    start_landmarks: Array
    true_poses: Array
    true_landmarks: Array

    def cost(self, poses: Array, landmarks: Array) -> float:
        """Sum of squared wrapped residuals [rad^2], evaluated in the same way for every refiner."""
        delta = landmarks[None] - poses[:, None, :2]
        direction = np.arctan2(delta[..., 1], delta[..., 0])
        return float((wrap(direction - poses[:, 2:] - self.bearings) ** 2).sum())


def read_scenes(path: Path) -> list[Scene]:
    """Read what `main` wrote."""
    words = iter(path.read_text(encoding="utf-8").split())

    def take(count: int, width: int) -> Array:
        return np.array([float(next(words)) for _ in range(count * width)]).reshape(count, width)

    found = []
    for word in words:
        if word != "scene":
            raise ValueError(f"{path}: expected 'scene', got {word!r}")
        m, n = int(next(words)), int(next(words))
        found.append(Scene(take(m, n), take(m, 3), take(n, 2), take(m, 3), take(n, 2)))
    return found


def measure(prepare: Callable[[], Callable[[], Any]], repeat: int) -> tuple[float, float, Any]:
    """Median and least time [us] of what `prepare` returns, after a warm-up run, and its last result."""
    microseconds = []
    for _ in range(repeat + 1):
        call = prepare()
        begin = time.perf_counter()
        result = call()
        microseconds.append(1e6 * (time.perf_counter() - begin))
    return statistics.median(microseconds[1:]), min(microseconds[1:]), result


def main() -> None:
    """Write the file of scenes."""
    parser = argparse.ArgumentParser(description="Write the scenes that all refiners start from.")
    parser.add_argument("file", nargs="?", type=Path, default=DEFAULT)
    parser.add_argument("--count", type=int, default=50, help="number of scenes of each size")
    args = parser.parse_args()
    args.file.parent.mkdir(parents=True, exist_ok=True)
    blocks = [block(np.random.default_rng([2002, m, n, k]), m, n) for m, n in SIZES for k in range(args.count)]
    args.file.write_text("\n".join(blocks) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
