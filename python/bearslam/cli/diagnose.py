# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command `bearslam diagnose`."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from typing import Any

from bearslam.cli.input import INPUT, add_input, read_input
from bearslam.cli.report import SHOWN
from bearslam.data.problem import Problem
from bearslam.io.text import printable
from bearslam.progress import ProgressLine
from bearslam.verbs.diagnose import Diagnosis, diagnose

__all__ = ["add"]

DESCRIPTION = f"""\
Report what the bearings of a file determine, what they do not, and why. The exit code is 0 whatever is found.

{INPUT}"""


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    verb = verbs.add_parser(
        "diagnose",
        help="report what the bearings determine, what they do not, and why",
        description=DESCRIPTION,
        epilog="examples:\n"
        "  bearslam diagnose bearings.csv --sigma-deg 0.5\n"
        "  bearslam diagnose bearings.csv --json > found.json\n",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_input(verb)
    verb.add_argument("--unoriented", action="store_true", help="take bearings as lines, known modulo 180 degrees")
    verb.add_argument(
        "--json", action="store_true", help="print JSON: the findings, directions and numbers, and all names"
    )
    verb.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> None:
    problem = read_input(options)
    with ProgressLine() as progress:
        diagnosis = diagnose(problem, oriented=not options.unoriented, progress=progress)
    if options.json:
        names = {"view_ids": list(problem.view_ids), "landmark_ids": list(problem.landmark_ids)}
        print(json.dumps({**diagnosis.to_dict(), **names}, indent=2, allow_nan=False))
        return
    print(diagnosis)
    for line in _names(problem, diagnosis):
        print(line)


def _names(problem: Problem, diagnosis: Diagnosis) -> list[str]:
    """Names of the views and landmarks in the findings, where the file has names other than their numbers."""
    lines = []
    kinds: list[tuple[str, Sequence[str]]] = [("view", problem.view_ids), ("landmark", problem.landmark_ids)]
    for kind, ids in kinds:
        found = {index for finding in diagnosis.findings for index in getattr(finding, f"{kind}s")}
        if any(ids[index] != str(index) for index in found):
            listed = [f"{index} {printable(ids[index])}" for index in sorted(found)]
            more = f", ... and {len(listed) - SHOWN} more" if len(listed) > SHOWN else ""
            lines.append(f"{kind}s: {', '.join(listed[:SHOWN])}{more}")
    return lines
