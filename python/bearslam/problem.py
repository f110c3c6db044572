# SPDX-License-Identifier: MIT OR Apache-2.0
"""What is solved: sightings, whether they come as a table with gaps, as parallel arrays or out of a file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bearslam.coerce import FloatArray, IntArray, floats, indices, plain, quote
from bearslam.errors import InvalidInputError

PAIRS = 2**33
"""Pairs of a view and a landmark, one bit each in the core: 1 GB."""
GAPS = 1000
"""Views or landmarks for each sighting, motion or prior beyond which an index is a slip."""
SIGMA_RANGE = (1e-100, 1e100)
"""Standard deviations whose squares, and theirs in turn, are numbers [rad]."""

__all__ = ["Problem", "ProblemLike", "Sightings"]


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Sightings:
    """Who saw what, and in which direction: one entry per sighting, in parallel arrays.

    Parameters
    ----------
    view, landmark : (k,) array_like of int
        0-based indices of the view that saw and of the landmark that was seen. A view sees a landmark at most once.
        There are as many views (landmarks) as the largest index says.
    bearing : (k,) array_like of float
        Directions in the frame of the view, counter-clockwise from its heading [rad]. Any finite angle.
    sigma : (k,) array_like of float, or float, optional
        Standard deviations of the bearings, above 0 [rad].

    Raises
    ------
    InvalidInputError
        If lengths differ, there is nothing in them, an index is negative or no integer, or a number is not finite.

    Examples
    --------
    >>> from bearslam import Sightings
    >>> Sightings(view=[0, 0, 1], landmark=[0, 1, 1], bearing=[0.1, -0.4, 2.0])
    <Sightings: 3 of 2 landmarks from 2 views>
    """

    view: IntArray
    landmark: IntArray
    bearing: FloatArray
    sigma: FloatArray | None

    def __init__(
        self, view: ArrayLike, landmark: ArrayLike, bearing: ArrayLike, sigma: ArrayLike | None = None
    ) -> None:
        fields: dict[str, IntArray | FloatArray] = {
            "view": indices("view", view),
            "landmark": indices("landmark", landmark),
            "bearing": floats("bearing", bearing, ("k",)),
        }
        k = len(fields["view"])
        for name, values in fields.items():
            if len(values) != k:
                raise InvalidInputError(f"{name}: expected as many entries as view has, {k}, got {len(values)}")
        if k == 0:
            raise InvalidInputError("view: expected at least one sighting, got none")
        if sigma is not None:
            fields["sigma"] = deviations(sigma, (k,))
        for name, values in fields.items():
            own = values.copy()
            own.flags.writeable = False
            object.__setattr__(self, name, own)
        if sigma is None:
            object.__setattr__(self, "sigma", None)

    def __len__(self) -> int:
        return len(self.view)

    def __repr__(self) -> str:
        return f"<Sightings: {len(self)} of {self.landmark_count} landmarks from {self.view_count} views>"

    @property
    def view_count(self) -> int:
        """Number of views."""
        return int(self.view.max()) + 1

    @property
    def landmark_count(self) -> int:
        """Number of landmarks."""
        return int(self.landmark.max()) + 1


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Problem:
    """Sightings together with the names that their views and landmarks have outside.

    Parameters
    ----------
    sightings : Sightings
        Who saw what.
    view_ids, landmark_ids : iterable of str
        One name per view and per landmark: distinct, not empty, on one line, without blanks around it.

    Raises
    ------
    InvalidInputError
        If there are more or fewer names than views or landmarks, or a name is none.
    """

    sightings: Sightings
    view_ids: tuple[str, ...]
    landmark_ids: tuple[str, ...]

    def __init__(self, sightings: Sightings, view_ids: Iterable[str], landmark_ids: Iterable[str]) -> None:
        if not isinstance(sightings, Sightings):
            raise InvalidInputError(f"sightings: expected Sightings, got {type(sightings).__name__}")
        object.__setattr__(self, "sightings", sightings)
        object.__setattr__(self, "view_ids", _names("view_ids", view_ids, sightings.view_count))
        object.__setattr__(self, "landmark_ids", _names("landmark_ids", landmark_ids, sightings.landmark_count))

    def __repr__(self) -> str:
        return repr(self.sightings).replace("Sightings", "Problem", 1)


Entry = TypeVar("Entry", bound=np.generic)

ProblemLike: TypeAlias = ArrayLike | Sightings | Problem
"""An (m, n) array of bearings with NaN for what was not seen, `Sightings`, or a `Problem`."""


@dataclass(frozen=True, eq=False)
class Table:
    """Any problem in the one form that the core takes, and the way back to the form it came in."""

    views: int
    landmarks: int
    sightings: Sightings
    sigma: FloatArray
    dense: bool
    view_ids: tuple[str, ...] | None = None
    landmark_ids: tuple[str, ...] | None = None

    def restore(self, values: NDArray[Entry], missing: float | bool = np.nan) -> NDArray[Entry]:
        """Values per sighting in the shape of the problem: (m, n), filled up where nothing was seen, or (k,)."""
        if not self.dense:
            return values
        table = np.full((self.views, self.landmarks), missing, dtype=values.dtype)
        table[self.sightings.view, self.sightings.landmark] = values
        return table


def tabulate(problem: ProblemLike, sigma: ArrayLike = 1.0, *, views: int = 0, landmarks: int = 0) -> Table:
    """The sightings of any kind of problem, checked, with a standard deviation each.

    Plain `Sightings` do not say how many views and landmarks there are: there may be `views` and `landmarks` if that is
    more than they see.
    """
    if isinstance(problem, Problem):
        return replace(tabulate(problem.sightings, sigma), view_ids=problem.view_ids, landmark_ids=problem.landmark_ids)
    if isinstance(problem, Sightings):
        if problem.sigma is None:
            each = deviations(sigma, (len(problem),))
            problem = Sightings(problem.view, problem.landmark, problem.bearing, each)
        elif not np.array_equal(plain("sigma", sigma), 1.0):
            raise InvalidInputError("sigma: the sightings come with standard deviations of their own; give only one")
        else:
            each = problem.sigma
        views, landmarks = max(problem.view_count, views), max(problem.landmark_count, landmarks)
        if views * landmarks > PAIRS:
            raise InvalidInputError(
                f"sightings: expected indices that leave few numbers out, got {len(problem)} sightings of "
                f"{landmarks} landmarks from {views} views"
            )
        return Table(views, landmarks, problem, each, dense=False)
    bearings = floats("bearings", problem, ("m", "n"), missing=True)
    seen = ~np.isnan(bearings)
    if not seen.any():
        raise InvalidInputError(f"bearings: expected at least one sighting, got none in shape {bearings.shape}")
    each = deviations(sigma, bearings.shape, seen)
    view, landmark = np.nonzero(seen)
    views, landmarks = bearings.shape
    return Table(views, landmarks, Sightings(view, landmark, bearings[seen], each), each, dense=True)


def deviations(sigma: ArrayLike, shape: tuple[int, ...], seen: NDArray[np.bool_] | None = None) -> FloatArray:
    """One standard deviation for all sightings or one for each, as one for each."""
    given = plain("sigma", sigma)
    one = given.ndim == 0
    values = floats("sigma", given, () if one else shape, missing=seen is not None and not one)
    values = np.broadcast_to(values, shape)
    if seen is not None:
        values = values[seen]
    low, high = SIGMA_RANGE
    bad = ~((values >= low) & (values <= high))
    if bad.any():
        where = "" if one else f"[{int(np.argmax(bad))}]"
        value = values[bad][0]
        wanted = f"from {low:g} to {high:g}" if value > 0 else "above 0"
        raise InvalidInputError(f"sigma{where}: expected a number {wanted} for every sighting, got {value:g}")
    return np.ascontiguousarray(values)


def _names(name: str, values: Iterable[str], count: int) -> tuple[str, ...]:
    names = tuple(values)
    if len(names) != count:
        raise InvalidInputError(f"{name}: expected {count} names, got {len(names)}")
    for i, one in enumerate(names):
        if not (type(one) is str and one and one == one.strip()) or "\n" in one or "\r" in one:
            raise InvalidInputError(
                f"{name}[{i}]: expected a name on one line without blanks around it, got {quote(one)}"
            )
    if len(set(names)) != count:
        twice = next(one for i, one in enumerate(names) if one in names[:i])
        raise InvalidInputError(f"{name}: expected distinct names, got {quote(twice)} twice")
    return names
