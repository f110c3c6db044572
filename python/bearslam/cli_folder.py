# SPDX-License-Identifier: MIT OR Apache-2.0
"""Options of the command line for folders of the UTIAS MRCLAM data sets."""

from __future__ import annotations

import argparse
from typing import Any

from bearslam.mrclam import ROBOTS

__all__ = ["add", "options"]

NAMES = ("robots", "start", "end", "every")


def add(verb: argparse.ArgumentParser) -> None:
    """Add the options to a command that reads files."""
    group = verb.add_argument_group("folders of the UTIAS MRCLAM data sets")
    group.add_argument("--robots", type=int, nargs="+", choices=ROBOTS, metavar="N", help="which robots (default: all)")
    group.add_argument("--start", type=float, metavar="S", help="leave out what is earlier after the first measurement")
    group.add_argument("--end", type=float, metavar="S", help="leave out what is not earlier than that")
    group.add_argument("--every", type=float, metavar="S", help="least time between views of a robot (default: none)")


def options(given: argparse.Namespace) -> dict[str, Any]:
    """Those that were given, as `load` takes them."""
    return {name: getattr(given, name) for name in NAMES if getattr(given, name) is not None}
