#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Victoria Park as one problem: 6969 poses, odometry and raw bearings; no initial guess, no ranges.

    python benches/real/victoria.py FOLDER [--output DIR] [--sigma-deg 0.3] [--gtsam]

FOLDER holds victoria_park.txt.gz and derived/. The odometry comes from the graph file, moved from the rear axle to the
laser; the bearings are the raw detections in derived/victoria_derived_associations.txt.gz. Both are written to one g2o
file, DIR/victoria.g2o, without a start, which `bearslam solve` reads. The standard deviations of a motion are those of
its residuals at the batch optimum, since those in the file do not match; otherwise the optimum is used for comparison
only. It was computed with the ranges of the same laser, which are not used here, so it is not an independent truth.

Prints the cost of the map and that of the refinement from the optimum (the oracle), distances to the optimum,
residuals, and with --gtsam the results of GTSAM on the same problem, from the dead-reckoned poses and from the map.
"""

from __future__ import annotations

import argparse
import gzip
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import bearslam
from bearslam.cli.main import main as bearslam_command
from bearslam.data.align import wrap

Array = NDArray[np.float64]
LASER = (3.78, 0.5)
"""Position of the laser in the frame of the rear axle [m]."""


def chained(poses: Array, motions: Array) -> Array:
    """Poses after motions that are in the frames of other poses, all (k, 3)."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y, turn = motions.T
    return np.column_stack([poses[:, 0] + c * x - s * y, poses[:, 1] + s * x + c * y, poses[:, 2] + turn])


def between(start: Array, end: Array) -> Array:
    """Poses (k, 3) in the frames of other poses."""
    c, s = np.cos(start[:, 2]), np.sin(start[:, 2])
    x, y = (end - start)[:, :2].T
    return np.column_stack([c * x + s * y, c * y - s * x, wrap(end[:, 2] - start[:, 2])])


def optimum(path: Path, problem: bearslam.Problem) -> tuple[Array, Array]:
    """The batch optimum in the order of a problem."""
    rows: dict[str, dict[str, list[float]]] = {"POSE": {}, "LM": {}}
    with gzip.open(path, "rt") as file:
        for tag, name, *fields in map(str.split, file):
            if tag in rows:
                rows[tag][name] = [float(field) for field in fields]
    nothing = [np.nan] * 3
    poses = np.array([rows["POSE"].get(name, nothing) for name in problem.view_ids])
    return poses, np.array([rows["LM"].get(name, nothing[:2]) for name in problem.landmark_ids])


def whole(folder: Path, sigma: float) -> tuple[bearslam.Problem, tuple[Array, Array]]:
    """The problem, and the optimum."""
    graph = bearslam.load(folder / "victoria_park.txt.gz", sensor=LASER)
    assert graph.odometry is not None
    rows = np.loadtxt(folder / "derived" / "victoria_derived_associations.txt.gz")
    views = {int(name): index for index, name in enumerate(graph.view_ids)}
    landmarks = {int(name): index for index, name in enumerate(graph.landmark_ids)}
    seen = bearslam.Sightings(
        [views[int(pose)] for pose in rows[:, 0]], [landmarks[int(one)] for one in rows[:, 2]], rows[:, 4], sigma
    )
    poses, points = optimum(folder / "derived" / "victoria_derived_optimum.txt.gz", graph)
    motions = graph.odometry
    off = between(poses[motions.start], poses[motions.end]) - motions.delta
    noise = np.column_stack([off[:, :2], wrap(off[:, 2])]).std(axis=0)
    print("standard deviations of a motion [m, m, deg]:", *np.round([*noise[:2], np.degrees(noise[2])], 4))
    odometry = bearslam.Odometry(motions.start, motions.end, motions.delta, noise)
    return bearslam.Problem(seen, graph.view_ids, graph.landmark_ids, odometry=odometry), (poses, points)


def reckoned(problem: bearslam.Problem) -> tuple[Array, Array]:
    """Poses along the odometry from the first, and landmarks triangulated from them, or else on their first bearing."""
    assert problem.odometry is not None
    motions = problem.odometry
    poses = np.full((len(problem.view_ids), 3), np.nan)
    poses[0] = 0.0
    for start, end, delta in zip(motions.start, motions.end, motions.delta, strict=True):
        poses[end] = chained(poses[start][None], delta[None])[0]
    table = np.full((len(poses), len(problem.landmark_ids)), np.nan)
    seen = problem.sightings
    table[seen.view, seen.landmark] = seen.bearing
    points = bearslam.triangulate(poses, table)
    for j in np.flatnonzero(np.isnan(points[:, 0])):
        first = int(np.argmax(np.isfinite(table[:, j])))
        angle = poses[first, 2] + table[first, j]
        points[j] = poses[first, :2] + 10.0 * np.array([np.cos(angle), np.sin(angle)])
    return poses, points


