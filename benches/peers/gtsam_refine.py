#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Refinement by GTSAM of every scene of a file that scenes.py wrote.

    python benches/peers/gtsam_refine.py FILE [--repeat N] [--solver NAME]

One ``BearingFactor2D`` per sighting and Levenberg-Marquardt; landmarks are eliminated first. A loose
prior holds the first pose at its start; its cost is zero, so it does not move the optimum. The
scale is left to the damping. Only ``optimize()`` is timed, which is C++ throughout: graph, values,
ordering and optimizer exist before. Prints one line per scene: m n median_us least_us iterations cost,
with the cost as the sum of squared residuals [rad^2] and the times over N repetitions.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scenes import Scene, measure, read_scenes

SKIPPED = 77  # exit status that run.py reports as "not installed", as automake does

try:
    gtsam = importlib.import_module("gtsam")
except ModuleNotFoundError as error:
    print(f"{error}: pip install gtsam", file=sys.stderr)
    sys.exit(SKIPPED)


def refine(scene: Scene, repeat: int, solver: str) -> str:
    """Set up one scene, time its optimisation and report it."""
    m, n = scene.bearings.shape
    poses = [gtsam.symbol("x", i) for i in range(m)]
    landmarks = [gtsam.symbol("l", j) for j in range(n)]

    graph = gtsam.NonlinearFactorGraph()
    unit = gtsam.noiseModel.Isotropic.Sigma(1, 1.0)
    for (i, j), bearing in np.ndenumerate(scene.bearings):
        turn = gtsam.Rot2.fromAngle(bearing)
        graph.add(gtsam.BearingFactor2D(poses[i], landmarks[j], turn, unit))
    start = gtsam.Values()
    for key, pose in zip(poses, scene.start_poses, strict=True):
        start.insert(key, gtsam.Pose2(*pose))
    for key, point in zip(landmarks, scene.start_landmarks, strict=True):
        start.insert(key, point)
    loose = gtsam.noiseModel.Isotropic.Sigma(3, 1e-2)
    graph.add(gtsam.PriorFactorPose2(poses[0], start.atPose2(poses[0]), loose))

    order = gtsam.Ordering()
    for key in [*landmarks, *poses]:
        order.push_back(key)
    params = gtsam.LevenbergMarquardtParams()
    params.setOrdering(order)
    params.setLinearSolverType(f"{solver.upper()}_CHOLESKY")
    params.setMaxIterations(100)
    params.setRelativeErrorTol(1e-9)  # as in ceres_refine.cpp
    params.setAbsoluteErrorTol(1e-15)

    optimizers = []

    def prepare() -> Callable[[], Any]:
        optimizers.append(gtsam.LevenbergMarquardtOptimizer(graph, start, params))
        run: Callable[[], Any] = optimizers[-1].optimize
        return run

    median, least, found = measure(prepare, repeat)
    found_poses = np.array([[p.x(), p.y(), p.theta()] for p in map(found.atPose2, poses)])
    cost = scene.cost(found_poses, np.array([found.atPoint2(key) for key in landmarks]))
    return f"{m} {n} {median:.3f} {least:.3f} {optimizers[-1].iterations()} {cost:.12e}"


def main() -> None:
    """Refine every scene."""
    parser = argparse.ArgumentParser(description="Refine scenes by GTSAM and time it.")
    parser.add_argument("file", type=Path)
    parser.add_argument("--repeat", type=int, default=15)
    parser.add_argument("--solver", choices=("sequential", "multifrontal"), default="sequential")
    args = parser.parse_args()
    for scene in read_scenes(args.file):
        print(refine(scene, args.repeat, args.solver))


if __name__ == "__main__":
    main()
