# SPDX-License-Identifier: MIT OR Apache-2.0
"""Text files read line by line, with errors that name the line, and text that is safe to print."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence

from bearslam.data.checks import quote
from bearslam.errors import InvalidInputError

__all__ = ["csv_row", "csv_rows", "decode", "identifier", "numbered", "numbers", "printable"]

LENGTH = 1000
"""Largest number of characters of all numbers on a line."""
LARGEST = 2**64
"""Upper bound of the identifiers of GTSAM and g2o."""


def decode(data: bytes, name: str) -> str:
    """The content of a file as text; the name is for errors."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InvalidInputError(f"{name}:{line}: expected text in UTF-8, got byte {data[error.start]:#04x}") from None


def numbered(text: str) -> Iterator[tuple[int, str]]:
    """Lines with their numbers from 1, whatever the line endings."""
    return enumerate(io.StringIO(text, newline=None), start=1)


def numbers(words: Sequence[str], where: str) -> list[float]:
    """Finite numbers in the notation of C."""
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
    """A nonnegative integer in its shortest form."""
    if not (word.isascii() and word.isdecimal() and len(word) <= 20 and int(word) < LARGEST):
        raise InvalidInputError(f"{where}: expected the number of a vertex from 0, got {quote(word)}")
    return str(int(word))


def csv_rows(text: str, name: str) -> Iterator[tuple[int, list[str]]]:
    """Rows of CSV with the numbers of their lines; empty lines and lines that start with # are skipped."""
    for number, line in numbered(text):
        content = line.strip()
        if not content or content.startswith("#"):
            continue
        if '"' in content:
            try:
                (cells,) = csv.reader([content], strict=True, skipinitialspace=True)
            except (csv.Error, ValueError) as error:
                raise InvalidInputError(f"{name}:{number}: {error}") from None
        else:
            cells = content.split(",")
        yield number, [cell.strip() for cell in cells]


def csv_row(*cells: str) -> str:
    """One line of CSV, quoted so that it is never taken for a comment."""
    quoted = ('"' + cell.replace('"', '""') + '"' if any(mark in cell for mark in ',"#') else cell for cell in cells)
    return ",".join(quoted) + "\n"


def printable(text: object, limit: int = 60) -> str:
    """Text on one line, without control characters, shortened if it is long."""
    safe = "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in str(text))
    return safe if len(safe) <= limit else f"{safe[: limit - 3]}..."


def _is_number(word: str) -> bool:
    try:
        return "_" not in word and word.isascii() and math.isfinite(float(word))
    except ValueError:
        return False
