# SPDX-License-Identifier: MIT OR Apache-2.0
"""Files read piece by piece: one too large, or with a line without an end, is refused before it fills memory."""

from __future__ import annotations

import io
import os
from typing import Any, Protocol

from bearslam.errors import InvalidInputError

__all__ = ["LARGEST_FILE", "Readable", "read_bounded", "read_path"]

LARGEST_FILE = 2**31
"""Largest size of a file, decompressed [bytes]."""
LONGEST_LINE = 2**26
"""Largest length of a line of a text file [bytes]: JSON of half a million landmarks on one line."""
PIECE = 2**20
"""Bytes read at a time."""


class Readable(Protocol):
    """A file opened in binary mode."""

    def read(self, size: int, /) -> Any:
        """At most so many bytes, none at the end of the file."""


def read_path(path: str | os.PathLike[str]) -> bytes:
    """The content of a text file, compressed or not."""
    with open(path, "rb") as file:
        return read_bounded(file, os.fspath(path))


def read_bounded(file: Readable, name: str, *, text: bool = True) -> bytes:
    """The content of a file, of text with lines of bounded length; the name is for errors."""
    content = io.BytesIO()
    lines = open_line = 0
    while piece := file.read(PIECE):
        if not isinstance(piece, bytes):
            got = type(piece).__name__
            raise InvalidInputError(f"path: expected a path or a file opened in binary mode, got {got}")
        content.write(piece)
        if content.tell() > LARGEST_FILE:
            raise InvalidInputError(f"{name}: expected at most {LARGEST_FILE} bytes when decompressed, got more")
        last = max(piece.rfind(b"\n"), piece.rfind(b"\r"))
        if last < 0:
            open_line += len(piece)
        else:
            open_line = len(piece) - last - 1
            lines += piece.count(b"\n")
        if text and open_line > LONGEST_LINE:
            raise InvalidInputError(
                f"{name}:{lines + 1}: expected lines of at most {LONGEST_LINE} bytes, got one that is longer"
            )
    return content.getvalue()
