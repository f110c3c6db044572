# SPDX-License-Identifier: MIT OR Apache-2.0
"""Tables of numbers in text files, with columns between blanks, and errors that name the line."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bearslam.data.checks import FloatArray, quote
from bearslam.errors import InvalidInputError
from bearslam.io.bounded import read_path
from bearslam.io.compression import decompressed
from bearslam.io.text import decode

__all__ = ["TIME", "Table", "read_table", "table_path"]

TIME = 1e12
"""Largest valid time [s]."""


class Table(NamedTuple):
    """Numbers of a file (k, columns), with its text to tell their lines."""

    name: str
    text: str
    values: FloatArray

    def line(self, row: int) -> int:
        """Line number of a row."""
        return [number for number, _ in _lines(self.text)][row]

    def error(self, row: int, message: str) -> InvalidInputError:
        """An error about a row."""
        return InvalidInputError(f"{self.name}:{self.line(row)}: {message}")

    def refuse(self, bad: NDArray[np.bool_], message: str) -> None:
        """Raise an error about the first bad row, if there is one; the message may show its numbers."""
        if bad.any():
            row = int(np.argmax(bad))
            raise self.error(row, message.format(*self.values[row].tolist()))


def read_table(folder: Path, name: str, columns: tuple[str, ...]) -> Table:
    """Numbers of one file of a folder; all must be finite, and times in the first column must not decrease."""
    path = table_path(folder, name)
    if path is None:
        raise InvalidInputError(
            f"{os.fspath(folder)}: expected a file {name} or {name}.gz, as a UTIAS MRCLAM data set has, got neither"
        )
    text = _text(path)
    shown = os.fspath(path)
    values = _numbers(shown, text, columns)
    table = Table(shown, text, values)
    bad = ~np.isfinite(values)
    if bad.any():
        row, column = np.argwhere(bad)[0].tolist()
        raise table.error(row, f"expected a finite number as {columns[column]}, got {values[row, column]:g}")
    if len(values) == 0:
        raise InvalidInputError(f"{shown}: expected lines of {len(columns)} numbers ({', '.join(columns)}), got none")
    if columns[0] == "time":
        time = values[:, 0]
        table.refuse(np.abs(time) > TIME, "expected a time in seconds, got {0:g}")
        back = np.flatnonzero(np.diff(time) < 0)
        if len(back):
            row = int(back[0]) + 1
            raise table.error(
                row, f"expected a time no earlier than that of the line above, {time[row - 1]}, got {time[row]}"
            )
    return table


def table_path(folder: Path, name: str) -> Path | None:
    """The file of that name, or its compressed form; None where there is neither."""
    return next((path for path in (folder / name, folder / f"{name}.gz") if path.exists()), None)


def _text(path: Path) -> str:
    data = read_path(path)
    if path.suffix == ".gz":
        data = decompressed(data, os.fspath(path))
    return decode(data, os.fspath(path))


def _numbers(name: str, text: str, columns: tuple[str, ...]) -> FloatArray:
    """Read with NumPy, which is fast; if it fails, read line by line for an error with the line."""
    lines = _lines(text)
    if not lines:
        return np.empty((0, len(columns)))
    values: FloatArray
    try:
        values = np.loadtxt([line for _, line in lines], ndmin=2)
        if values.shape[1] == len(columns):
            return values
        trouble = f"got {values.shape[1]} columns"
    except ValueError as error:
        trouble = str(error)
    for number, line in lines:
        cells = line.split()
        if len(cells) != len(columns):
            raise InvalidInputError(
                f"{name}:{number}: expected {len(columns)} numbers ({', '.join(columns)}), got {quote(line)}"
            )
        for column, cell in zip(columns, cells, strict=True):
            if not _is_number(cell):
                raise InvalidInputError(f"{name}:{number}: expected a number as {column}, got {quote(cell)}")
    raise InvalidInputError(f"{name}: expected lines of {len(columns)} numbers ({', '.join(columns)}): {trouble}")


def _is_number(cell: str) -> bool:
    """Whether NumPy accepts it as a number; the float of Python accepts more."""
    try:
        float(cell)
    except ValueError:
        return False
    return cell.isascii() and "_" not in cell


def _lines(text: str) -> list[tuple[int, str]]:
    """Lines that are not empty without their comments, with their numbers."""
    stripped = (line.partition("#")[0].strip() for line in io.StringIO(text, newline=None))
    return [(number, line) for number, line in enumerate(stripped, start=1) if line]
