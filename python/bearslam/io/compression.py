# SPDX-License-Identifier: MIT OR Apache-2.0
"""Files that gzip has compressed, up to a size that a small file may not pretend to exceed."""

from __future__ import annotations

import gzip
import io
import zlib

from bearslam.errors import InvalidInputError

__all__ = ["GZIP", "decompressed"]

GZIP = b"\x1f\x8b"
"""How such files begin."""
LIMIT = 2**31
"""Bytes of a file that was compressed, beyond which it is not read."""


def decompressed(data: bytes, name: str) -> bytes:
    """The content of a compressed file of that name."""
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as file:
            content = file.read(LIMIT + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InvalidInputError(f"{name}: expected a whole gzip file: {error}") from None
    if len(content) > LIMIT:
        raise InvalidInputError(f"{name}: expected at most {LIMIT} bytes when decompressed, got more")
    return content
