# SPDX-License-Identifier: MIT OR Apache-2.0
"""What all commands share: complaints on one line, and looks at files before the work."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from bearslam.cli.report import printable
from bearslam.errors import InvalidInputError
from bearslam.io.files import kind

__all__ = ["complain", "same", "writable"]


def complain(message: str, code: int = 1) -> int:
    """Print a line to standard error, and return an exit code."""
    print(f"bearslam: {printable(message, 1000)}", file=sys.stderr)
    return code


def same(one: str, other: str) -> bool:
    """Whether two paths lead to the same file."""
    return os.path.realpath(one) == os.path.realpath(other)


def writable(path: str | None, suffixes: Sequence[str]) -> None:
    """Refuse a path that nothing can be written to: before the work rather than after it."""
    if path is not None:
        kind(path, suffixes)
        if not Path(path).parent.is_dir():
            raise InvalidInputError(f"{path}: there is no folder {str(Path(path).parent)!r}")
