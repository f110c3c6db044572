# SPDX-License-Identifier: MIT OR Apache-2.0
"""True maps in files, brought into the order of a problem."""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bearslam.data.align import wrap
from bearslam.data.checks import FloatArray, quote
from bearslam.data.maps import Map
from bearslam.data.problem import ProblemLike, tabulate
from bearslam.errors import InvalidInputError
from bearslam.io import g2o
from bearslam.io.compression import GZIP, decompressed
from bearslam.io.mrclam import ROBOTS, read_table
from bearslam.io.text import decode
from bearslam.io.view_names import moment

__all__ = ["load_truth"]

GAP = 0.5
"""Longest time between two true poses that one in between is interpolated over [s]."""
COLUMNS = {"views": ("x", "y", "theta"), "landmarks": ("x", "y")}

Points = dict[str, FloatArray]
"""Poses or positions by id."""


def load_truth(path: str | os.PathLike[str], problem: ProblemLike) -> Map:
    """Read true poses and landmarks, and put them in the order of a problem.

    Parameters
    ----------
    path : str or path
        A map, as `Reconstruction.save` and ``bearslam simulate --truth`` write it (``.json``, ``.csv`` or ``.g2o``), or
        a folder of the UTIAS MRCLAM data sets, whose motion capture is interpolated at the times of the views.
    problem : Problem, Sightings or (m, n) array_like of float
        Whose views and landmarks are looked up by their names. Without names they go by their numbers.

    Returns
    -------
    Map
        True ``poses`` (m, 3) and ``landmarks`` (n, 2) [length of the file, rad]. NaN for what the file does not
        have; of a folder, also before and after the motion capture and where it has a gap of more than 0.5 s.

    Raises
    ------
    InvalidInputError
        If the file cannot be read, with its line where it has lines, or has nothing that the problem has.
    OSError
        If a file cannot be opened.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from bearslam import load_truth, simulate, solve
    >>> scene = simulate("mixed", 4, 9, noise=0.01, seed=1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "map.csv")
    ...     solve(scene.bearings).save(path)
    ...     truth = load_truth(path, scene.bearings)
    >>> truth.poses[0]
    array([0., 0., 0.])
    """
    table = tabulate(problem)
    views = tuple(map(str, range(table.views))) if table.view_ids is None else table.view_ids
    landmarks = tuple(map(str, range(table.landmarks))) if table.landmark_ids is None else table.landmark_ids
    file = Path(path)
    if file.is_dir():
        truth = Map(_captured(file, views), _ordered(_surveyed(file), landmarks, 2))
    else:
        suffix = Path(file.stem if file.suffix.lower() == ".gz" else file.name).suffix.lower()
        if suffix not in READERS:
            raise InvalidInputError(
                f"truth: expected a name that ends in {' or '.join(READERS)}, or a folder, got {os.fspath(path)!r}"
            )
        name, data = os.fspath(path), file.read_bytes()
        if data.startswith(GZIP):
            data = decompressed(data, name)
        found = READERS[suffix](name, decode(data, name))
        truth = Map(_ordered(found["views"], views, 3), _ordered(found["landmarks"], landmarks, 2))
    if not any(np.isfinite(part).any() for part in truth):
        raise InvalidInputError(f"{os.fspath(path)}: expected views or landmarks of the problem, got none of them")
    return truth


def _ordered(points: Points, names: Sequence[str], columns: int) -> FloatArray:
    unknown = np.full(columns, np.nan)
    return np.array([points.get(name, unknown) for name in names]).reshape(-1, columns)


def _json(name: str, text: str) -> dict[str, Points]:
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        raise InvalidInputError(f"{name}:{error.lineno}: expected JSON: {error.msg}") from None
    except (RecursionError, ValueError) as error:  # nested without end, numbers without end
        raise InvalidInputError(f"{name}: expected JSON of a map: {error}") from None
    if not isinstance(content, dict):
        raise InvalidInputError(f"{name}: expected a JSON object with views and landmarks, got {quote(content)}")
    found: dict[str, Points] = {}
    for kind, columns in COLUMNS.items():
        rows = content.get(kind)
        if not isinstance(rows, list):
            raise InvalidInputError(f"{name}: expected a list of {kind}, got {quote(rows)}")
        points = found.setdefault(kind, {})
        for k, row in enumerate(rows):
            where = f"{name}: {kind}[{k}]"
            if not isinstance(row, dict) or type(row.get("id")) not in (str, int):
                raise InvalidInputError(f"{where}: expected an object with an id, got {quote(row)}")
            missing = next((column for column in columns if column not in row), None)
            if missing is not None:
                raise InvalidInputError(f"{where}: expected a number or null as {missing}, got none")
            _put(points, str(row["id"]), [_plain(f"{where}: {one}", row[one]) for one in columns], where)
    return found


