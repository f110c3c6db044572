# SPDX-License-Identifier: MIT OR Apache-2.0
"""Sightings as CSV: read as a `Problem`, and written."""

from __future__ import annotations

import math

from bearslam.data.checks import TURN, check_turn, quote
from bearslam.data.normalize import normalize
from bearslam.data.problem import Problem, ProblemLike
from bearslam.data.sightings import SIGMA_RANGE, Sightings
from bearslam.errors import InvalidInputError
from bearslam.io.text import csv_row, csv_rows, decode

__all__ = ["parse", "render"]

COLUMNS = ("view", "landmark", "bearing", "bearing_deg", "sigma", "sigma_deg")
TURNS = {"bearing": TURN, "bearing_deg": 360.0, "sigma": TURN / 2, "sigma_deg": 180.0}
"""Largest bearing by column: a larger one is most likely in degrees in a column of radians."""


def parse(data: bytes, name: str) -> Problem:
    """Sightings from the content of a file; the name is for errors."""
    rows = csv_rows(decode(data, name), name)
    try:
        number, header = next(rows)
    except StopIteration:
        raise InvalidInputError(f"{name}: expected sightings, got an empty file") from None
    columns = _columns(header, f"{name}:{number}")
    at_view, at_landmark = columns["view"], columns["landmark"]
    bearing_column = "bearing" if "bearing" in columns else "bearing_deg"
    sigma_column = next((column for column in ("sigma", "sigma_deg") if column in columns), None)

    views: dict[str, int] = {}
    landmarks: dict[str, int] = {}
    lines: dict[tuple[int, int], int] = {}
    bearing: list[float] = []
    sigma: list[float] = []
    for number, cells in rows:
        where = f"{name}:{number}"
        if len(cells) != len(header):
            raise InvalidInputError(f"{where}: expected {len(header)} values ({', '.join(header)}), got {len(cells)}")
        for column in ("view", "landmark"):
            if not cells[columns[column]]:
                raise InvalidInputError(f"{where}: expected the name of a {column}, got nothing")
        pair = (
            views.setdefault(cells[at_view], len(views)),
            landmarks.setdefault(cells[at_landmark], len(landmarks)),
        )
        if lines.setdefault(pair, number) != number:
            raise InvalidInputError(
                f"{where}: view {quote(cells[at_view])} sees landmark {quote(cells[at_landmark])} a second time; "
                f"the first is on line {lines[pair]}"
            )
        bearing.append(_bearing(bearing_column, cells[columns[bearing_column]], where))
        if sigma_column is not None:
            sigma.append(_sigma(sigma_column, cells[columns[sigma_column]], where))
    if not lines:
        raise InvalidInputError(f"{name}: expected sightings below the header, got none")
    view, landmark = zip(*lines, strict=True)
    return Problem(Sightings(view, landmark, bearing, sigma if sigma_column else None), views, landmarks)


def render(problem: ProblemLike) -> str:
    """The content of a file with the sightings."""
    table = normalize(problem)
    seen = table.sightings
    view_ids, landmark_ids = table.view_ids, table.landmark_ids
    views = [str(i) for i in range(table.views)] if view_ids is None else view_ids
    landmarks = [str(j) for j in range(table.landmarks)] if landmark_ids is None else landmark_ids
    given = problem
    if isinstance(problem, Problem):
        _check(problem)
        given = problem.sightings
    weighted = isinstance(given, Sightings) and given.sigma is not None
    lines = [csv_row("view", "landmark", "bearing", *(["sigma"] if weighted else []))]
    for i, j, bearing, sigma in zip(
        seen.view.tolist(), seen.landmark.tolist(), seen.bearing.tolist(), table.sigma.tolist(), strict=True
    ):
        lines.append(csv_row(views[i], landmarks[j], repr(bearing), *([repr(sigma)] if weighted else [])))
    return "".join(lines)


def _check(problem: Problem) -> None:
    """Refuse a problem with more than CSV can hold."""
    lost = [
        name.replace("_", " ")
        for name in (
            "odometry",
            "pose_priors",
            "landmark_priors",
            "start",
            "fixed_views",
            "fixed_landmarks",
            "offsets",
            "others",
        )
        if getattr(problem, name)
    ]
    if lost:
        raise InvalidInputError(
            f"problem: expected sightings alone for a CSV file, got {', '.join(lost)} as well; a .g2o file holds "
            "these, and Problem.bearings_only() (on the command line --bearings-only) leaves them out"
        )


def _columns(header: list[str], where: str) -> dict[str, int]:
    columns = {column: header.index(column) for column in header}
    shown = quote(",".join(header))
    for column in header:
        if column not in COLUMNS:
            raise InvalidInputError(
                f"{where}: expected a header of view, landmark, bearing (or bearing_deg) and, if need be, sigma "
                f"(or sigma_deg), separated by commas; got {shown}"
            )
    missing = next((column for column in ("view", "landmark") if column not in columns), None)
    if missing is not None:
        raise InvalidInputError(f"{where}: expected a column {missing}, got {shown}")
    if ("bearing" in columns) == ("bearing_deg" in columns):
        raise InvalidInputError(f"{where}: expected one column bearing or bearing_deg, got {shown}")
    if "sigma" in columns and "sigma_deg" in columns:
        raise InvalidInputError(f"{where}: expected one column sigma or sigma_deg, got {shown}")
    if len(columns) != len(header):
        raise InvalidInputError(f"{where}: expected every column once, got {shown}")
    return columns


def _number(column: str, cell: str, where: str) -> float:
    try:
        value = math.nan if "_" in cell else float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InvalidInputError(f"{where}: expected a finite number as {column}, got {quote(cell)}")
    return value


def _bearing(column: str, cell: str, where: str) -> float:
    value = _number(column, cell, where)
    unit = "radians (a column bearing_deg holds degrees)" if column == "bearing" else "degrees"
    check_turn(where, value, expected=f"{unit} within one turn as {column}", turn=TURNS[column])
    return math.radians(value) if column == "bearing_deg" else value


def _sigma(column: str, cell: str, where: str) -> float:
    value = _number(column, cell, where)
    if value <= 0:
        raise InvalidInputError(f"{where}: expected a number above 0 as {column}, got {value:g}")
    sigma = math.radians(value) if column == "sigma_deg" else value
    low, high = SIGMA_RANGE
    if not low <= sigma <= high:
        raise InvalidInputError(f"{where}: expected radians from {low:g} to {high:g} as {column}, got {sigma:g}")
    unit = "radians (a column sigma_deg holds degrees)" if column == "sigma" else "degrees"
    check_turn(where, value, expected=f"{unit} within half a turn as {column}", turn=TURNS[column])
    return sigma
