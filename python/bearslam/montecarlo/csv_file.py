# SPDX-License-Identifier: MIT OR Apache-2.0
"""The result of a sweep as text: comments that say what was asked for, then a line for each cell and start."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from typing import Any, BinaryIO

import numpy as np

from bearslam.data.checks import SEED_LIMIT, quote, whole
from bearslam.errors import InvalidInputError
from bearslam.montecarlo.grid import Grid
from bearslam.montecarlo.result import SweepResult
from bearslam.montecarlo.table import coordinates, statistics
from bearslam.montecarlo.tally import COUNTS, HIGHEST, LOWEST, QUANTITIES, Tally, key

__all__ = ["read", "write"]

TITLE = "# bearslam sweep 1"
KEYS = ("layout", "layouts", "noise", "views", "landmarks", "starts", "trials", "seeds")
"""Of the comments; layout where it was given as a word, layouts where as a sequence."""
BINS = tuple(f"{quantity}_bins" for quantity in QUANTITIES)
PLACE = ("layout", "noise", "views", "landmarks", "start")


def write(result: SweepResult, file: BinaryIO) -> None:
    """Write everything; the same result gives the same bytes."""
    grid = result.grid
    asked = {
        "layout" if grid.single else "layouts": grid.layout,
        "noise": map(repr, grid.noise),
        "views": map(str, grid.views),
        "landmarks": map(str, grid.landmarks),
        "starts": grid.start,
        "trials": [str(result.trials)],
        "seeds": map(str, result.seeds),
    }
    lines = [TITLE, *(f"# {name}: {' '.join(values)}" for name, values in asked.items())]
    columns: dict[str, list[Any]] = coordinates(result)
    columns |= {name: values.tolist() for name, values in statistics(result).items()}
    columns |= {name: result.tally.counts[:, index].tolist() for index, name in enumerate(COUNTS)}
    columns |= dict(zip(BINS, _histograms(result.tally), strict=True))
    lines.append(",".join(columns))
    lines += [",".join(map(str, row)) for row in zip(*columns.values(), strict=True)]
    file.write(("\n".join(lines) + "\n").encode())


def read(file: BinaryIO, name: str) -> SweepResult:
    """The result in a file of that name."""
    lines = _lines(file.read(), name)
    number, title = next(lines, (1, ""))
    if title != TITLE:
        raise InvalidInputError(f"{name}:{number}: expected {TITLE!r}, got {quote(title)}")
    asked: dict[str, list[str]] = {}
    header = ""
    for number, header in lines:
        if not header.startswith("#"):
            break
        word, _, values = header.removeprefix("#").partition(":")
        if word.strip() not in KEYS:
            raise InvalidInputError(f"{name}:{number}: expected one of {', '.join(KEYS)}, got {quote(header)}")
        asked[word.strip()] = values.split()
    grid, trials, seeds = _asked(asked, f"{name}:{number}")
    names = header.split(",")
    missing = next((column for column in (*PLACE, *COUNTS, *BINS) if column not in names), None)
    if missing is not None:
        raise InvalidInputError(f"{name}:{number}: expected a column {missing}, got {quote(header)}")
    rows = []
    for group in range(grid.cells * len(grid.start)):
        number, line = next(lines, (number + 1, ""))
        cells = line.split(",")
        if len(cells) != len(names):
            came = len(cells) if line else "the end of the file"
            raise InvalidInputError(f"{name}:{number}: expected {len(names)} values, got {came}")
        row = dict(zip(names, cells, strict=True))
        _place(grid, group, row, f"{name}:{number}")
        rows.append((f"{name}:{number}", row))
    number, line = next(lines, (0, ""))
    if line:
        raise InvalidInputError(f"{name}:{number}: expected the end of the file, got {quote(line)}")
    return SweepResult(grid, trials, seeds, _tally(grid, trials, rows))


def _tally(grid: Grid, trials: int, rows: Sequence[tuple[str, dict[str, str]]]) -> Tally:
    """What the lines count."""
    counts = np.zeros((len(rows), len(COUNTS)), dtype=np.int64)
    bins: list[tuple[int, int, int, int]] = []
    for group, (where, cells) in enumerate(rows):
        counts[group] = [_count(cells[column], column, where) for column in COUNTS]
        if counts[group, 0] > trials or counts[group, 0] != counts[group - group % len(grid.start), 0]:
            raise InvalidInputError(
                f"{where}: expected as many trials from each start, {trials} at most, got {counts[group, 0]}"
            )
        for quantity, column in enumerate(BINS):
            bins += [(group, quantity, place, size) for place, size in _bins(cells[column], column, where)]
    groups, quantities, places, sizes = np.array(bins, dtype=np.int64).reshape(-1, 4).T
    tally = Tally(counts, key(groups, quantities, places), sizes.copy())
    flaw = tally.flaw()
    if flaw is not None:
        raise InvalidInputError(f"{rows[flaw[0]][0]}: {flaw[1]}")
    return tally


def _lines(data: bytes, name: str) -> Iterator[tuple[int, str]]:
    """Lines that are not empty, and their numbers."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InvalidInputError(f"{name}:{line}: expected text in UTF-8, got byte {data[error.start]:#04x}") from None
    lines = io.StringIO(text, newline=None).readlines()
    if lines and not lines[-1].endswith("\n"):
        raise InvalidInputError(f"{name}:{len(lines)}: expected a whole line, got one without an end")
    for number, content in enumerate(lines, start=1):
        if content.strip():
            yield number, content.strip()


def _asked(asked: dict[str, list[str]], where: str) -> tuple[Grid, int, tuple[int, ...]]:
    """What the comments above a line say."""
    single = "layout" in asked
    for word in KEYS:
        if word not in asked and word not in ("layout", "layouts"):
            raise InvalidInputError(f"{where}: expected a comment '# {word}: ...' above, got none")
    layouts = asked.get("layout", []) + asked.get("layouts", [])
    if len(asked["trials"]) != 1 or (single and len(layouts) != 1):
        raise InvalidInputError(f"{where}: expected one value as layout and trials in the comments above")
    try:
        views, landmarks = ([_count(value, word, where) for value in asked[word]] for word in ("views", "landmarks"))
        noise = [_number(value, where) for value in asked["noise"]]
        grid = Grid.of(layouts[0] if single else layouts, views, landmarks, noise, asked["starts"])
        trials = whole("trials", _count(asked["trials"][0], "trials", where), 1)
        seeds = tuple(_count(value, "seeds", where, SEED_LIMIT) for value in asked["seeds"])
    except InvalidInputError as error:
        text = str(error)
        raise InvalidInputError(text if text.startswith(where) else f"{where}: in the comments above: {text}") from None
    if not seeds or len(set(seeds)) < len(seeds):
        raise InvalidInputError(f"{where}: expected seeds in the comments above, every one once")
    return grid, trials, seeds


def _place(grid: Grid, group: int, got: dict[str, str], where: str) -> None:
    """Whether a line is of the cell and the start that belong there."""
    cell, start = divmod(group, len(grid.start))
    layout, noise, views, landmarks = grid.cell(cell)
    wanted = {
        "layout": layout,
        "noise": repr(noise),
        "views": str(views),
        "landmarks": str(landmarks),
        "start": grid.start[start],
    }
    for column, text in wanted.items():
        if got[column] != text and not (column == "noise" and _number(got[column], where) == noise):
            raise InvalidInputError(f"{where}: expected {column} {text}, got {quote(got[column])}")


def _histograms(tally: Tally) -> list[list[str]]:
    """For every quantity the filled bins of every group, as bin:size."""
    texts: list[list[list[str]]] = [[[] for _ in range(tally.groups)] for _ in QUANTITIES]
    for group, quantity, place, size in tally.bins().tolist():
        texts[quantity][group].append(f"{place}:{size}")
    return [[" ".join(words) for words in column] for column in texts]


def _bins(text: str, column: str, where: str) -> list[tuple[int, int]]:
    rows = []
    last = LOWEST - 1
    for word in text.split():
        place, _, size = word.partition(":")
        try:
            row = int(place), int(size)
        except ValueError:
            raise InvalidInputError(f"{where}: expected bin:size as {column}, got {quote(word)}") from None
        if not last < row[0] <= HIGHEST or not 0 < row[1] < 2**62:
            raise InvalidInputError(f"{where}: expected ascending bins with something in them, got {quote(word)}")
        last = row[0]
        rows.append(row)
    return rows


def _count(text: str, column: str, where: str, high: int = 2**62) -> int:
    if not (text.isdecimal() and text.isascii() and len(text) <= 20) or int(text) > high:
        raise InvalidInputError(f"{where}: expected a whole number as {column}, got {quote(text)}")
    return int(text)


def _number(text: str, where: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InvalidInputError(f"{where}: expected a number as noise, got {quote(text)}") from None
