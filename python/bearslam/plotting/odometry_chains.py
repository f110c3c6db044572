# SPDX-License-Identifier: MIT OR Apache-2.0
"""Chains of odometry: views in the order in which robots passed through them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bearslam.data.checks import FloatArray, IntArray
from bearslam.data.priors import Odometry

__all__ = ["OdometryChains", "closure_lines", "odometry_chains", "pieces"]


@dataclass(frozen=True, eq=False)
class OdometryChains:
    """Views in the order in which robots passed through them.

    Attributes
    ----------
    robots : tuple of (k,) ndarray of int
        Views of each robot with at least two, in order; robots in the order of their first views.
    closures : (c, 2) ndarray of int
        Pairs of views with other motions between them: loop closures, and motions between robots.
    """

    robots: tuple[IntArray, ...]
    closures: IntArray


def odometry_chains(odometry: Odometry | None, views: int) -> OdometryChains:
    """The chains among a number of views.

    Two views are consecutive if a motion joins them and neither has a motion to a view numbered between them. The views
    of several robots may thus come one robot after the other, or alternate.
    """
    if odometry is None:
        return OdometryChains((), np.empty((0, 2), dtype=np.intp))
    pairs = np.unique(np.sort(np.column_stack([odometry.start, odometry.end]), axis=1), axis=0)
    first, second = pairs.T
    following = np.full(views, views)
    preceding = np.full(views, -1)
    np.minimum.at(following, first, second)
    np.maximum.at(preceding, second, first)
    steps = (following[first] == second) & (preceding[second] == first)
    after = dict(zip(first[steps].tolist(), second[steps].tolist(), strict=True))
    robots = []
    for view in sorted(set(after) - set(after.values())):
        robot = [view]
        while robot[-1] in after:
            robot.append(after[robot[-1]])
        robots.append(np.array(robot))
    return OdometryChains(tuple(robots), pairs[~steps])


def pieces(robot: IntArray, points: FloatArray) -> list[IntArray]:
    """The views of a robot in runs of at least two whose points (m, 2) are all known."""
    known = np.isfinite(points[robot]).all(axis=1)
    stretches = np.split(robot, np.flatnonzero(np.diff(known)) + 1)
    return [
        linear_part for linear_part in stretches if len(linear_part) > 1 and np.isfinite(points[linear_part[0]]).all()
    ]


def closure_lines(of: OdometryChains, points: FloatArray) -> FloatArray:
    """Start and end (k, 2, 2) of closures whose points (m, 2) are known."""
    lines: FloatArray = points[of.closures]
    return lines[np.isfinite(lines).all(axis=(1, 2))]
