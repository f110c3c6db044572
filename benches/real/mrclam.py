#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Five robots of a UTIAS MRCLAM data set as one problem, over windows of time: bearings and odometry, no ranges.

    python benches/real/mrclam.py FOLDER [--windows 3] [--length 300] [--every 0] [--output DIR] [--gtsam]

Every window is solved by least squares, with Huber's loss, and with robust=True, from the folder as it is: wrong
identities and gross outliers are included, unmarked. Sightings of other robots are not used; only landmarks connect the
robots. Errors are root mean squares over the landmarks after the best-fitting similarity, as shares of the
root-mean-square distance of the surveyed ones from their mean; "predicted" is the error that the covariance predicts
(frame "free_network"). Bearings are compared with motion capture: "wrong" ones differ by more than 5 degrees. With
--output the robust maps are drawn over the truth by `bearslam solve`; with --gtsam GTSAM continues from the
least-squares map.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import bearslam
from bearslam.cli.main import main as bearslam_command
from bearslam.data.align import wrap
from bearslam.data.maps import Map

Array = NDArray[np.float64]
GROSS = np.radians(5)
"""Error above which a bearing is wrong [rad]."""
KINDS: dict[str, dict[str, object]] = {"squares": {}, "huber": {"loss": "huber"}, "robust": {"robust": True}}


def share(landmarks: Array, truth: Array) -> float:
    """Root-mean-square error after the best similarity, relative to the radius of the truth."""
    known = np.isfinite(landmarks).all(axis=1)
    source, target = landmarks[known], truth[known]
    away = bearslam.align(source, target).apply(source) - target
    radius = np.sqrt(((target - target.mean(axis=0)) ** 2).sum(axis=1).mean())
    return float(np.sqrt((away**2).sum(axis=1).mean()) / radius)


def predicted(again: bearslam.Reconstruction) -> float:
    """The error of `share` that the covariance predicts."""
    assert again.landmark_covariance is not None
    radius = ((again.landmarks - again.landmarks.mean(axis=0)) ** 2).sum(axis=1).mean()
    return float(np.sqrt(np.trace(again.landmark_covariance, axis1=1, axis2=2).mean() / radius))


def misses(problem: bearslam.Problem, truth: Map) -> Array:
    """Measured minus true bearings."""
    seen = problem.sightings
    poses, points = truth.poses[seen.view], truth.landmarks[seen.landmark]
    x, y = (points - poses[:, :2]).T
    return wrap(seen.bearing - np.arctan2(y, x) + poses[:, 2])


def look(folder: Path, start: float, end: float, options: argparse.Namespace) -> None:
    """Solve and report one window."""
    problem = bearslam.load(folder, start=start, end=end, every=options.every)
    truth = bearslam.load_truth(folder, problem)
    off = misses(problem, truth)
    wrong = np.abs(off) > GROSS
    spread = 1.4826 * np.nanmedian(np.abs(off))
    print(f"{start:g} to {end:g} s: {problem}")
    print(f"  bearings less truth: robust {np.degrees(spread):.2f} deg; wrong by more than 5 deg: {wrong.sum()}")
    for name, kind in KINDS.items():
        before = time.perf_counter()
        result = bearslam.solve(problem, **kind)  # type: ignore[arg-type]
        seconds = time.perf_counter() - before
        line = (
            f"  {name:8} error {100 * share(result.landmarks, truth.landmarks):5.2f} %  cost {result.cost:8.1f}  rms "
            f"{np.degrees(result.rms):.2f} deg  undetermined {len(result.undetermined)}  {seconds:.2f} s"
        )
        if name == "robust":
            flagged = ~result.inliers
            # Without the outliers least squares are appropriate.
            seen, keep = problem.sightings, result.inliers
            sound = bearslam.Sightings(seen.view[keep], seen.landmark[keep], seen.bearing[keep], seen.sigma[keep])
            sound = bearslam.Problem(sound, problem.view_ids, problem.landmark_ids, odometry=problem.odometry)
            again = bearslam.refine(sound, result, covariance="free_network")
            line += f"  predicted {100 * predicted(again):.2f} %, {flagged.sum()} outliers, "
            line += f"{(flagged & wrong).sum()} of the wrong"
        print(line, flush=True)
    if options.gtsam:
        from beside_gtsam import compare

        compare(again, again.cost)
    if options.output is not None:
        options.output.mkdir(exist_ok=True)
        picture = str(options.output / f"mrclam_{start:g}.svg")
        arguments = ["solve", str(folder), "--start", str(start), "--end", str(end), "--every", str(options.every)]
        arguments += ["--robust", "--truth", str(folder), "--plot", picture, "-o", picture.replace(".svg", ".json")]
        with contextlib.redirect_stdout(io.StringIO()) as said:
            assert bearslam_command(arguments) == 0
        print("  bearslam solve:", *said.getvalue().splitlines()[:3], sep="\n    ")


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("--windows", type=int, default=3, help="number of windows (default: %(default)s)")
    parser.add_argument("--length", type=float, default=300.0, help="length of a window [s] (default: %(default)s)")
    parser.add_argument("--every", type=float, default=0.0, help="shortest time between views of a robot [s]")
    parser.add_argument("--output", type=Path, metavar="DIR", help="folder to draw the maps into")
    parser.add_argument("--gtsam", action="store_true", help="compare with GTSAM")
    options = parser.parse_args()
    for k in range(options.windows):
        look(options.folder, k * options.length, (k + 1) * options.length, options)


if __name__ == "__main__":
    sys.exit(main())
