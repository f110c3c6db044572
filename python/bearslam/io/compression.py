# SPDX-License-Identifier: MIT OR Apache-2.0
"""Files compressed by gzip, whose content is bounded as that of others: which guards against decompression bombs."""

from __future__ import annotations

import gzip
import io
import zlib

from bearslam.errors import InvalidInputError
from bearslam.io.bounded import read_bounded

__all__ = ["GZIP", "decompressed"]

GZIP = b"\x1f\x8b"
"""Magic bytes of gzip."""


def decompressed(data: bytes, name: str) -> bytes:
    """The decompressed content of a file; the name is for errors."""
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as file:
            return read_bounded(file, name)
    except (OSError, EOFError, zlib.error) as error:
        raise InvalidInputError(f"{name}: expected a whole gzip file: {error}") from None
