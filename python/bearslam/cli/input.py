# SPDX-License-Identifier: MIT OR Apache-2.0
"""The file that a command reads, and the options that say how."""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import replace

from bearslam.cli.console import complain
from bearslam.data.problem import Problem, Sightings
from bearslam.errors import InvalidInputError
from bearslam.io.files import FORMATS, load
from bearslam.io.mrclam import ROBOTS
from bearslam.io.text_graph import NOISES

__all__ = ["INPUT", "add_input", "read_input"]

INPUT = """\
FILE is CSV with a header that names the columns view, landmark, bearing [radians] or bearing_deg and, if need be, sigma
[radians] or sigma_deg; or a graph of g2o (.g2o), TORO or GTSAM (.graph, .toro, .txt). Any of them may be compressed
(.gz). Lines that start with # are comments. Or it is a folder of a UTIAS MRCLAM data set.
"""
FOLDER = ("robots", "start", "end", "every")
"""Options for folders, as `load` takes them."""


def add_input(verb: argparse.ArgumentParser) -> None:
    """Add the argument FILE and the options that belong to it."""
    verb.add_argument("file", metavar="FILE", help="file of bearings; - is standard input")
    verb.add_argument("--format", choices=FORMATS, help="of FILE (default: what its ending or content says)")
    verb.add_argument(
        "--noise",
        choices=NOISES,
        default="auto",
        help="of a graph of TORO or GTSAM: information (toro, g2o) or covariance (graph, cov) (default: %(default)s)",
    )
    verb.add_argument(
        "--sensor",
        nargs="+",
        type=float,
        metavar="N",
        help="X Y or X Y DEG, after FILE: where the sensor is on the vehicle, if landmarks are in its frame",
    )
    verb.add_argument("--sigma-deg", type=float, metavar="DEG", help="standard deviation of every bearing, over FILE's")
    verb.add_argument(
        "--bearings-only", action="store_true", help="leave out odometry, known poses and landmarks, start"
    )
    group = verb.add_argument_group("folders of the UTIAS MRCLAM data sets")
    group.add_argument(
        "--robots", type=int, nargs="+", choices=ROBOTS, metavar="N", help="after FILE: which robots (default: all)"
    )
    group.add_argument("--start", type=float, metavar="S", help="leave out what is earlier after the first measurement")
    group.add_argument("--end", type=float, metavar="S", help="leave out what is not earlier than that")
    group.add_argument("--every", type=float, metavar="S", help="least time between views of a robot (default: none)")


def read_input(options: argparse.Namespace) -> Problem:
    """The problem that the options name. What its file says besides goes to standard error."""
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
    if deviation is not None and not 0 < deviation < math.inf:
        raise InvalidInputError(f"--sigma-deg: expected a number above 0, got {deviation:g}")
    folder = {name: getattr(options, name) for name in FOLDER if getattr(options, name) is not None}
    problem = load(source, format=options.format, noise=options.noise, sensor=sensor, **folder)
    for remark in problem.remarks:
        complain(f"note: {remark}")
    if options.bearings_only:
        problem = problem.bearings_only()
    if deviation is not None:
        seen = problem.sightings
        # The covariances of ranges say something else of the same bearings.
        problem = replace(
            problem,
            sightings=Sightings(seen.view, seen.landmark, seen.bearing, math.radians(deviation)),
            offsets=None,
        )
    return problem
