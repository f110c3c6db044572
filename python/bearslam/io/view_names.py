# SPDX-License-Identifier: MIT OR Apache-2.0
"""Names of views that state the robot and the time, ``robot@time``, or the time alone."""

from __future__ import annotations

import math
from typing import NamedTuple

__all__ = ["Moment", "parse_view_name", "view_name"]


class Moment(NamedTuple):
    """Robot and time [s] of a view; None if its name does not state it."""

    robot: str | None
    time: float | None


def view_name(robot: str, time: float) -> str:
    """Name of a view, with enough digits to restore the time exactly, and at least milliseconds."""
    short = f"{time:.3f}"
    return f"{robot}@{short if float(short) == time else repr(time)}"


def parse_view_name(name: str) -> Moment:
    """Robot and time that the name of a view states.

    Examples
    --------
    >>> parse_view_name("3@1248446200.393"), parse_view_name("12.5"), parse_view_name("north")
    (Moment(robot='3', time=1248446200.393), Moment(robot=None, time=12.5), Moment(robot=None, time=None))
    """
    robot, mark, text = name.rpartition("@")
    try:
        time = math.nan if "_" in text else float(text)
    except ValueError:
        time = math.nan
    if not math.isfinite(time) or (mark and not robot):
        return Moment(None, None)
    return Moment(robot if mark else None, time)
