# SPDX-License-Identifier: MIT OR Apache-2.0
"""Text files that are read line by line: what is no text, no number or no identifier is named with its line."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence

from bearslam.data.checks import quote
from bearslam.errors import InvalidInputError

__all__ = ["decode", "identifier", "numbered", "numbers"]

LENGTH = 1000
"""Characters of all numbers on a line, beyond which they are none."""
LARGEST = 2**64
"""Beyond the identifiers that GTSAM and g2o hold."""


def decode(data: bytes, name: str) -> str:
    """The text of a file of that name."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InvalidInputError(f"{name}:{line}: expected text in UTF-8, got byte {data[error.start]:#04x}") from None


def numbered(text: str) -> Iterator[tuple[int, str]]:
    """Lines, ended as on any system, with their numbers from 1."""
    return enumerate(io.StringIO(text, newline=None), start=1)


def numbers(words: Sequence[str], where: str) -> list[float]:
    """Finite numbers, as C writes them."""
    try:
        values = list(map(float, words))
        joined = "".join(words)
        if all(map(math.isfinite, values)) and joined.isascii() and "_" not in joined and len(joined) <= LENGTH:
            return values
    except ValueError:
        pass
    wrong = next((word for word in words if not _is_number(word)), max(words, key=len, default=""))
    raise InvalidInputError(f"{where}: expected a finite number, got {quote(wrong)}")


def identifier(word: str, where: str) -> str:
    """A whole number that is not negative, in its shortest form."""
    if not (word.isascii() and word.isdecimal() and len(word) <= 20 and int(word) < LARGEST):
        raise InvalidInputError(f"{where}: expected the number of a vertex from 0, got {quote(word)}")
    return str(int(word))


def _is_number(word: str) -> bool:
    try:
        return "_" not in word and word.isascii() and math.isfinite(float(word))
    except ValueError:
        return False
