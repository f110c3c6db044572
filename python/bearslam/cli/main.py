# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command `bearslam`: its parser, and errors as exit codes."""

from __future__ import annotations

import argparse
import io
import os
import sys
import warnings
from collections.abc import Sequence
from typing import NoReturn

from bearslam._core import __version__
from bearslam.cli import convert, demo, diagnose, simulate, solve, sweep
from bearslam.cli.console import print_error
from bearslam.errors import BearslamError, BearslamWarning

__all__ = ["main"]

EXAMPLES = """\
examples:
  bearslam demo
  bearslam simulate mixed 4 9 --noise-deg 2 -o scene.csv
  bearslam solve scene.csv -o map.json --plot map.png
  bearslam simulate enclosed 4 9 | bearslam solve -
  bearslam diagnose scene.csv
  bearslam convert graph.g2o scene.csv --bearings-only
  bearslam sweep mixed --trials 10 -o sweep.csv --plot failures.png
"""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(2, f"bearslam: error: {message} (try {self.prog} --help)\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code: 0, 1 after an error, 2 for wrong usage."""
    if sys.stderr is None:  # closed by the caller: what is printed there must not go elsewhere, nor end the command
        sys.stderr = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names may have characters that the terminal cannot show
    options = _parser().parse_args(arguments)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", BearslamWarning)  # the commands print them
            code: int | None = options.run(options)
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        # The reader has closed the pipe. Without this, Python would complain again on closing the stream.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        return print_error("interrupted", 130)
    except OSError as error:
        where = "" if error.filename is None else f"{error.filename}: "
        return print_error(f"error: {where}{error.strerror or error}")
    except MemoryError:
        return print_error("error: not enough memory")
    except (BearslamError, ImportError) as error:
        return print_error(f"error: {error}")
    return code or 0


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="bearslam",
        description="Planar structure and motion from bearings alone.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"bearslam {__version__}")
    verbs = parser.add_subparsers(metavar="COMMAND", required=True, title="commands")
    for command in (solve, simulate, diagnose, convert, sweep, demo):
        command.add(verbs)
    return parser
