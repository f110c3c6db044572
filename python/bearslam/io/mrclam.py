# SPDX-License-Identifier: MIT OR Apache-2.0
"""Folders of the UTIAS multi-robot data sets (MRCLAM): sightings by camera, odometry as velocity commands.

A folder has these files, each plain or compressed (``.gz``; the plain one is used if there are both), with columns
separated by blanks and comments after ``#``:

=========================  ========================================================================
Barcodes.dat               subject, barcode: 1 to 5 are robots, the others landmarks
RobotN_Measurement.dat     time [s], barcode, range [m], bearing [rad]; headers say subject
RobotN_Odometry.dat        time [s], forward velocity [m/s], angular velocity [rad/s], as commanded
RobotN_Groundtruth.dat     time [s], x [m], y [m], orientation [rad]; see `load_truth`
Landmark_Groundtruth.dat   subject, x [m], y [m], standard deviations of x and y [m]; see `load_truth`
=========================  ========================================================================
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bearslam.data.checks import TURN, FloatArray, IntArray, quote, real, whole
from bearslam.data.priors import Odometry
from bearslam.data.problem import Problem
from bearslam.data.sightings import Sightings, deviations
from bearslam.errors import InvalidInputError
from bearslam.io.dead_reckoning import NOISE, OdometryNoise, checked_noise, dead_reckoning
from bearslam.io.number_table import TIME, read_table, table_path
from bearslam.io.view_names import view_name

__all__ = ["ROBOTS", "SIGMA", "OdometryNoise", "read"]

ROBOTS = range(1, 6)
"""Subjects that are robots."""
SIGMA = math.radians(0.3)
"""Standard deviation of a bearing [rad]. In set 7 the robust deviation from the truth is 0.52 degrees. Most of it is
common to all bearings of an image, like an error of its heading; 0.2 degrees are independent. This lies in between."""
COMMAND = 1e3
"""Largest valid velocity [m/s, rad/s]."""
UNKNOWN = -1
"""Subject of unknown barcodes."""


class Log(NamedTuple):
    """Measurements by the camera of one robot."""

    robot: int
    time: FloatArray
    subject: IntArray
    bearing: FloatArray


def read(
    folder: str | os.PathLike[str],
    *,
    robots: Iterable[int] | None = None,
    start: float | None = None,
    end: float | None = None,
    window: float = 0.05,
    every: float = 0.0,
    odometry_delay: float = 0.25,
    odometry_noise: OdometryNoise | tuple[float, float, float, float] = NOISE,
    turn_scale: float = 1.0,
    sigma: float = SIGMA,
) -> Problem:
    """Read the sightings and odometry of one folder; several robots make one problem without a common frame.

    - Measurements name barcodes, which Barcodes.dat maps to subjects. Sightings of robots, which move, and of unknown
      barcodes are left out, and so are ranges.
    - A view has all sightings of one robot within `window` seconds of the first, and the time of the first. In set 7
      sightings of one image are within 3 ms and images at least 0.15 s apart, so that the rotation within a view, below
      0.1 degrees, need not be corrected.
    - Of several sightings of one landmark in a view, the first is used.
    - A command takes effect `odometry_delay` seconds after its time and holds until the next one does. Commands are
      integrated exactly, along arcs, between consecutive views of a robot. There is no motion before the log begins or
      after it ends.
    - Views are named ``robot@time`` and ordered by robot and time; landmarks are named by their subject numbers.

    What is left out is counted in `Problem.remarks`. What cannot be parsed is an error.

    Parameters
    ----------
    folder : str or path
        Folder with the files.
    robots : iterable of int, optional
        Robots to read, 1 to 5; by default all that have measurements.
    start, end : float, optional
        Keep sightings from `start` to before `end`, in seconds since the first measurement in the folder.
    window : float
        Longest time between the first and the last sighting of a view [s].
    every : float
        Shortest time between views of one robot; others are left out [s]. There are four images per second, and a robot
        hardly moves in between: 1 leaves a quarter of them, and errors of the landmarks of set 7 of 1.5 to 2.9 % of the
        radius of the map instead of 1.3 to 1.9 %.
    odometry_delay : float
        Time by which commands lead the motion, 0.20 to 0.30 in set 7 [s].
    odometry_noise : OdometryNoise
        Growth of the uncertainty of motions.
    turn_scale : float
        Factor for the logged angular velocities. The true ones are 0.94 to 0.96 of them in set 7.
    sigma : float
        Standard deviation of bearings [rad]. 0.3 degrees by default.

    Returns
    -------
    Problem
        Sightings, odometry and names.

    Raises
    ------
    InvalidInputError
        If a file is missing or cannot be parsed, with file and line; times decrease; no sightings are left; or an
        option is out of range.
    OSError
        If a file cannot be opened.
    """
    folder = Path(folder)
    first = -math.inf if start is None else real("start", start, -TIME, TIME)
    last = math.inf if end is None else real("end", end, -TIME, TIME)
    if not first < last:
        raise InvalidInputError(f"end: expected a time after start, {first:g} s, got {last:g}")
    window, every = real("window", window, 0.0, TIME), real("every", every, 0.0, TIME)
    delay = real("odometry_delay", odometry_delay, -TIME, TIME)
    scale = real("turn_scale", turn_scale, 0.0, COMMAND, above=True)
    noise = checked_noise(odometry_noise)
    spread = float(deviations(sigma, (1,))[0])
    subjects = _barcodes(folder)
    logs = _logs(folder, subjects)
    present = [log.robot for log in logs]
    if robots is not None and not isinstance(robots, Iterable):
        raise InvalidInputError(f"robots: expected a list of robots, got {quote(robots)}")
    chosen = present if robots is None else sorted({whole("robots", one, ROBOTS[0], ROBOTS[-1]) for one in robots})
    absent = next((one for one in chosen if one not in present), None)
    if absent is not None:
        raise InvalidInputError(f"robots: expected robots of {os.fspath(folder)} ({present}), got {absent}")

    origin = min(log.time[0] for log in logs)
    left_out: Counter[str] = Counter()
    names: list[str] = []
    seen: list[tuple[IntArray, IntArray, FloatArray]] = []
    motions: list[tuple[IntArray, FloatArray, FloatArray]] = []
    for log in logs:
        if log.robot not in chosen:
            continue
        inside = (log.time - origin >= first) & (log.time - origin < last)
        kinds = np.where(np.isin(log.subject, ROBOTS), "robot", np.where(log.subject == UNKNOWN, "unknown", "landmark"))
        left_out.update(kinds[inside].tolist())
        times, view, subject, bearing = _views(log, inside & (kinds == "landmark"), window, every, left_out)
        if len(times) == 0:
            continue
        seen.append((view + len(names), subject, bearing))
        known, delta, deviation = _motions(folder, log.robot, times, delay, scale, noise)
        left_out["motion"] += len(known) - int(known.sum())
        motions.append((np.flatnonzero(known) + len(names), delta[known], deviation[known]))
        names += [view_name(str(log.robot), time) for time in times.tolist()]
    if not names:
        raise InvalidInputError(
            f"{os.fspath(folder)}: expected sightings of landmarks by these robots at these times, got none"
        )
    view, subject, bearing = (np.concatenate(parts) for parts in zip(*seen, strict=True))
    numbers, landmark = np.unique(subject, return_inverse=True)
    begin, delta, deviation = (np.concatenate(parts) for parts in zip(*motions, strict=True))
    return Problem(
        Sightings(view, landmark, bearing, np.full(len(view), spread)),
        names,
        [str(number) for number in numbers.tolist()],
        odometry=Odometry(begin, begin + 1, delta, deviation) if len(begin) else None,
        remarks=_remarks(left_out, every),
    )


def _barcodes(folder: Path) -> dict[int, int]:
    """Subject of every barcode."""
    table = read_table(folder, "Barcodes.dat", ("subject", "barcode"))
    table.refuse((table.values % 1).max(axis=1) > 0, "expected whole numbers, got {0:g} and {1:g}")
    table.refuse(~((table.values[:, 0] >= 1) & (table.values[:, 0] < 2**31)), "expected a subject from 1 on, got {0:g}")
    for column, name in enumerate(("subject", "barcode")):
        _, firsts = np.unique(table.values[:, column], return_index=True)
        again = np.ones(len(table.values), dtype=bool)
        again[firsts] = False
        table.refuse(again, f"expected every {name} once, got {{{column}:g}} again")
    return {int(barcode): int(subject) for subject, barcode in table.values}


def _logs(folder: Path, subjects: dict[int, int]) -> list[Log]:
    """Measurements of all robots."""
    logs = []
    for robot in ROBOTS:
        name = f"Robot{robot}_Measurement.dat"
        if table_path(folder, name) is None:
            continue
        table = read_table(folder, name, ("time", "barcode", "range", "bearing"))
        time, barcode, distance, bearing = table.values.T
        table.refuse(barcode % 1 != 0, "expected a whole number as barcode, got {1:g}")
        table.refuse(distance < 0, "expected a range of at least 0, got {2:g}")
        table.refuse(np.abs(bearing) > TURN, "expected radians within one turn as bearing, got {3:g}: degrees?")
        subject = np.array([subjects.get(code, UNKNOWN) for code in barcode.tolist()])
        logs.append(Log(robot, time, subject, bearing))
    if not logs:
        raise InvalidInputError(
            f"{os.fspath(folder)}: expected files Robot1_Measurement.dat to Robot5_Measurement.dat, or some of them, "
            "plain or as .gz; got none"
        )
    return logs


def _views(
    log: Log, kept: NDArray[np.bool_], window: float, every: float, left_out: Counter[str]
) -> tuple[FloatArray, IntArray, IntArray, FloatArray]:
    """Times of views, and the view, subject and bearing of every sighting."""
    time, subject, bearing = log.time[kept], log.subject[kept], log.bearing[kept]
    starts: list[int] = []
    next_one = 0
    while next_one < len(time):
        starts.append(next_one)
        next_one = int(np.searchsorted(time, time[next_one] + window, side="right"))
    begin = np.array(starts, dtype=np.int64)
    view = np.repeat(np.arange(len(begin)), np.diff(np.append(begin, len(time))))
    _, first = np.unique(np.stack([view, subject]), axis=1, return_index=True)
    left_out["second"] += len(view) - len(first)
    view, subject, bearing = view[first], subject[first], bearing[first]

    times = time[begin]
    spaced = np.zeros(len(times), dtype=bool)
    latest = -math.inf
    for i, at in enumerate(times.tolist()):
        if at - latest >= every:
            spaced[i], latest = True, at
    number = np.cumsum(spaced) - 1
    among = spaced[view]
    left_out["close"] += len(view) - int(among.sum())
    return times[spaced], number[view[among]], subject[among], bearing[among]


def _motions(
    folder: Path, robot: int, times: FloatArray, delay: float, scale: float, noise: OdometryNoise
) -> tuple[NDArray[np.bool_], FloatArray, FloatArray]:
    """Motions of one robot from each view to the next, as `dead_reckoning` returns them."""
    table = read_table(folder, f"Robot{robot}_Odometry.dat", ("time", "forward velocity", "angular velocity"))
    table.refuse(np.abs(table.values[:, 1:]).max(axis=1) > COMMAND, "expected velocities, got {1:g} and {2:g}")
    time, forward, angular = table.values.T
    return dead_reckoning(time + delay, forward, scale * angular, times, noise)


def _remarks(left_out: Counter[str], every: float) -> list[str]:
    texts = {
        "robot": "sightings of other robots left out",
        "unknown": "sightings of barcodes missing from Barcodes.dat left out",
        "second": "repeated sightings of a landmark in one view left out",
        "close": f"sightings of views less than {every:g} s after the previous one left out",
        "motion": "motions before the odometry log begins or after it ends left out",
    }
    lines = [f"{left_out[what]} {text}" for what, text in texts.items() if left_out[what]]
    return [*lines, "ranges left out: only the bearings of the cameras are used"]
