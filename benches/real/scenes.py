#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Real scenes from bearings alone: does `solve` reach the cost of the refinement that starts at the truth?

    python benches/real/scenes.py FILE.npz... --sigma-deg 0.14 [--all]

FILE is a NumPy archive with the arrays NAME_view_index, NAME_landmark_index, NAME_bearing [rad], NAME_true_poses,
NAME_true_landmarks and NAME_crlb (the landmark error predicted at the truth) of every scene NAME. Every scene is
written to a CSV file, read back, and solved from its bearings. The oracle is `refine`, started at the truth. "Same" is
a cost within 1e-5 of the oracle's, "lower" a better map than the one near the truth, "higher" a failure; a star marks a
different number of undetermined landmarks. Errors are root mean squares over the landmarks after the best-fitting
similarity, as shares of the root-mean-square distance of the true ones from their mean.

A scene is called ill-conditioned if the covariance of the map found (frame "free_network") predicts an error of the
landmarks above 10 %, and ambiguous if the map has alternatives: both are known to a user without the truth. Prints a
line for every scene that is not "same" (for all with --all), and a summary.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import bearslam

Array = NDArray[np.float64]
SAME = (1e-5, 1e-12)
"""Relative and absolute difference up to which costs count as the same, as in a sweep."""
DOUBTFUL = 0.1
"""Predicted error above which a scene is called ill-conditioned."""


@dataclass(frozen=True)
class Outcome:
    """The result of a scene."""

    name: str
    size: str
    verdict: str
    cost: float
    oracle_cost: float
    error: float
    oracle_error: float
    predicted: float
    foreseen: float
    rivals: int
    rms: float
    squares: float
    freedom: int
    milliseconds: float

    @property
    def doubtful(self) -> bool:
        """Whether bearslam reports that the bearings hardly determine the map."""
        return not self.foreseen <= DOUBTFUL

    def __str__(self) -> str:
        return (
            f"{self.name:7} {self.size:>6}  {self.verdict:7} cost {self.cost:9.3g} (oracle {self.oracle_cost:9.3g})  "
            f"error {self.error:7.4f} (oracle {self.oracle_error:7.4f}) predicted {self.predicted:7.4f} (at the map "
            f"{self.foreseen:7.4f})  rms {np.degrees(self.rms):.3f} deg {self.milliseconds:6.2f} ms"
            f"{'  ill-conditioned' * self.doubtful}{'  ambiguous' * (self.rivals > 0)}"
        )


def landmark_error(landmarks: Array, truth: Array) -> float:
    """Root-mean-square error after the best similarity, relative to the radius of the truth."""
    known = np.isfinite(landmarks).all(axis=1) & np.isfinite(truth).all(axis=1)
    if known.sum() < 2:
        return np.inf
    source, target = landmarks[known], truth[known]
    away = bearslam.align(source, target).apply(source) - target
    radius = np.sqrt(((target - target.mean(axis=0)) ** 2).sum(axis=1).mean())
    return float(np.sqrt((away**2).sum(axis=1).mean()) / radius)


def freedom(result: bearslam.Reconstruction) -> int:
    """Residuals minus unknowns."""
    residuals, views, landmarks = (
        int(np.isfinite(values).sum()) for values in (result.residuals, result.poses[:, 0], result.landmarks[:, 0])
    )
    return residuals + 4 - 3 * views - 2 * landmarks


def foreseen(problem: bearslam.Problem, result: bearslam.Reconstruction, sigma: float) -> float:
    """The error of the landmarks, over their radius, that the covariance of a map predicts."""
    try:
        again = bearslam.refine(problem, result, sigma=sigma, covariance="free_network")
    except bearslam.DegenerateError:
        return np.inf
    points, covariance = again.landmarks, again.landmark_covariance
    assert covariance is not None
    known = np.isfinite(points).all(axis=1)
    radius = ((points[known] - points[known].mean(axis=0)) ** 2).sum(axis=1).mean()
    return float(np.sqrt(np.trace(covariance[known], axis1=1, axis2=2).mean() / radius))


def problem_of(scenes: dict[str, Array], name: str, folder: Path) -> bearslam.Problem:
    """The scene, written to a file and read back."""
    path = folder / f"{name}.csv"
    seen = bearslam.Sightings(*(scenes[f"{name}_{part}"] for part in ("view_index", "landmark_index", "bearing")))
    bearslam.save(seen, path)
    return bearslam.load(path)


