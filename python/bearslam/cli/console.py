# SPDX-License-Identifier: MIT OR Apache-2.0
"""What all commands share: errors on one line, and checks of output files before any work is done."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from bearslam.errors import InvalidInputError
from bearslam.io.endings import ending_of
from bearslam.io.text import printable

__all__ = ["print_error", "same_file", "writable"]


def print_error(message: str, code: int = 1) -> int:
    """Print one line to standard error and return an exit code."""
    print(f"bearslam: {printable(message, 1000)}", file=sys.stderr)
    return code


def same_file(one: str, other: str) -> bool:
    """Whether two paths lead to the same file."""
    return os.path.realpath(one) == os.path.realpath(other)


def writable(path: str | None, suffixes: Sequence[str]) -> None:
    """Check a path before the work is done, not after it: its ending must be known and its folder must exist."""
    if path is not None:
        ending_of(path, suffixes)
        if not Path(path).parent.is_dir():
            raise InvalidInputError(f"{path}: there is no folder {str(Path(path).parent)!r}")
