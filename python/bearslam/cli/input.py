# SPDX-License-Identifier: MIT OR Apache-2.0
"""The argument FILE of a command, and the options that say how to read it."""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import replace

from bearslam.cli.console import print_error
from bearslam.data.problem import Problem
from bearslam.data.sightings import Sightings
from bearslam.errors import InvalidInputError
from bearslam.io.endings import FORMATS
from bearslam.io.files import load
from bearslam.io.mrclam import ROBOTS
from bearslam.io.text_graph import NOISES

__all__ = ["INPUT", "add_input", "read_input"]

INPUT = """\
FILE is a CSV file, a graph of g2o (.g2o), TORO or GTSAM (.graph, .toro, .txt), or the folder of a UTIAS MRCLAM data
set. The header of a CSV file names the columns: view, landmark, bearing [radians] or bearing_deg and, optionally, sigma
[radians] or sigma_deg. Lines that start with # are comments. Files may be compressed (.gz).
"""
FOLDER = ("robots", "start", "end", "every")
"""Options of `load` for MRCLAM folders."""


def add_input(verb: argparse.ArgumentParser) -> None:
    """Add the argument FILE and the options that belong to it."""
    verb.add_argument("file", metavar="FILE", help="file of bearings; - is standard input")
    verb.add_argument("--format", choices=FORMATS, help="format of FILE (default: from its ending or content)")
    verb.add_argument(
        "--noise",
        choices=NOISES,
        default="auto",
        help="noise of the motions in a TORO or GTSAM graph: information (toro, g2o) or covariance (graph, cov) "
        "(default: %(default)s)",
    )
    verb.add_argument(
        "--sensor",
        nargs="+",
        type=float,
        metavar="N",
        help="pose of the sensor on the vehicle, X Y or X Y DEG, if landmarks are relative to the vehicle; must follow "
        "FILE",
    )
    verb.add_argument(
        "--sigma-deg", type=float, metavar="DEG", help="standard deviation of every bearing, instead of those in FILE"
    )
    verb.add_argument(
        "--bearings-only", action="store_true", help="ignore odometry, priors and the initial map in FILE"
    )
    group = verb.add_argument_group("folders of the UTIAS MRCLAM data sets")
    group.add_argument(
        "--robots",
        type=int,
        nargs="+",
        choices=ROBOTS,
        metavar="N",
        help="robots to read (default: all); must follow FILE",
    )
    group.add_argument(
        "--start", type=float, metavar="S", help="skip measurements before this time, counted from the first one"
    )
    group.add_argument(
        "--end", type=float, metavar="S", help="skip measurements from this time on, counted from the first one"
    )
    group.add_argument(
        "--every", type=float, metavar="S", help="shortest time between two views of a robot (default: none)"
    )


def read_input(options: argparse.Namespace) -> Problem:
    """The problem in FILE, as the options say. Remarks about the file go to standard error."""
    sensor = options.sensor
    if sensor is not None:
        if len(sensor) not in (2, 3):
            raise InvalidInputError(f"--sensor: expected X Y or X Y DEG, got {len(sensor)} numbers")
        sensor = [*sensor[:2], *map(math.radians, sensor[2:])]
    if options.file != "-":
        source = options.file
    elif sys.stdin is not None:
        source = sys.stdin.buffer
    else:
        raise InvalidInputError("-: standard input is closed")
    deviation = options.sigma_deg
    if deviation is not None and not 0 < deviation <= 180:
        wanted = "at most 180" if deviation > 180 else "above 0"
        raise InvalidInputError(f"--sigma-deg: expected a number {wanted}, got {deviation:g}")
    folder = {name: getattr(options, name) for name in FOLDER if getattr(options, name) is not None}
    problem = load(source, format=options.format, noise=options.noise, sensor=sensor, **folder)
    for remark in problem.remarks:
        print_error(f"note: {remark}")
    if options.bearings_only:
        problem = problem.bearings_only()
    if deviation is not None:
        seen = problem.sightings
        # The covariances of the ranges would contradict this standard deviation.
        problem = replace(
            problem,
            sightings=Sightings(seen.view, seen.landmark, seen.bearing, math.radians(deviation)),
            offsets=None,
        )
    return problem