def describe(name: str, result: bearslam.Reconstruction, truth: tuple[Array, Array], seconds: float) -> None:
    """Cost, and distances to the optimum."""
    known = np.isfinite(result.landmarks[:, 0])
    target = truth[1][known]
    fit = bearslam.align(result.landmarks[known], target)
    away = np.hypot(*(fit.apply(result.landmarks[known]) - target).T)
    driven = np.isfinite(result.poses[:, 0])
    moved = fit.apply_poses(result.poses[driven])
    drift = np.hypot(*(moved - truth[0][driven])[:, :2].T)
    rms = np.sqrt((away**2).mean())
    radius = np.sqrt(((target - target.mean(axis=0)) ** 2).sum(axis=1).mean())
    print(
        f"{name:34} cost {result.cost:.3f}  rms {np.degrees(result.rms):.4f} deg  {result.termination} after "
        f"{result.iterations}, {seconds:.2f} s"
    )
    print(
        f"  {known.sum()} landmarks, to the optimum: median {np.median(away):.2f} m, rms {rms:.2f} m, "
        f"{100 * rms / radius:.2f} % of the radius; poses: median {np.median(drift):.2f} m, largest "
        f"{drift.max():.2f} m; scale {fit.scale:.4f}"
    )


def timed_solve(problem: bearslam.Problem) -> tuple[bearslam.Reconstruction, float]:
    """The result of `solve`, and its time [s]."""
    before = time.perf_counter()
    result = bearslam.solve(problem)
    return result, time.perf_counter() - before


def from_dead_reckoning(problem: bearslam.Problem, result: bearslam.Reconstruction) -> None:
    """Print the result of GTSAM without bearslam's map."""
    import gtsam
    from beside_gtsam import minimum

    graph, values = result.to_gtsam()
    poses, points = reckoned(problem)
    start = gtsam.Values()
    for key in values.keys():  # noqa: SIM118  (GTSAM's values are not a mapping)
        index = gtsam.symbolIndex(key)
        if chr(gtsam.symbolChr(key)) == "x":
            start.insert(key, gtsam.Pose2(*poses[index]))
        else:
            start.insert(key, points[index])
    found, seconds, iterations = minimum(graph, start)
    print(
        f"  GTSAM from dead reckoning: {graph.error(start):.4g} at the start, {graph.error(found):.4g} at the end "
        f"({iterations} iterations, {seconds:.2f} s)"
    )


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument(
        "--output", type=Path, default=Path("victoria"), metavar="DIR", help="folder to write to (default: %(default)s)"
    )
    parser.add_argument(
        "--sigma-deg", type=float, default=0.3, help="standard deviation of a bearing (default: %(default)s)"
    )
    parser.add_argument("--gtsam", action="store_true", help="compare with GTSAM")
    options = parser.parse_args()
    options.output.mkdir(exist_ok=True)
    problem, truth = whole(options.folder, np.radians(options.sigma_deg))
    paths = {name: str(options.output / f"victoria.{name}") for name in ("g2o", "json", "svg")}
    bearslam.save(problem, paths["g2o"])
    optimum_path = str(options.output / "optimum.g2o")
    bearslam.save(replace(problem, start=truth), optimum_path)
    print(f"bearslam solve {paths['g2o']}", flush=True)
    arguments = ["solve", paths["g2o"], "-o", paths["json"], "--plot", paths["svg"], "--truth", optimum_path]
    assert bearslam_command(arguments) == 0
    problem = bearslam.load(paths["g2o"])
    before = time.perf_counter()
    refined = bearslam.refine(problem, truth)
    describe("refined from the optimum (oracle)", refined, truth, time.perf_counter() - before)
    result, seconds = timed_solve(problem)
    describe("solve, no start", result, truth, seconds)
    print(f"cost over the oracle's, less 1: {result.cost / refined.cost - 1:+.3g}")
    if options.gtsam:
        from beside_gtsam import compare

        # Landmarks without a range still constrain headings; GTSAM cannot represent them.
        ranged = bearslam.refine(problem, result)
        compare(ranged, ranged.cost)
        from_dead_reckoning(problem, result)


if __name__ == "__main__":
    sys.exit(main())
