# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command `bearslam convert`."""

from __future__ import annotations

import argparse
from typing import Any

from bearslam.cli.console import same, writable
from bearslam.cli.input import INPUT, add_input, read_input
from bearslam.errors import InvalidInputError
from bearslam.io.files import PROBLEMS, save

__all__ = ["add"]

DESCRIPTION = f"""\
A file of bearings in another format.

{INPUT}\
OUT is .g2o for all that FILE says, or .csv for sightings alone.
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
        help="a file of bearings in another format",
        description=DESCRIPTION,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_input(verb)
    verb.add_argument("output", metavar="OUT", help="where to: .g2o or .csv")
    verb.set_defaults(run=_convert)


def _convert(options: argparse.Namespace) -> None:
    writable(options.output, PROBLEMS)
    if same(options.output, options.file):
        raise InvalidInputError(f"{options.output}: the result would replace what it is made from")
    save(read_input(options), options.output)
