#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Roh's four beacons on a square: degenerate from bearings alone, localisation if the beacons are known.

    python benches/real/roh.py FOLDER [--output roh.svg]

FOLDER holds landmark.csv and nine files (Xx,Yy).csv of 200 rows of four bearings in degrees. The mean bearings of the
nine positions become one problem, in a CSV file that `bearslam diagnose` reads. Then every row is resected from the
known beacons, and so are the means, whose headings are compared with the 90 degrees to which the robot was set.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import re
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import bearslam
from bearslam.cli.main import main as bearslam_command
from bearslam.data.align import wrap

Array = NDArray[np.float64]
NAME = re.compile(r"\(X(?P<x>[\d.]+),Y(?P<y>[\d.]+)\)\.csv")
HEADING = np.pi / 2
SIGMA_DEG = 2.2
"""Robust standard deviation of a mean bearing from the truth [deg]: systematic, so averaging does not help."""


def read(folder: Path) -> tuple[Array, Array, Array]:
    """Beacons (4, 2), positions (9, 2) and bearings (9, 200, 4) [rad]."""
    beacons = np.loadtxt(folder / "landmark.csv", delimiter=",")
    files = {path: match for path in sorted(folder.glob("(*).csv")) if (match := NAME.fullmatch(path.name))}
    positions = np.array([[float(match["x"]), float(match["y"])] for match in files.values()])
    return beacons, positions, np.radians([np.loadtxt(path, delimiter=",") for path in files])


def circular_mean(bearings: Array) -> Array:
    """Mean direction over the readings."""
    mean: Array = np.angle(np.exp(1j * bearings).mean(axis=1))
    return mean


def diagnosis(means: Array) -> str:
    """The report of the command line on the nine positions."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()) as said:
        path = str(Path(folder, "roh.csv"))
        bearslam.save(means, path)
        assert bearslam_command(["diagnose", path, "--sigma-deg", str(SIGMA_DEG)]) == 0
    return said.getvalue()


def quantiles(errors: Array) -> str:
    """Median, 90 % quantile and largest error."""
    return f"median {np.median(errors):.3f}, 90 % {np.quantile(errors, 0.9):.3f}, largest {errors.max():.3f}"


def draw(beacons: Array, truth: Array, result: bearslam.Reconstruction, path: str) -> None:
    """Draws the nine positions with their ellipses over the truth."""
    from bearslam.plotting.map import draw_to_file

    draw_to_file(result, path, truth=(truth, beacons))


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("--output", metavar="OUT", help="file to draw the positions to: .svg, .png or .pdf")
    options = parser.parse_args()
    beacons, positions, bearings = read(options.folder)
    means = circular_mean(bearings)
    truth = np.column_stack([positions, np.full(len(positions), HEADING)])

    print("From bearings alone, `bearslam diagnose`:", diagnosis(means), sep="\n")
    single = np.array([[bearslam.resect(beacons, row) for row in rows] for rows in bearings])
    away = np.hypot(*(single[..., :2] - positions[:, None]).transpose(2, 0, 1))
    print(f"Known beacons, each of {away.size} rows by `resect`: position error [m] {quantiles(away)}")
    resected = np.array([bearslam.resect(beacons, row) for row in means])
    result = bearslam.solve(
        means,
        sigma=np.radians(SIGMA_DEG),
        landmark_priors=bearslam.LandmarkPriors(range(len(beacons)), beacons, 0.001),
        covariance=True,
    )
    for name, poses in (("`resect`", resected), ("`solve` with the beacons as priors", result.poses)):
        away = np.hypot(*(poses[:, :2] - positions).T)
        turned = np.degrees(wrap(poses[:, 2] - HEADING))
        print(f"Known beacons, the means by {name}: position error [m] {quantiles(away)}")
        print(f"  heading less 90 [deg]: {', '.join(f'{angle:+.1f}' for angle in turned)}")
    spread = np.sqrt(np.trace(result.pose_covariance[:, :2, :2], axis1=1, axis2=2))
    print(
        f"Predicted position error at {SIGMA_DEG} deg [m]: median {np.median(spread):.3f}, largest {spread.max():.3f}"
    )
    print(f"Residuals of that solution: rms {np.degrees(result.rms):.2f} deg")
    if options.output is not None:
        draw(beacons, truth, result, options.output)


if __name__ == "__main__":
    sys.exit(main())
