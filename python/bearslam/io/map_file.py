# SPDX-License-Identifier: MIT OR Apache-2.0
"""Maps in files: written as JSON (everything) or CSV (poses and landmarks), and read from these and from g2o."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from dataclasses import asdict
from json import dumps
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from bearslam._core import __version__
from bearslam.data.checks import FloatArray, check_turn, quote
from bearslam.data.estimate import Estimate, per_sighting
from bearslam.data.maps import HasMap
from bearslam.errors import InvalidInputError
from bearslam.io import g2o
from bearslam.io.bounded import read_path
from bearslam.io.compression import GZIP, decompressed
from bearslam.io.endings import MAPS
from bearslam.io.text import csv_row, csv_rows, decode

__all__ = ["NamedMap", "Points", "as_csv", "as_json", "read", "truth_as_json"]

COLUMNS = {"views": ("x", "y", "theta"), "landmarks": ("x", "y")}

Ids: TypeAlias = Sequence[str] | None
Points: TypeAlias = dict[str, FloatArray]
"""Poses or positions by id."""


class NamedMap(NamedTuple):
    """A map by the ids of its views and landmarks; rows of NaN are unknown."""

    views: Points
    landmarks: Points


def as_csv(source: HasMap, view_ids: Ids = None, landmark_ids: Ids = None) -> str:
    """CSV with kind, id, x, y and theta [rad]; a landmark has no theta, and nan stands for what is undetermined."""
    lines = [csv_row("kind", "id", "x", "y", "theta")]
    for i, (x, y, theta) in enumerate(source.poses.tolist()):
        lines.append(csv_row("view", str(_id(view_ids, i)), repr(x), repr(y), repr(theta)))
    for j, (x, y) in enumerate(source.landmarks.tolist()):
        lines.append(csv_row("landmark", str(_id(landmark_ids, j)), repr(x), repr(y), ""))
    return "".join(lines)


def as_json(result: Estimate) -> str:
    """JSON with the whole reconstruction; null stands for what is undetermined or infinite. Angles are in radians."""
    seen = result.sightings
    sigma = seen.sigma
    return _object(
        {
            "format": "bearslam reconstruction",
            "version": 1,
            "bearslam": __version__,
            "settings": asdict(result.settings),
            **_summary(result),
            "oriented": result.oriented,
            "covariance_frame": result.covariance_frame,
            "certificate": _certificate(result),
            **_map(result, result.view_ids, result.landmark_ids, result.pose_covariance, result.landmark_covariance),
            "undetermined": [
                {
                    "kind": one.kind,
                    "id": _id(result.view_ids if one.kind == "view" else result.landmark_ids, one.index),
                    "reason": one.reason,
                }
                for one in result.undetermined
            ],
            "sightings": {
                "view": [_id(result.view_ids, i) for i in seen.view.tolist()],
                "landmark": [_id(result.landmark_ids, j) for j in seen.landmark.tolist()],
                "bearing": _numbers(seen.bearing),
                "sigma": None if sigma is None else _numbers(sigma),
                "residual": _numbers(per_sighting(result, result.residuals)),
                "inlier": per_sighting(result, result.inliers).tolist(),
            },
            **{
                name: [{**_summary(other), **_map(other, result.view_ids, result.landmark_ids)} for other in others]
                for name, others in (("alternatives", result.alternatives), ("components", result.components))
            },
        }
    )


def truth_as_json(source: HasMap) -> str:
    """JSON with poses and landmarks alone."""
    return _object({"format": "bearslam map", "version": 1, **_map(source, None, None)})


def read(path: str | os.PathLike[str]) -> NamedMap:
    """Poses and landmarks of a file that ends in `.json`, `.csv` or `.g2o`, compressed by gzip or not."""
    file, name = Path(path), os.fspath(path)
    ending = Path(file.stem if file.suffix.lower() == ".gz" else file.name).suffix.lower()
    if ending not in MAPS:
        raise InvalidInputError(f"truth: expected a name that ends in {' or '.join(MAPS)}, or a folder, got {name!r}")
    data = read_path(file)
    if data.startswith(GZIP):
        data = decompressed(data, name)
    text = decode(data, name)
    if ending == ".g2o":
        return NamedMap(*g2o.vertices(text.encode(), name))
    return _from_json(name, text) if ending == ".json" else _from_csv(name, text)


def _summary(result: Estimate) -> dict[str, object]:
    return {
        "cost": _number(result.cost),
        "rms": _number(result.rms),
        "sensitivity": _number(result.sensitivity),
        "uncertainty": _number(result.uncertainty),
        "worst": _worst(result),
        "sigma0": _number(result.sigma0),
        "p_value": _number(result.p_value),
        "findings": [asdict(one) for one in result.findings],
        "converged": result.converged,
        "termination": result.termination,
        "iterations": result.iterations,
        "freedom": result.freedom,
    }


def _certificate(result: Estimate) -> dict[str, object] | None:
    certificate = result.certificate
    if certificate is None:
        return None
    views = None if certificate.views is None else [_id(result.view_ids, i) for i in certificate.views]
    return {**asdict(certificate), "views": views, "cone": _number(certificate.cone)}


def _worst(result: Estimate) -> dict[str, object] | None:
    if result.worst is None:
        return None
    kind, index = result.worst
    return {"kind": kind, "id": _id(result.view_ids if kind == "view" else result.landmark_ids, index)}


def _map(
    source: HasMap,
    view_ids: Ids,
    landmark_ids: Ids,
    pose_covariance: FloatArray | None = None,
    landmark_covariance: FloatArray | None = None,
) -> dict[str, object]:
    return {
        "views": [
            {
                "id": _id(view_ids, i),
                **dict(zip(("x", "y", "theta"), _numbers(pose), strict=True)),
                **_covariance(pose_covariance, i),
            }
            for i, pose in enumerate(source.poses)
        ],
        "landmarks": [
            {
                "id": _id(landmark_ids, j),
                **dict(zip(("x", "y"), _numbers(point), strict=True)),
                **_covariance(landmark_covariance, j),
            }
            for j, point in enumerate(source.landmarks)
        ],
    }


def _covariance(covariances: FloatArray | None, index: int) -> dict[str, object]:
    return {} if covariances is None else {"covariance": [_numbers(row) for row in covariances[index]]}


def _id(ids: Ids, index: int) -> str | int:
    return index if ids is None else ids[index]


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _numbers(values: FloatArray) -> list[float | None]:
    return [_number(value) for value in values.tolist()]


def _object(members: dict[str, object]) -> str:
    """JSON with a line for each member, and for each object of a list."""
    return "{\n" + ",\n".join(f"  {dumps(name)}: {_value(value)}" for name, value in members.items()) + "\n}\n"


def _value(value: object) -> str:
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "[\n" + ",\n".join(f"    {dumps(one, allow_nan=False)}" for one in value) + "\n  ]"
    return dumps(value, allow_nan=False)


def _from_json(name: str, text: str) -> NamedMap:
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        raise InvalidInputError(f"{name}:{error.lineno}: expected JSON: {error.msg}") from None
    except (RecursionError, ValueError) as error:  # nested too deeply, integers with too many digits
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
    return NamedMap(**found)


def _plain(where: str, value: object) -> float:
    """A number of a JSON file; NaN for null."""
    if value is None:
        return math.nan
    try:
        number = float(value) if type(value) in (int, float) else math.nan  # type: ignore[arg-type]
    except OverflowError:
        number = math.nan
    if not math.isfinite(number):
        raise InvalidInputError(f"{where}: expected a finite number or null, got {quote(value)}")
    return number


def _from_csv(name: str, text: str) -> NamedMap:
    found: dict[str, Points] = {kind: {} for kind in COLUMNS}
    head = ["kind", "id", "x", "y", "theta"]
    started = False
    for number, cells in csv_rows(text, name):
        where, content = f"{name}:{number}", ",".join(cells)
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
    return NamedMap(**found)


def _cell(column: str, cell: str, where: str) -> float:
    """A number of a CSV file; NaN for nan and an empty cell."""
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
    if len(values) == 3:
        check_turn(where, values[2], expected="a heading in radians within one turn")
    if name in points:
        raise InvalidInputError(f"{where}: expected every id once, got {quote(name)} again")
    point = np.array(values)
    if np.isnan(point[:2]).any():
        point[:] = np.nan
    points[name] = point
