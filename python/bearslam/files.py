# SPDX-License-Identifier: MIT OR Apache-2.0
"""Sightings and maps in files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

from bearslam import map_file, mrclam, sightings_file, tum_file
from bearslam.atomic import replacing
from bearslam.errors import InvalidInputError
from bearslam.problem import Problem, ProblemLike
from bearslam.reconstruction import Reconstruction
from bearslam.simulate import Scene

__all__ = ["MAPS", "RESULTS", "kind", "load", "save", "save_truth"]

MAPS = (".json", ".csv")
"""Endings of the files that hold maps."""
RESULTS = (*MAPS, ".tum")
"""Endings of what a reconstruction is written to."""


def load(path: str | os.PathLike[str] | BinaryIO, **options: Any) -> Problem:
    r"""Read sightings from a CSV file, or from a folder of the UTIAS MRCLAM data sets.

    The first line names the columns, in any order: ``view``, ``landmark``, ``bearing`` [rad] or ``bearing_deg``, and if
    need be ``sigma`` [rad] or ``sigma_deg``. Views and landmarks go by any names, and are numbered in the order in
    which they come first. Empty lines and lines that start with ``#`` are skipped.

    Parameters
    ----------
    path : str, path or binary file
        What to read, in UTF-8.
    **options
        For folders, those of `bearslam.mrclam.read`: ``robots``, ``start``, ``end``, ``every`` and more.

    Returns
    -------
    Problem
        The sightings and the names, and the odometry of a folder.

    Raises
    ------
    InvalidInputError
        If there are no sightings, or a line cannot be read or says again what an earlier one has said; with file and
        line number.
    OSError
        If the file cannot be opened.

    Examples
    --------
    >>> import io
    >>> from bearslam import load
    >>> text = b"view,landmark,bearing_deg\nrobot,door,90\nrobot,window,-30\n"
    >>> problem = load(io.BytesIO(text))
    >>> problem.landmark_ids, problem.sightings.bearing.round(4)
    (('door', 'window'), array([ 1.5708, -0.5236]))
    """
    if isinstance(path, str | os.PathLike) and Path(path).is_dir():
        return mrclam.read(path, **options)
    if options:
        raise InvalidInputError(f"{next(iter(options))}: is for folders, got a file")
    if isinstance(path, str | os.PathLike):
        name, data = os.fspath(path), Path(path).read_bytes()
    else:
        name, data = str(getattr(path, "name", "<file>")), path.read()
    return sightings_file.parse(data, name)


def save(what: Reconstruction | ProblemLike, path: str | os.PathLike[str], *, robot: str | int | None = None) -> None:
    """Write sightings to a CSV file that `load` reads, or a reconstruction as `Reconstruction.save` does.

    Parameters
    ----------
    what : Problem, Sightings, (m, n) array_like of float, or Reconstruction
        What to write. Without names, views and landmarks go by their numbers.
    path : str or path
        Ends in ``.csv``, or in ``.json`` for a reconstruction with all that belongs to it, or in ``.tum`` for the
        trajectory of a reconstruction or of the start of a problem. An existing file is replaced in one step, never
        left half written.
    robot : str or int, optional
        For ``.tum``: whose views to write, if the names of views, ``robot@time``, are of several robots.

    Raises
    ------
    InvalidInputError
        If the name ends in something else, `what` is none of these, or it takes a robot to write a trajectory.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from bearslam import load, save, simulate
    >>> scene = simulate("mixed", 4, 9, noise=0.01, seed=1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "scene.csv")
    ...     save(scene.bearings, path)
    ...     load(path)
    <Problem: 36 of 9 landmarks from 4 views>
    """
    if Path(path).suffix.lower() == ".tum":
        text = tum_file.render(what, robot)
    elif robot is not None:
        raise InvalidInputError(f"robot: is for a trajectory, a name that ends in .tum, got {os.fspath(path)!r}")
    elif not isinstance(what, Reconstruction):
        kind(path, (".csv",))
        text = sightings_file.render(what)
    elif kind(path, RESULTS) == ".csv":
        text = map_file.as_csv(what, what.view_ids, what.landmark_ids)
    else:
        text = map_file.as_json(what)
    _write(path, text)


def save_truth(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write the poses and landmarks of a scene in the formats of a reconstruction, without what it adds to them."""
    _write(path, map_file.as_csv(scene) if kind(path, MAPS) == ".csv" else map_file.truth_as_json(scene))


def kind(path: str | os.PathLike[str], known: Sequence[str]) -> str:
    """The ending of a file name, one of those that are known."""
    suffix = Path(path).suffix.lower()
    if suffix not in known:
        raise InvalidInputError(f"path: expected a name that ends in {' or '.join(known)}, got {os.fspath(path)!r}")
    return suffix


def _write(path: str | os.PathLike[str], text: str) -> None:
    with replacing(path) as file:
        file.write(text.encode())
