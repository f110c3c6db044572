# SPDX-License-Identifier: MIT OR Apache-2.0
"""Measurements besides bearings: odometry, and priors on poses and landmarks, each with its uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bearslam.data.checks import FloatArray, IntArray, check_turn, floats, indices, plain, posed
from bearslam.errors import InvalidInputError

__all__ = ["LandmarkPriors", "Odometry", "PosePriors", "noise", "set_read_only"]

RANGE = (1e-100, 1e100)
"""Standard deviations whose fourth powers a double can hold."""
ASYMMETRY = 1e-5
"""Largest difference between two entries of a covariance that should be equal, over the largest entry. Files state six
digits or more."""


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Odometry:
    """Measured motions between views: one entry per motion, in parallel arrays.

    Parameters
    ----------
    start, end : (k,) array_like of int
        0-based indices of the views at the start and the end of each motion. They need not be consecutive, and a pair
        may be repeated.
    delta : (k, 3) array_like of float
        Pose (x, y, theta) of `end` in the frame of `start`; theta within one turn [length, rad].
    sigma : (3,), (k, 3) or (k, 3, 3) array_like of float
        Standard deviations of x, y and theta, for all motions or for each, or covariances, in the axes of the measured
        end pose; that of theta at most pi [length, rad].

    Raises
    ------
    InvalidInputError
        If lengths differ, a motion starts and ends at the same view, a number is not finite, an angle is most likely in
        degrees, or a standard deviation or covariance is not positive (definite).

    Examples
    --------
    >>> from bearslam import Odometry
    >>> Odometry(start=[0, 1], end=[1, 2], delta=[[1, 0, 0], [1, 0, 0.5]], sigma=[0.02, 0.02, 0.01])
    <Odometry: 2 motions between 3 views>
    """

    start: IntArray
    end: IntArray
    delta: FloatArray
    sigma: FloatArray

    def __init__(self, start: ArrayLike, end: ArrayLike, delta: ArrayLike, sigma: ArrayLike) -> None:
        first = indices("start", start)
        k = len(first)
        last = _as_many("end", indices("end", end), k, "start")
        if (first == last).any():
            where = int(np.argmax(first == last))
            raise InvalidInputError(
                f"end[{where}]: expected a view other than that of start, got {last[where]} for both"
            )
        set_read_only(
            self,
            start=first,
            end=last,
            delta=posed("delta", delta, (k, 3)),
            sigma=noise("sigma", sigma, k, 3),
        )

    def __len__(self) -> int:
        return len(self.start)

    def __repr__(self) -> str:
        views = len(np.union1d(self.start, self.end))
        return f"<Odometry: {len(self)} motions between {views} views>"


@dataclass(frozen=True, eq=False, repr=False, init=False)
class PosePriors:
    """Priors on poses in the map frame: a surveyed start, a compass, a GNSS receiver.

    Parameters
    ----------
    view : (k,) array_like of int
        0-based indices of the views.
    pose : (k, 3) array_like of float
        Their poses (x, y, theta); theta within one turn [length, rad].
    sigma : (3,), (k, 3) or (k, 3, 3) array_like of float
        Standard deviations of x, y and theta in the map frame, for all or for each, or covariances; that of theta at
        most pi [length, rad]. An infinite one means that nothing is known of the coordinate: ``[inf, inf, 0.02]`` is a
        compass.

    Raises
    ------
    InvalidInputError
        If lengths differ, a number is not finite (an infinite standard deviation apart), an angle is most likely in
        degrees, or a standard deviation or covariance is not positive (definite).

    Examples
    --------
    >>> import numpy as np
    >>> from bearslam import PosePriors
    >>> PosePriors(view=[0, 1], pose=[[0, 0, 0.1], [0, 0, 0.3]], sigma=[np.inf, np.inf, 0.02])
    <PosePriors: 2 poses>
    """

    view: IntArray
    pose: FloatArray
    sigma: FloatArray

    def __init__(self, view: ArrayLike, pose: ArrayLike, sigma: ArrayLike) -> None:
        index = indices("view", view)
        k = len(index)
        set_read_only(
            self,
            view=index,
            pose=posed("pose", pose, (k, 3)),
            sigma=noise("sigma", sigma, k, 3, unknown=True),
        )

    def __len__(self) -> int:
        return len(self.view)

    def __repr__(self) -> str:
        return f"<PosePriors: {len(self)} poses>"


@dataclass(frozen=True, eq=False, repr=False, init=False)
class LandmarkPriors:
    """Priors on the positions of landmarks in the map frame: beacons, survey points.

    Parameters
    ----------
    landmark : (k,) array_like of int
        0-based indices of the landmarks.
    position : (k, 2) array_like of float
        Their positions [length].
    sigma : float, or (2,), (k, 2) or (k, 2, 2) array_like of float
        Standard deviation of all coordinates, of x and y for all or for each, or covariances, in the map frame
        [length].

    Raises
    ------
    InvalidInputError
        If lengths differ, a number is not finite, or a standard deviation or covariance is not positive (definite).

    Examples
    --------
    >>> from bearslam import LandmarkPriors
    >>> LandmarkPriors(landmark=[3, 5], position=[[0, 0], [4.2, 0]], sigma=0.01)
    <LandmarkPriors: 2 landmarks>
    """

    landmark: IntArray
    position: FloatArray
    sigma: FloatArray

    def __init__(self, landmark: ArrayLike, position: ArrayLike, sigma: ArrayLike) -> None:
        index = indices("landmark", landmark)
        k = len(index)
        each = plain("sigma", sigma)
        set_read_only(
            self,
            landmark=index,
            position=floats("position", position, (k, 2)),
            sigma=noise("sigma", np.repeat(each, 2) if each.ndim == 0 else each, k, 2),
        )

    def __len__(self) -> int:
        return len(self.landmark)

    def __repr__(self) -> str:
        return f"<LandmarkPriors: {len(self)} landmarks>"


def set_read_only(owner: object, **fields: IntArray | FloatArray) -> None:
    """Set fields of a frozen dataclass to read-only copies of arrays."""
    for name, values in fields.items():
        own = values.copy()
        own.flags.writeable = False
        object.__setattr__(owner, name, own)


def _as_many(name: str, values: IntArray, k: int, other: str) -> IntArray:
    if len(values) != k:
        raise InvalidInputError(f"{name}: expected as many entries as {other} has, {k}, got {len(values)}")
    return values


def noise(name: str, value: ArrayLike, k: int, n: int, *, unknown: bool = False) -> FloatArray:
    """Standard deviations (k, n), or covariances (k, n, n); of three numbers the last is a heading."""
    given = plain(name, value)
    if given.ndim == 3:
        covariances = _covariances(name, floats(name, given, (k, n, n)))
        if n == 3:
            expected = "at most the variance of half a turn in radians"
            check_turn(name, covariances, expected=expected, turn=math.pi**2, column=(2, 2))
        return covariances
    shape: Sequence[int] = (n,) if given.ndim == 1 else (k, n)
    known = given
    if unknown and given.dtype.kind == "f":
        known = np.where(np.isposinf(given), 1.0, given)
    values = floats(name, known, shape)
    low, high = RANGE
    bad = ~((values >= low) & (values <= high))
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        wanted = f"from {low:g} to {high:g}" if values[where] > 0 else "above 0"
        raise InvalidInputError(
            f"{name}[{', '.join(map(str, where))}]: expected a number {wanted}, got {values[where]:g}"
        )
    if n == 3:
        check_turn(name, values, expected="radians within half a turn", turn=math.pi, column=(2,))
    if unknown and given.dtype.kind == "f":
        values = np.where(np.isposinf(given), np.inf, values)
    return np.ascontiguousarray(np.broadcast_to(values, (k, n)))


def _covariances(name: str, values: FloatArray) -> FloatArray:
    size = np.abs(values).max(axis=(1, 2), initial=0.0)
    skew = np.abs(values - values.transpose(0, 2, 1)).max(axis=(1, 2), initial=0.0) > ASYMMETRY * size
    if skew.any():
        where = int(np.argmax(skew))
        matrix = values[where]
        i, j = np.unravel_index(np.argmax(np.abs(matrix - matrix.T)), matrix.shape)
        raise InvalidInputError(
            f"{name}[{where}]: expected a symmetric covariance, got {matrix[i, j]:g} at [{i}, {j}] and "
            f"{matrix[j, i]:g} at [{j}, {i}]"
        )
    least = np.linalg.eigvalsh(values)[:, 0]
    if not (least > 0).all():
        where = int(np.argmin(least > 0))
        raise InvalidInputError(
            f"{name}[{where}]: expected a positive definite covariance, got one with the eigenvalue {least[where]:g}"
        )
    return values
