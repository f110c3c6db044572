# SPDX-License-Identifier: MIT OR Apache-2.0
"""Loading problems, and saving problems and maps, in any of the formats."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, BinaryIO

from numpy.typing import ArrayLike

from bearslam.data.checks import choice
from bearslam.data.estimate import Estimate
from bearslam.data.maps import HasMap
from bearslam.data.problem import Problem, ProblemLike
from bearslam.errors import InvalidInputError
from bearslam.io import g2o, map_file, mrclam, sightings_csv, text_graph, tum
from bearslam.io.atomic import replacing
from bearslam.io.bounded import read_bounded, read_path
from bearslam.io.compression import GZIP, decompressed
from bearslam.io.endings import ENDINGS, FORMATS, PROBLEMS, RESULTS, TRUTHS, Format, ending_of
from bearslam.io.sensor_pose import in_sensor_frame
from bearslam.io.text_graph import NoiseFormat

__all__ = ["load", "save", "save_truth"]


def load(
    path: str | os.PathLike[str] | BinaryIO,
    *,
    format: Format | None = None,  # noqa: A002
    noise: NoiseFormat = "auto",
    sensor: ArrayLike | None = None,
    **folder: Any,
) -> Problem:
    r"""Read a problem from a CSV file, a g2o file, a text graph of TORO or GTSAM, or a folder of MRCLAM.

    A CSV file has sightings only. Its first line names the columns, in any order: ``view``, ``landmark``, ``bearing``
    [rad] or ``bearing_deg``, and optionally ``sigma`` [rad] or ``sigma_deg``. Views and landmarks may have any names,
    and are numbered in the order in which they first appear. Empty lines and lines that start with ``#`` are skipped.
    Any file may be compressed by gzip.

    Graphs have poses, landmarks, motions and priors as well, in any order of lines. Lines with tags that are not used
    are counted in `Problem.remarks`, and those of g2o are kept.

    Parameters
    ----------
    path : str, path or binary file
        File or folder to read. Text is in UTF-8.
    format : {"csv", "g2o", "graph"}, optional
        Format of the file; by default that of its ending (``.csv``, ``.g2o``, ``.graph`` or ``.toro``, optionally with
        ``.gz``), or else recognised by the content.
    noise : {"auto", "toro", "graph", "cov", "g2o"}
        Meaning and order of the last six numbers of a motion in a text graph: information for "toro" (xx xy yy tt xt
        yt) and "g2o" (xx xy xt yy yt tt), covariances for "graph" and "cov" in the same two orders. "auto" is "toro"
        for a file that ends in ``.toro`` and has no ``ODOMETRY``; in others it takes the numbers for covariances and
        infers their order from the zeros, as GTSAM does.
    sensor : (2,) or (3,) array_like of float, optional
        Pose (x, y) or (x, y, theta) of the sensor in the frame of the vehicle, if the file has positions of landmarks
        in the latter. Views are then poses of the sensor, and bearings those that it measured [length, rad].
    **folder
        For folders of the UTIAS MRCLAM data sets, the options of `bearslam.io.mrclam.read`: ``robots``, ``start``,
        ``end``, ``every`` and more.

    Returns
    -------
    Problem
        The content of the file.

    Raises
    ------
    InvalidInputError
        If there are no sightings, or a line cannot be parsed or repeats an earlier one, with file and line number; if
        `noise` must be given, or bearings without a range cannot be converted to the sensor.
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

    >>> text = b"VERTEX_SE2 0 0 0 0\nEDGE_BEARING_SE2_XY 0 7 1.57 10000\nEDGE_BEARING_SE2_XY 0 8 -0.52 10000\n"
    >>> problem = load(io.BytesIO(text), format="g2o")
    >>> problem.landmark_ids, problem.sightings.sigma
    (('7', '8'), array([0.01, 0.01]))
    """
    if format is not None:
        choice("format", format, FORMATS)
    choice("noise", noise, text_graph.NOISES)
    if isinstance(path, str | os.PathLike) and Path(path).is_dir():
        for name, given in (("format", format is not None), ("noise", noise != "auto"), ("sensor", sensor is not None)):
            if given:
                raise InvalidInputError(f"{name}: applies to files only, got the folder {os.fspath(path)!r}")
        return mrclam.read(path, **folder)
    if folder:
        raise InvalidInputError(f"{next(iter(folder))}: applies to folders only, got a file")
    if isinstance(path, str | os.PathLike):
        name, data = os.fspath(path), read_path(path)
        suffixes = [suffix.lower() for suffix in Path(path).suffixes]
        compressed = suffixes[-1:] == [".gz"]
        ending = "".join(suffixes[:-1][-1:] if compressed else suffixes[-1:])
    else:
        read = getattr(path, "read", None)
        if read is None:
            got = type(path).__name__
            raise InvalidInputError(f"path: expected a path or a file opened in binary mode, got {got}")
        name, ending, compressed = str(getattr(path, "name", "<file>")), "", False
        data = read_bounded(path, name)
    if compressed or data.startswith(GZIP):
        data = decompressed(data, name)
    found = format or ENDINGS.get(ending) or _guess(data)
    if found is None and ending == ".txt":
        raise InvalidInputError(
            f"{name}: expected a CSV header, or lines of a graph such as VERTEX_SE2 or ODOMETRY; if it is one of "
            f"{', '.join(FORMATS)}, state the format"
        )
    if found == "g2o":
        problem = g2o.parse(data, name)
    elif found == "graph":
        # ODOMETRY is a tag of GTSAM, whatever the ending.
        toro = noise == "auto" and ending == ".toro" and b"ODOMETRY" not in data
        problem = text_graph.parse(data, name, "toro" if toro else noise)
    else:
        problem = sightings_csv.parse(data, name)
    return problem if sensor is None else in_sensor_frame(problem, sensor)


def save(what: Estimate | ProblemLike, path: str | os.PathLike[str], *, robot: str | int | None = None) -> None:
    """Write a problem to a file that `load` reads, or a reconstruction as `Reconstruction.save` does.

    Parameters
    ----------
    what : Problem, Sightings, (m, n) array_like of float, or Reconstruction
        What to write. Without names, views and landmarks are identified by their numbers; in a g2o file those of
        landmarks follow those of views.
    path : str or path
        File to write. Of a problem, ``.g2o`` keeps everything, if sightings have standard deviations, and ``.csv`` the
        sightings alone. Of a reconstruction, ``.json`` keeps everything, ``.csv`` the map, and ``.g2o`` the map and the
        measurements. ``.tum`` has the trajectory of a reconstruction, or of the start of a problem. An existing file is
        replaced in one step and never left half written.
    robot : str or int, optional
        For ``.tum``: the robot whose views to write, if the names of views, ``robot@time``, are of several robots.

    Raises
    ------
    InvalidInputError
        If the name has another ending, the format cannot hold all of `what`, `what` is of another type, or a trajectory
        needs a robot.
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
    ending = ending_of(path, RESULTS if isinstance(what, Estimate) else (*PROBLEMS, ".tum"))
    if robot is not None and ending != ".tum":
        raise InvalidInputError(f"robot: applies to trajectories (.tum) only, got {os.fspath(path)!r}")
    if ending == ".tum":
        text = tum.render(what, robot)
    elif ending == ".g2o":
        text = g2o.render(what)
    elif not isinstance(what, Estimate):
        text = sightings_csv.render(what)
    elif ending == ".csv":
        text = map_file.as_csv(what, what.view_ids, what.landmark_ids)
    else:
        text = map_file.as_json(what)
    _write(path, text)


def save_truth(scene: HasMap, path: str | os.PathLike[str]) -> None:
    """Write the poses and landmarks of a scene, in the formats of a reconstruction."""
    _write(path, map_file.as_csv(scene) if ending_of(path, TRUTHS) == ".csv" else map_file.truth_as_json(scene))


def _write(path: str | os.PathLike[str], text: str) -> None:
    try:
        data = text.encode()
    except UnicodeEncodeError as error:
        wrong = text[error.start]
        raise InvalidInputError(f"path: expected names that UTF-8 can encode, got {wrong!r} in one") from None
    with replacing(path) as file:
        file.write(data)


def _guess(data: bytes) -> Format | None:
    """The format of a file by its content: a CSV header, or tags that only one of the graph formats has."""
    both = False
    for line in data.splitlines():
        words = line.removeprefix(b"\xef\xbb\xbf").split(maxsplit=1)
        if not words or words[0].startswith(b"#"):
            continue
        tag = words[0].decode("ascii", "replace")
        if b"," in line and not both:
            return "csv"
        ours, theirs = tag in g2o.TAGS or tag == "FIX", tag in text_graph.TAGS
        if ours != theirs:
            return "g2o" if ours else "graph"
        both = both or ours
    return "g2o" if both else None
