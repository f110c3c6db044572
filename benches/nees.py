#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Are the covariances correct? Normalised estimation errors squared of poses and landmarks over many scenes.

    python benches/nees.py [--scenes 1000] [--seed 0]

In every scene one view and one landmark are drawn, and the squared errors of their estimates in units of their
covariances, e^T C^-1 e, are averaged over the scenes. If the covariances are correct, the sum is chi-square with 3
(pose) or 2 (landmark) degrees of freedom per scene. The estimate is the minimum that the refinement reaches from the
truth; the truth is transformed into the frame of the estimate by the rule of the frame:

first_view    the first view at the origin, and the rms distance of the others from it 1
free_network  aligned with the estimate by all positions
odometry      the first view at the origin

Needs NumPy and SciPy. Prints one line per quantity, with the two-sided bands of the mean and whether it is inside.
Scenes in which the drawn view or landmark has no estimate (a landmark next to a view may move onto it) do not count.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

import bearslam
from bearslam.data.align import wrap
from bearslam.data.maps import Map, register

Array = NDArray[np.float64]
DEGREES = {"pose": 3, "landmark": 2}
ODOMETRY = (0.01, 0.01, 0.005)
"""Standard deviations of a motion [m, rad]."""
NOISE = np.radians(0.1)


def at_home(truth: Map, estimate: Map) -> Map:
    """The truth with its first view at the origin."""
    x, y, theta = truth.poses[0]
    c, s = np.cos(theta), np.sin(theta)
    turn = bearslam.Similarity(1.0, -theta, np.array([-c * x - s * y, s * x - c * y]))
    return Map(turn.apply_poses(truth.poses), turn.apply(truth.landmarks))


def normalised(truth: Map, estimate: Map) -> Map:
    """The truth with its first view at the origin, and a root-mean-square distance of 1 of the others from it."""
    home = at_home(truth, estimate)
    scale = 1 / np.sqrt((home.poses[1:, :2] ** 2).sum(axis=1).mean())
    return Map(home.poses * [scale, scale, 1], home.landmarks * scale)


def laid_over(truth: Map, estimate: Map) -> Map:
    """The truth aligned with the estimate by all positions."""
    similarity = register(truth, estimate)
    return Map(similarity.apply_poses(truth.poses), similarity.apply(truth.landmarks))


@dataclass(frozen=True)
class Case:
    """Scenes of one kind, and the frame of the covariances."""

    layout: str
    views: int
    landmarks: int
    frame: str
    truth: Callable[[Map, Map], Map]
    odometry: bool = False
    sight: float = np.inf

    def __str__(self) -> str:
        return f"{self.layout} {self.views} x {self.landmarks}{' odometry' if self.odometry else ''}, {self.frame}"


CASES = [
    Case("enclosed", 8, 15, "first_view", normalised),
    Case("enclosed", 8, 15, "free_network", laid_over),
    Case("mixed", 8, 15, "first_view", normalised),
    Case("mixed", 8, 15, "free_network", laid_over),
    Case("trajectory", 20, 15, "first_view", at_home, odometry=True, sight=3.0),
]


def squares(case: Case, scenes: int, seed: int) -> dict[str, Array]:
    """Normalised squared errors of a pose and a landmark of each scene; NaN where it has no estimate."""
    found: dict[str, list[float]] = {"pose": [], "landmark": []}
    for number in range(seed, seed + scenes):
        random = np.random.default_rng(number)
        scene = bearslam.simulate(
            case.layout,
            case.views,
            case.landmarks,
            noise=NOISE,
            seed=number,
            sight=case.sight,  # type: ignore[arg-type]
        )
        result = bearslam.refine(
            scene.bearings,
            scene,
            sigma=NOISE,
            odometry=scene.odometry(ODOMETRY, seed=number) if case.odometry else None,
            covariance=case.frame,  # type: ignore[arg-type]
        )
        truth = case.truth(Map(scene.poses, scene.landmarks), Map(result.poses, result.landmarks))
        view = random.integers(1, case.views)
        landmark = random.choice(np.flatnonzero(np.isfinite(result.landmarks[:, 0])))
        error = result.poses[view] - truth.poses[view]
        error[2] = wrap(error[2])
        found["pose"].append(error @ np.linalg.solve(result.pose_covariance[view], error))
        error = result.landmarks[landmark] - truth.landmarks[landmark]
        found["landmark"].append(error @ np.linalg.solve(result.landmark_covariance[landmark], error))
    return {name: np.array(values) for name, values in found.items()}


def band(degrees: int, scenes: int, probability: float) -> tuple[float, float]:
    """Two-sided band of the mean over scenes."""
    tail = (1 - probability) / 2
    low, high = stats.chi2.ppf([tail, 1 - tail], degrees * scenes) / scenes
    return float(low), float(high)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Normalised estimation errors squared.")
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    print("| scenes | frame | of | dof | scenes with an estimate | mean | 95 % band | 99.9 % band | in |")
    print("|---|---|---|---|---|---|---|---|---|")
    for case in CASES:
        kind, frame = str(case).split(", ")
        for name, values in squares(case, args.scenes, args.seed).items():
            known = values[np.isfinite(values)]
            mean, degrees = known.mean(), DEGREES[name]
            bands = [band(degrees, len(known), probability) for probability in (0.95, 0.999)]
            inside = [low <= mean <= high for low, high in bands]
            where = "95 %" if inside[0] else "99.9 %" if inside[1] else "NEITHER"
            texts = [f"{low:.3f} to {high:.3f}" for low, high in bands]
            print(
                f"| {kind} | {frame} | {name} | {degrees} | {len(known)} | {mean:.3f} | {texts[0]} | {texts[1]} "
                f"| {where} |"
            )


if __name__ == "__main__":
    main()