def _plain(where: str, value: object) -> float:
    """Number of a JSON file; null is what is unknown."""
    if value is None:
        return math.nan
    try:
        number = float(value) if type(value) in (int, float) else math.nan  # type: ignore[arg-type]
    except OverflowError:
        number = math.nan
    if not math.isfinite(number):
        raise InvalidInputError(f"{where}: expected a finite number or null, got {quote(value)}")
    return number


def _csv(name: str, text: str) -> dict[str, Points]:
    found: dict[str, Points] = {kind: {} for kind in COLUMNS}
    head = ["kind", "id", "x", "y", "theta"]
    started = False
    for number, line in enumerate(io.StringIO(text, newline=None), start=1):
        content = line.strip()
        if not content or content.startswith("#"):
            continue
        where = f"{name}:{number}"
        try:
            (cells,) = csv.reader([content], strict=True, skipinitialspace=True)
        except (csv.Error, ValueError) as error:
            raise InvalidInputError(f"{where}: {error}") from None
        cells = [cell.strip() for cell in cells]
        if not started:
            started = True
            if cells != head:
                raise InvalidInputError(f"{where}: expected a header {','.join(head)}, got {quote(content)}")
            continue
        if len(cells) != len(head) or cells[0] not in ("view", "landmark") or not cells[1]:
            raise InvalidInputError(f"{where}: expected view or landmark, id, x, y and theta, got {quote(content)}")
        kind = f"{cells[0]}s"
        columns = COLUMNS[kind]
        values = [_cell(column, cell, where) for column, cell in zip(columns, cells[2:], strict=False)]
        if kind == "landmarks" and cells[4]:
            raise InvalidInputError(f"{where}: expected no theta of a landmark, got {quote(cells[4])}")
        _put(found[kind], cells[1], values, where)
    if not started:
        raise InvalidInputError(f"{name}: expected a map, got an empty file")
    return found


def _cell(column: str, cell: str, where: str) -> float:
    """Number of a CSV file; nan or nothing is what is unknown."""
    if cell in ("", "nan"):
        return math.nan
    try:
        value = math.nan if "_" in cell else float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InvalidInputError(f"{where}: expected a finite number or nan as {column}, got {quote(cell)}")
    return value


def _put(points: Points, name: str, values: list[float], where: str) -> None:
    if name in points:
        raise InvalidInputError(f"{where}: expected every id once, got {quote(name)} again")
    point = np.array(values)
    if np.isnan(point[:2]).any():
        point[:] = np.nan
    points[name] = point


def _g2o(name: str, text: str) -> dict[str, Points]:
    views, landmarks = g2o.vertices(text.encode(), name)
    return {"views": views, "landmarks": landmarks}


READERS = {".json": _json, ".csv": _csv, ".g2o": _g2o}
"""What makes points out of the text of a file, by the ending of its name."""


def _surveyed(folder: Path) -> Points:
    columns = ("subject", "x", "y", "standard deviation of x", "standard deviation of y")
    table = read_table(folder, "Landmark_Groundtruth.dat", columns)
    points: Points = {}
    for row, (subject, x, y, _, _) in enumerate(table.values.tolist()):
        if subject % 1 != 0:
            raise table.error(row, f"expected a whole number as subject, got {subject:g}")
        if str(int(subject)) in points:
            raise table.error(row, f"expected every subject once, got {int(subject)} again")
        points[str(int(subject))] = np.array([x, y])
    return points


def _captured(folder: Path, names: Sequence[str]) -> FloatArray:
    poses = np.full((len(names), 3), np.nan)
    moments = [moment(name) for name in names]
    for robot in map(str, ROBOTS):
        views = np.array([i for i, (which, _) in enumerate(moments) if which == robot], dtype=np.int64)
        if len(views) == 0:
            continue
        at = np.array([moments[i].time for i in views], dtype=np.float64)
        table = read_table(folder, f"Robot{robot}_Groundtruth.dat", ("time", "x", "y", "orientation"))
        time, x, y, heading = table.values.T
        after = np.clip(np.searchsorted(time, at), 1, max(len(time) - 1, 1))
        if len(time) == 1:
            after = np.zeros_like(after)
        known = (at >= time[0]) & (at <= time[-1])
        known &= (time[after] - time[after - 1] <= GAP) | (time[after] == at) | (time[after - 1] == at)
        turned = np.unwrap(heading)  # from one to the next by the shorter way
        columns = [np.interp(at, time, values) for values in (x, y, turned)]
        poses[views[known]] = np.column_stack([*columns[:2], wrap(columns[2])])[known]
    return poses
