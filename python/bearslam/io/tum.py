# SPDX-License-Identifier: MIT OR Apache-2.0
"""Trajectories in the format of the TUM RGB-D benchmark, one pose per line, as read by `evo` and others."""

from __future__ import annotations

import math

import numpy as np

from bearslam.data.checks import quote
from bearslam.data.estimate import Estimate
from bearslam.data.problem import Problem
from bearslam.errors import InvalidInputError
from bearslam.io.view_names import parse_view_name

__all__ = ["render"]


def render(what: object, robot: str | int | None = None) -> str:
    """Lines ``timestamp x y z qx qy qz qw`` of the views of one robot, by time; those without a pose are counted.

    Times come from the names ``robot@time`` or ``time``. If any view of the robot has none, the numbers of the views
    are used instead.
    """
    if isinstance(what, Estimate):
        poses, ids = what.poses, what.view_ids
    elif isinstance(what, Problem) and what.start is not None:
        poses, ids = what.start.poses, what.view_ids
    else:
        raise InvalidInputError(
            f"what: expected a reconstruction, or a problem with a start, to write a trajectory, got {quote(what)}"
        )
    moments = [parse_view_name(str(i) if ids is None else ids[i]) for i in range(len(poses))]
    robots = list(dict.fromkeys(one.robot for one in moments if one.robot is not None))
    if robot is not None:
        if str(robot) not in robots:
            raise InvalidInputError(f"robot: expected one of {quote(robots)}, got {quote(robot)}")
        views = [i for i, one in enumerate(moments) if one.robot == str(robot)]
    elif len(robots) > 1:
        raise InvalidInputError(
            f"robot: expected one of {quote(robots)}, got none; a file holds the trajectory of one robot"
        )
    else:
        views = list(range(len(poses)))
    times = [moments[i].time for i in views]
    stamps = [float(i) for i in views] if None in times else [time for time in times if time is not None]
    rows = []
    for i, stamp in zip(views, stamps, strict=True):
        if np.isfinite(poses[i]).all():
            x, y, theta = poses[i].tolist()
            rows.append((stamp, f"{stamp!r} {x!r} {y!r} 0 0 0 {math.sin(theta / 2)!r} {math.cos(theta / 2)!r}\n"))
    if not rows:
        raise InvalidInputError("what: expected views with a pose, got none")
    rows.sort(key=lambda row: row[0])
    lines = ["# timestamp tx ty tz qx qy qz qw\n"]
    if None in times and any(time is not None for time in times):
        lines.append(
            f"# {times.count(None)} views have no time in their name: timestamps are the numbers of the views\n"
        )
    if len(rows) < len(views):
        lines.append(f"# {len(views) - len(rows)} of {len(views)} views have no pose and are left out\n")
    return "".join([*lines, *(line for _, line in rows)])
