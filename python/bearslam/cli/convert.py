# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command `bearslam convert`."""

from __future__ import annotations

import argparse
from typing import Any

from bearslam.cli.console import same_file, writable
from bearslam.cli.input import INPUT, add_input, read_input
from bearslam.errors import InvalidInputError
from bearslam.io.endings import PROBLEMS
from bearslam.io.files import save

__all__ = ["add"]

DESCRIPTION = f"""\
Convert a file of bearings to another format.

{INPUT}\
OUT is .g2o to keep everything in FILE, or .csv for sightings alone.
"""
EXAMPLES = """\
examples:
  bearslam convert victoria_park.txt.gz park.g2o --sensor 3.78 0.5
  bearslam convert graph.g2o bearings.csv --bearings-only
"""


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    verb = verbs.add_parser(
        "convert",
        help="convert a file of bearings to another format",
        description=DESCRIPTION,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_input(verb)
    verb.add_argument("output", metavar="OUT", help="file to write to: .g2o or .csv")
    verb.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> None:
    writable(options.output, PROBLEMS)
    if same_file(options.output, options.file):
        raise InvalidInputError(f"{options.output}: the result would overwrite the file it is made from")
    save(read_input(options), options.output)
