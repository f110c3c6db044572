#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Three-view batches: the compiled core against the same estimator in NumPy alone, on one core.

    python benches/baseline/run.py [--problems 20000] [--rounds 7] [--noise 0.3] [--seed 1]

Needs this package installed; takes some two minutes. Scenes: three views and n landmarks, uniform in 7 x 5 m, headings
uniform, Gaussian noise on every bearing. All programs run one after the other, in several rounds, so that a slow minute
of the machine hits all of them; both make fresh arrays for their results in every run.

Prints two tables. The first shows how far the results are from those of the core, over the scenes that the core does
not flag as nearly collinear (where the error of the motion is the square root of the rounding error). Where both
motions fit equally well, as always with five landmarks and equal numbers of inconsistent ones, their order depends on
rounding, and either is accepted.

poses        difference [baselines, rad]: median, 99.9 % quantile, largest
landmarks    the same, relative to one baseline plus the distance of the landmark
beyond       scenes with a pose that differs by more than 1e-9
wrong        scenes with another number of inconsistent sightings, or another number of solutions
tied         scenes with two equal solutions

The second gives the median time per problem [us], and its ratio to that of the core. The columns of NumPy differ in how
they find null vectors (``NULL_VECTORS`` of ``numpy_three_view.py``): "elimination" is the fastest, "svd" is what one
would write first. Everything else is the same, and already as fast as we could make it.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable

# Before NumPy and the core are imported: one thread each.
for library in ("OMP", "OPENBLAS", "MKL", "RAYON"):
    os.environ[f"{library}_NUM_THREADS"] = "1"

import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from numpy_three_view import NULL_VECTORS, Solutions, three_view_batch  # noqa: E402

from bearslam import _core  # noqa: E402

CASES = ((5, 0), (5, 1), (7, 0), (7, 1), (15, 0), (15, 1), (40, 0), (40, 1))
AREA = (7.0, 5.0)
TIE = 1e-9
BEYOND = 1e-9


def scenes(problems: int, landmarks: int, noise: float, random: np.random.Generator) -> NDArray[np.float64]:
    """Bearings (problems, 3, landmarks) in [-pi, pi)."""
    views = random.random((problems, 3, 1, 2)) * AREA
    points = random.random((problems, 1, landmarks, 2)) * AREA
    headings = random.uniform(-np.pi, np.pi, (problems, 3, 1))
    x, y = np.moveaxis(points - views, -1, 0)
    bearings = np.arctan2(y, x) - headings + noise * random.standard_normal(x.shape)
    return np.mod(bearings + np.pi, 2.0 * np.pi) - np.pi


def by_core(bearings: NDArray[np.float64], reweights: int) -> tuple[Solutions, NDArray[np.bool_]]:
    """Results of the core in the shapes of `three_view_batch`, and which are nearly collinear."""
    poses, landmarks, inconsistent, cost, near_collinear = _core.three_view_batch(bearings, "calibrated", reweights)
    count, _, n = bearings.shape
    solutions = poses.reshape(count, 2, 3, 3), landmarks.reshape(count, 2, n, 2), inconsistent, cost
    return solutions, np.array(near_collinear)


def differences(found: Solutions, expected: Solutions) -> tuple[NDArray[np.float64], ...]:
    """For each problem: largest difference of poses, of landmarks, and whether anything else differs."""
    poses = np.abs(found[0] - expected[0])
    poses[..., 2] = np.abs(np.mod(poses[..., 2] + np.pi, 2.0 * np.pi) - np.pi)
    points = np.linalg.norm(found[1] - expected[1], axis=-1) / (1.0 + np.linalg.norm(expected[1], axis=-1))
    wrong = (found[2] != expected[2]).any(axis=1) | (np.isnan(found[3]) != np.isnan(expected[3])).any(axis=1)
    return np.nan_to_num(poses).max(axis=(1, 2, 3)), np.nan_to_num(points).max(axis=(1, 2)), wrong


def compare(found: Solutions, expected: Solutions, near_collinear: NDArray[np.bool_]) -> list[str]:
    """The cells of the first table."""
    inconsistent, cost = expected[2:]
    tied = (inconsistent[:, 0] == inconsistent[:, 1]) & (np.abs(cost[:, 0] - cost[:, 1]) <= TIE * (1.0 + cost[:, 0]))
    straight = differences(found, expected)
    crossed = differences(tuple(array[:, ::-1] for array in found), expected)
    swap = tied & (crossed[0] < straight[0])
    poses, points, wrong = (np.where(swap, b, a)[~near_collinear] for a, b in zip(straight, crossed, strict=True))
    cells = ["  ".join(f"{value:.0e}" for value in np.quantile(x, [0.5, 0.999, 1.0])) for x in (poses, points)]
    return [*cells, f"{(poses > BEYOND).sum()}", f"{wrong.sum()}", f"{tied.sum()}"]


def times(programs: list[Callable[[], object]], rounds: int) -> list[float]:
    """Median time of each [s], after a run that warms up."""
    for program in programs:
        program()
    taken: list[list[float]] = [[] for _ in programs]
    for _ in range(rounds):
        for program, into in zip(programs, taken, strict=True):
            start = time.perf_counter()
            program()
            into.append(time.perf_counter() - start)
    return [statistics.median(x) for x in taken]


def main() -> None:
    """Draw, check, time and print."""
    parser = argparse.ArgumentParser(description="Compare the core with NumPy on batches of three views.")
    parser.add_argument("--problems", type=int, default=20_000)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--noise", type=float, default=0.3, help="standard deviation of a bearing [degrees]")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()

    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    random = np.random.default_rng(args.seed)
    sets = {
        landmarks: scenes(args.problems, landmarks, np.radians(args.noise), random)
        for landmarks in dict.fromkeys(landmarks for landmarks, _ in CASES)
    }

    form = "{:>9} {:>9}  {:>11}  {:>22} {:>22} {:>7} {:>6} {:>6}"
    print(form.format("landmarks", "reweights", "numpy", "poses", "landmarks", "beyond", "wrong", "tied"))
    for landmarks, reweights in CASES:
        bearings = sets[landmarks]
        expected, near_collinear = by_core(bearings, reweights)
        for name, null_vector in NULL_VECTORS.items():
            found = three_view_batch(bearings, reweights, null_vector=null_vector)
            print(form.format(landmarks, reweights, name, *compare(found, expected, near_collinear)))

    form = "{:>9} {:>9} {:>7}" + "{:>13} {:>7}" * len(NULL_VECTORS)
    heads = [cell for name in NULL_VECTORS for cell in (name, "ratio")]
    print()
    print(form.format("landmarks", "reweights", "core", *heads))
    for landmarks, reweights in CASES:
        bearings = sets[landmarks]
        programs = [lambda b=bearings, r=reweights: _core.three_view_batch(b, "calibrated", r)]
        programs += [
            lambda b=bearings, r=reweights, v=null_vector: three_view_batch(b, r, null_vector=v)
            for null_vector in NULL_VECTORS.values()
        ]
        core, *others = (1e6 * x / args.problems for x in times(programs, args.rounds))
        cells = [cell for other in others for cell in (f"{other:.2f}", f"{other / core:.2f}")]
        print(form.format(landmarks, reweights, f"{core:.2f}", *cells), flush=True)


if __name__ == "__main__":
    main()
