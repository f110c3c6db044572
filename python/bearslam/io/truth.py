# SPDX-License-Identifier: MIT OR Apache-2.0
"""Ground truth from files, in the order of a problem."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bearslam.data.align import wrap
from bearslam.data.checks import FloatArray
from bearslam.data.maps import Map
from bearslam.data.normalize import normalize
from bearslam.data.problem import ProblemLike
from bearslam.errors import InvalidInputError
from bearslam.io import map_file
from bearslam.io.map_file import Points
from bearslam.io.mrclam import ROBOTS
from bearslam.io.number_table import read_table
from bearslam.io.view_names import parse_view_name

__all__ = ["load_truth"]

GAP = 0.5
"""Longest gap between two true poses to interpolate over [s]."""


def load_truth(path: str | os.PathLike[str], problem: ProblemLike) -> Map:
    """Read true poses and landmarks in the order of a problem.

    Parameters
    ----------
    path : str or path
        A map, as `Reconstruction.save` and ``bearslam simulate --truth`` write it (``.json``, ``.csv`` or ``.g2o``), or
        a folder of the UTIAS MRCLAM data sets, whose motion capture is interpolated at the times of the views.
    problem : Problem, Sightings or (m, n) array_like of float
        Problem whose views and landmarks are looked up by name, or by number if they have no names.

    Returns
    -------
    Map
        True ``poses`` (m, 3) and ``landmarks`` (n, 2) [length of the file, rad]. NaN for what the file does not have;
        for a folder, also outside the time of the motion capture and in gaps of more than 0.5 s.

    Raises
    ------
    InvalidInputError
        If the file cannot be parsed, with the line if there is one, or has no view or landmark of the problem.
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
    table = normalize(problem)
    views = tuple(map(str, range(table.views))) if table.view_ids is None else table.view_ids
    landmarks = tuple(map(str, range(table.landmarks))) if table.landmark_ids is None else table.landmark_ids
    file = Path(path)
    if file.is_dir():
        truth = Map(_captured(file, views), _ordered(_surveyed(file), landmarks, 2))
    else:
        found = map_file.read(path)
        truth = Map(_ordered(found.views, views, 3), _ordered(found.landmarks, landmarks, 2))
    if not any(np.isfinite(part).any() for part in truth):
        raise InvalidInputError(f"{os.fspath(path)}: expected views or landmarks of the problem, got none of them")
    return truth


def _ordered(points: Points, names: Sequence[str], columns: int) -> FloatArray:
    unknown = np.full(columns, np.nan)
    return np.array([points.get(name, unknown) for name in names]).reshape(-1, columns)


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
    moments = [parse_view_name(name) for name in names]
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
        turned = np.unwrap(heading)  # interpolate the shorter way round
        columns = [np.interp(at, time, values) for values in (x, y, turned)]
        poses[views[known]] = np.column_stack([*columns[:2], wrap(columns[2])])[known]
    return poses
