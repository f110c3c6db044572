# SPDX-License-Identifier: MIT OR Apache-2.0
"""Bytes into text, or an error that says where they are none."""

from __future__ import annotations

from bearslam.errors import InvalidInputError

__all__ = ["decode"]


def decode(data: bytes, name: str) -> str:
    """Text of a file of that name, in UTF-8."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InvalidInputError(f"{name}:{line}: expected text in UTF-8, got byte {data[error.start]:#04x}") from None
