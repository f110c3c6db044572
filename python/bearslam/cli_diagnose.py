# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command `bearslam diagnose`."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from typing import Any

from bearslam.diagnose import Diagnosis, diagnose
from bearslam.errors import InvalidInputError
from bearslam.files import load
from bearslam.problem import Problem
from bearslam.progress import ProgressLine
from bearslam.report import printable

__all__ = ["add"]

DESCRIPTION = """\
What the bearings of a file determine, what they do not, and why. The file is as for `bearslam solve`. The exit code is
0 whatever is found.
"""


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    verb = verbs.add_parser(
        "diagnose",
        help="what the bearings determine, and why not",
        description=DESCRIPTION,
        epilog="example:\n  bearslam diagnose bearings.csv --sigma-deg 0.5\n",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verb.add_argument("file", metavar="FILE", help="CSV file of bearings; - is standard input")
    verb.add_argument("--sigma-deg", type=float, metavar="DEG", help="standard deviation of every bearing")
    verb.set_defaults(run=_diagnose)


def _diagnose(options: argparse.Namespace) -> None:
    if options.file != "-":
        problem = load(options.file)
    elif sys.stdin is not None:
        problem = load(sys.stdin.buffer)
    else:
        raise InvalidInputError("-: standard input is closed")
    sigma = 1.0
    if options.sigma_deg is not None:
        if problem.sightings.sigma is not None:
            raise InvalidInputError("--sigma-deg: the file has standard deviations of its own; give only one")
        if not 0 < options.sigma_deg < math.inf:
            raise InvalidInputError(f"--sigma-deg: expected a number above 0, got {options.sigma_deg:g}")
        sigma = math.radians(options.sigma_deg)
    with ProgressLine() as progress:
        diagnosis = diagnose(problem, sigma=sigma, progress=progress)
    print(diagnosis)
    for line in _names(problem, diagnosis):
        print(line)


def _names(problem: Problem, diagnosis: Diagnosis) -> list[str]:
    """Who the numbers of the findings are, where the file has other names for them."""
    lines = []
    kinds: list[tuple[str, Sequence[str]]] = [("view", problem.view_ids), ("landmark", problem.landmark_ids)]
    for kind, ids in kinds:
        named = {index for finding in diagnosis.findings for index in getattr(finding, f"{kind}s")}
        if any(ids[index] != str(index) for index in named):
            listed = ", ".join(f"{index} {printable(ids[index])}" for index in sorted(named))
            lines.append(f"{kind}s: {listed}")
    return lines