def judge(scenes: dict[str, Array], name: str, sigma: float, folder: Path) -> Outcome:
    """Solve one scene, and refine it from the truth."""
    problem = problem_of(scenes, name, folder)
    # The file numbers views and landmarks by first use; their names are the indices in the scene.
    views, landmarks = (np.array(ids, dtype=int) for ids in (problem.view_ids, problem.landmark_ids))
    poses, points = scenes[f"{name}_true_poses"][views], scenes[f"{name}_true_landmarks"][landmarks]
    oracle = bearslam.refine(problem, (poses, points), sigma=sigma)
    before = time.perf_counter()
    try:
        result = bearslam.solve(problem, sigma=sigma)
    except bearslam.DegenerateError as error:
        print(f"{name}: {error}")
        result = None
    elapsed = 1e3 * (time.perf_counter() - before)
    verdict = "failed"
    if result is not None:
        apart = abs(result.cost - oracle.cost)
        verdict = (
            "same" if apart <= SAME[0] * oracle.cost + SAME[1] else "lower" if result.cost < oracle.cost else "higher"
        )
        if len(result.undetermined) != len(oracle.undetermined):
            verdict += "*"  # the costs are over different numbers of sightings
    return Outcome(
        name=name,
        size=f"{len(views)}x{len(landmarks)}",
        verdict=verdict,
        cost=np.inf if result is None else result.cost,
        oracle_cost=oracle.cost,
        error=np.inf if result is None else landmark_error(result.landmarks, points),
        oracle_error=landmark_error(oracle.landmarks, points),
        predicted=float(scenes[f"{name}_crlb"]),
        foreseen=np.inf if result is None else foreseen(problem, result, sigma),
        rivals=0 if result is None else len(result.alternatives),
        rms=np.nan if result is None else result.rms,
        squares=0.0 if result is None else float(np.nansum(result.residuals**2)),
        freedom=0 if result is None else freedom(result),
        milliseconds=elapsed,
    )


def summary(name: str, found: list[Outcome]) -> str:
    """The summary of a file."""
    count = len(found)

    def number(verdict: str) -> int:
        return sum(one.verdict.rstrip("*") == verdict for one in found)

    def of(some: Iterable[Outcome]) -> str:
        errors = [one.error for one in some]
        return f"{len(errors)}, error above 10 % in {sum(not error < 0.1 for error in errors)}"

    reached = number("same") + number("lower")
    sound = [one for one in found if not (one.doubtful or one.rivals)]
    good = sum(one.error < 0.1 for one in found)
    oracle = sum(one.oracle_error < 0.1 for one in found)
    noise = np.sqrt(sum(one.squares for one in found) / sum(one.freedom for one in found))
    lines = [
        f"{name}: {count} scenes",
        f"  cost of the oracle or lower  {reached} ({100 * reached / count:.1f} %): same {number('same')}, lower "
        f"{number('lower')}; higher {number('higher')}, failed {number('failed')}",
        f"  error below 5 / 10 %         {sum(one.error < 0.05 for one in found)} / {good} "
        f"(oracle {sum(one.oracle_error < 0.05 for one in found)} / {oracle})",
        f"  called ill-conditioned       {of(one for one in found if one.doubtful)}",
        f"  ambiguous (has alternatives) {of(one for one in found if one.rivals and not one.doubtful)} of the others",
        f"  neither                      {of(sound)}",
        f"  median error                 {np.median([one.error for one in found]):.4f}, of these last "
        f"{np.median([one.error for one in sound]) if sound else np.nan:.4f}",
        f"  residual rms                 median {np.degrees(np.median([one.rms for one in found])):.3f} deg",
        f"  noise of a bearing           {np.degrees(noise):.3f} deg, from all residuals and degrees of freedom",
        f"  time                         median {np.median([one.milliseconds for one in found]):.2f} ms, worst "
        f"{max(one.milliseconds for one in found):.1f} ms",
    ]
    return "\n".join(lines)


def scene_names(scenes: dict[str, Array]) -> list[str]:
    """The names of all scenes in a file."""
    return [key.removesuffix("_bearing") for key in scenes if key.endswith("_bearing")]


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE.npz")
    parser.add_argument("--sigma-deg", type=float, required=True, help="standard deviation of a bearing")
    parser.add_argument("--all", action="store_true", help="print a line for every scene")
    options = parser.parse_args()
    for path in options.files:
        with np.load(path) as file:
            scenes = dict(file)
        with tempfile.TemporaryDirectory() as folder:
            found = [judge(scenes, name, np.radians(options.sigma_deg), Path(folder)) for name in scene_names(scenes)]
        for one in found:
            if options.all or one.verdict != "same":
                print(one)
        print(summary(path.name, found), flush=True)


if __name__ == "__main__":
    sys.exit(main())
