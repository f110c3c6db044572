# SPDX-License-Identifier: MIT OR Apache-2.0
"""Files compressed by gzip, up to a limit of size that guards against decompression bombs."""

from __future__ import annotations

import gzip
import io
import zlib

from bearslam.errors import InvalidInputError

__all__ = ["GZIP", "decompressed"]

GZIP = b"\x1f\x8b"
"""Magic bytes of gzip."""
LIMIT = 2**31
"""Largest decompressed size [bytes]."""


def decompressed(data: bytes, name: str) -> bytes:
    """The decompressed content of a file; the name is for errors."""
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as file:
            content = file.read(LIMIT + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InvalidInputError(f"{name}: expected a whole gzip file: {error}") from None
    if len(content) > LIMIT:
        raise InvalidInputError(f"{name}: expected at most {LIMIT} bytes when decompressed, got more")
    return content
