#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Bearings with odometry, refined by bearslam and by GTSAM from the same start.

    python benches/peers/gtsam_odometry.py [--views 100 1000] [--repeat 5] [--start odometry|perturbed]

A simulated trajectory with half as many landmarks as views, minus those seen from fewer than three views; each view
sees about ten. Noise of 0.5 degrees for bearings, 1 cm and 0.3 degrees for motions. "odometry" starts at the
dead-reckoned poses, with the landmarks triangulated from them (or else 1 m along their first bearing); "perturbed"
starts 5 cm and 1 degree from the truth.

GTSAM has one ``BearingFactor2D`` per sighting, one ``BetweenFactorPose2`` per motion and a ``PriorFactorPose2`` that
fixes the first pose; Levenberg-Marquardt with its default elimination. Only ``optimize()`` is timed, which is all C++;
for bearslam the whole call from Python. Both run on one core, one after the other in each repetition. Costs are half
the sum of squares over standard deviations. GTSAM's cost uses its own residual of a motion, the logarithm (as its
wheels are built); the cost of bearslam's map is also evaluated by GTSAM, so that like is compared with like.
"""

from __future__ import annotations

import argparse
import importlib
import os
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import bearslam

try:
    gtsam = importlib.import_module("gtsam")
except ModuleNotFoundError as error:
    print(f"{error}: pip install gtsam", file=sys.stderr)
    sys.exit(77)

Array = NDArray[np.float64]
NOISE = np.radians(0.5)
SIGMA = (0.01, 0.01, np.radians(0.3))


def pose(k: int) -> Any:
    """Key of a pose."""
    return gtsam.symbol("x", k)


def landmark(k: int) -> Any:
    """Key of a landmark."""
    return gtsam.symbol("l", k)


def scene_of(views: int, seed: int) -> bearslam.Scene:
    """A trajectory in an arena that grows with it; landmarks that fewer than three views see are left out."""
    side = 5.0 * (views / 100) ** 0.5
    sight = 5.0 * (10 / (views / 2) * (views / 100) / np.pi) ** 0.5
    scene = bearslam.simulate(
        "trajectory", views, views // 2, noise=NOISE, seed=seed, width=side, height=side, sight=sight
    )
    kept = np.isfinite(scene.bearings).sum(axis=0) >= 3
    return bearslam.Scene(scene.poses, scene.landmarks[kept], scene.bearings[:, kept])


def perturbed(scene: bearslam.Scene, seed: int) -> tuple[Array, Array]:
    """The truth, moved a little."""
    random = np.random.default_rng(seed)
    poses = scene.poses + random.normal(0, [0.05, 0.05, np.radians(1)], scene.poses.shape)
    return poses, scene.landmarks + random.normal(0, 0.05, scene.landmarks.shape)


def reckoned(scene: bearslam.Scene, odometry: bearslam.Odometry) -> tuple[Array, Array]:
    """Poses along the odometry, and the landmarks triangulated from them."""
    at = gtsam.Pose2(*scene.poses[0])
    poses = [at]
    for delta in odometry.delta:
        at = at * gtsam.Pose2(*delta)
        poses.append(at)
    table = np.array([[p.x(), p.y(), p.theta()] for p in poses])
    landmarks = bearslam.triangulate(table, scene.bearings)
    for j in np.flatnonzero(np.isnan(landmarks[:, 0])):
        i = int(np.argmax(np.isfinite(scene.bearings[:, j])))
        angle = table[i, 2] + scene.bearings[i, j]
        landmarks[j] = table[i, :2] + [np.cos(angle), np.sin(angle)]
    return table, landmarks


def graph_of(scene: bearslam.Scene, odometry: bearslam.Odometry, first: Array) -> Any:
    """All factors."""
    graph = gtsam.NonlinearFactorGraph()
    bearing = gtsam.noiseModel.Isotropic.Sigma(1, NOISE)
    motion = gtsam.noiseModel.Diagonal.Sigmas(np.array(SIGMA))
    seen = scene.sightings
    for i, j, angle in zip(seen.view, seen.landmark, seen.bearing, strict=True):
        graph.add(gtsam.BearingFactor2D(pose(i), landmark(j), gtsam.Rot2.fromAngle(angle), bearing))
    for start, end, delta in zip(odometry.start, odometry.end, odometry.delta, strict=True):
        graph.add(gtsam.BetweenFactorPose2(pose(start), pose(end), gtsam.Pose2(*delta), motion))
    graph.add(gtsam.PriorFactorPose2(pose(0), gtsam.Pose2(*first), gtsam.noiseModel.Isotropic.Sigma(3, 1e-2)))
    return graph


def values_of(poses: Array, landmarks: Array) -> Any:
    """Poses and landmarks as values of GTSAM."""
    values = gtsam.Values()
    for k, row in enumerate(poses):
        values.insert(pose(k), gtsam.Pose2(*row))
    for k, row in enumerate(landmarks):
        values.insert(landmark(k), row)
    return values


def timed(run: Callable[[], Any]) -> tuple[float, Any]:
    """Milliseconds, and the result."""
    before = time.perf_counter()
    found = run()
    return 1e3 * (time.perf_counter() - before), found


def compare(views: int, repeat: int, start: str, seed: int) -> str:
    """One line of the table."""
    scene = scene_of(views, seed)
    odometry = scene.odometry(SIGMA, seed=seed)
    first = perturbed(scene, seed) if start == "perturbed" else reckoned(scene, odometry)
    graph = graph_of(scene, odometry, first[0][0])
    values = values_of(*first)
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setMaxIterations(100)
    parameters.setRelativeErrorTol(1e-9)
    parameters.setAbsoluteErrorTol(1e-12)
    parameters.setlambdaUpperBound(1e12)  # with the default it gives up at once from a distant start
    ours, theirs, ratios = [], [], []
    for _ in range(repeat):
        one, result = timed(
            lambda: bearslam.refine(
                scene.bearings, first, sigma=NOISE, odometry=odometry, refinement=bearslam.RefineOptions(tolerance=1e-9)
            )
        )
        optimizer = gtsam.LevenbergMarquardtOptimizer(graph, values, parameters)
        other, found = timed(optimizer.optimize)
        ours.append(one)
        theirs.append(other)
        ratios.append(other / one)
    if result.undetermined:
        by_gtsam = "undetermined landmarks"
    else:
        there = graph_of(scene, odometry, result.poses[0])
        by_gtsam = f"{there.error(values_of(result.poses, result.landmarks)):.6f}"
    return (
        f"| {views} | {len(scene.landmarks)} | {len(scene.sightings)} | {graph.error(values):.4g} | {result.cost:.6f} "
        f"| {by_gtsam} | {graph.error(found):.6f} | {result.iterations} | {optimizer.iterations()} "
        f"| {statistics.median(ours):.1f} | {statistics.median(theirs):.1f} | {statistics.median(ratios):.1f} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Bearings with odometry: bearslam compared with GTSAM.")
    parser.add_argument("--views", type=int, nargs="+", default=[100, 1000])
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--start", choices=("odometry", "perturbed"), default="odometry")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    print(
        "| views | landmarks | sightings | cost at the start | bearslam | the same by GTSAM | GTSAM | iterations "
        "| of GTSAM | ms | ms of GTSAM | ratio |"
    )
    print("|" + "---|" * 12)
    for views in args.views:
        print(compare(views, args.repeat, args.start, args.seed), flush=True)


if __name__ == "__main__":
    main()
