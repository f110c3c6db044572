# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command `bearslam simulate`."""

from __future__ import annotations

import argparse
import math
import sys
from typing import Any

from bearslam.cli.console import same_file, writable
from bearslam.data.checks import real
from bearslam.errors import InvalidInputError
from bearslam.io.endings import TRUTHS
from bearslam.io.files import save, save_truth
from bearslam.io.sightings_csv import render
from bearslam.verbs.simulate import LAYOUTS, OUTLIERS, simulate

__all__ = ["add"]


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    verb = verbs.add_parser(
        "simulate",
        help="simulate bearings of a random scene",
        description="Simulate the bearings of a random scene and write them as CSV.",
        epilog="example:\n  bearslam simulate mixed 4 9 --noise-deg 2 -o scene.csv --truth truth.json\n",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verb.add_argument("layout", choices=LAYOUTS, help="arrangement of views and landmarks")
    verb.add_argument("views", type=int, help="number of views")
    verb.add_argument("landmarks", type=int, help="number of landmarks")
    verb.add_argument(
        "--noise-deg",
        type=float,
        default=1.0,
        metavar="DEG",
        help="standard deviation of a bearing (default: %(default)s)",
    )
    verb.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the scene (default: %(default)s)")
    verb.add_argument("--width", type=float, default=7.0, metavar="M", help="width of the arena (default: %(default)s)")
    verb.add_argument(
        "--height", type=float, default=5.0, metavar="M", help="height of the arena (default: %(default)s)"
    )
    verb.add_argument(
        "--sight", type=float, default=math.inf, metavar="M", help="range of the sensor (default: unlimited)"
    )
    verb.add_argument(
        "--outliers",
        type=float,
        default=0.0,
        metavar="SHARE",
        help="share of the bearings that are outliers, 0 to 1 (default: none)",
    )
    verb.add_argument(
        "--outlier-kind",
        choices=OUTLIERS,
        default=OUTLIERS[0],
        help="random bearings, identities exchanged within views, two landmarks under one identity, or a mixture of "
        "swapped, turned and random bearings (default: %(default)s)",
    )
    verb.add_argument(
        "-o", "--output", metavar="OUT.csv", help="file to write the bearings to (default: standard output)"
    )
    verb.add_argument("--truth", metavar="OUT", help="file to write the true poses and landmarks to: .json or .csv")
    verb.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> None:
    writable(options.output, (".csv",))
    writable(options.truth, TRUTHS)
    if options.output is not None and options.truth is not None and same_file(options.output, options.truth):
        raise InvalidInputError(f"{options.truth}: bearings and truth would overwrite each other")
    scene = simulate(
        options.layout,
        options.views,
        options.landmarks,
        noise=math.radians(real("--noise-deg", options.noise_deg, 0.0, 180.0)),
        seed=options.seed,
        width=options.width,
        height=options.height,
        sight=options.sight,
        outliers=real("--outliers", options.outliers, 0.0, 1.0),
        outlier_kind=options.outlier_kind,
    )
    if options.truth is not None:
        save_truth(scene, options.truth)
    if options.output is None:
        sys.stdout.write(render(scene.bearings))
    else:
        save(scene.bearings, options.output)
