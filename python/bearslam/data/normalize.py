# SPDX-License-Identifier: MIT OR Apache-2.0
"""Problems of any kind, dense or sparse, in the one form that the core takes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bearslam.data.checks import FloatArray, angles
from bearslam.data.problem import Problem, ProblemLike
from bearslam.data.sightings import Sightings, deviations
from bearslam.errors import InvalidInputError

__all__ = ["GAPS", "DenseOrSparse", "normalize"]

PAIRS = 2**33
"""Largest number of pairs of a view and a landmark: one bit each in the core, 1 GB."""
GAPS = 1000
"""Largest number of views or landmarks per sighting, motion or prior; above it, an index is most likely a mistake."""

Entry = TypeVar("Entry", bound=np.generic)


@dataclass(frozen=True, eq=False)
class DenseOrSparse:
    """A problem as the core takes it, with the way back to the dense or sparse form in which it was given."""

    views: int
    landmarks: int
    sightings: Sightings
    sigma: FloatArray
    dense: bool
    view_ids: tuple[str, ...] | None = None
    landmark_ids: tuple[str, ...] | None = None

    def restore(self, values: NDArray[Entry], missing: float | bool = np.nan) -> NDArray[Entry]:
        """Values per sighting in the shape of the problem: (m, n), with `missing` where nothing was seen, or (k,)."""
        if not self.dense:
            return values
        table = np.full((self.views, self.landmarks), missing, dtype=values.dtype)
        table[self.sightings.view, self.sightings.landmark] = values
        return table


def normalize(
    problem: ProblemLike, sigma: ArrayLike | None = None, *, views: int = 0, landmarks: int = 0
) -> DenseOrSparse:
    """The sightings of a problem of any kind, checked, each with its standard deviation: one radian if none is stated.

    `Sightings` do not say how many views and landmarks there are: `views` and `landmarks` apply where they are more
    than the sightings have.
    """
    if isinstance(problem, Problem):
        table = normalize(
            problem.sightings,
            sigma,
            views=max(len(problem.view_ids), views),
            landmarks=max(len(problem.landmark_ids), landmarks),
        )
        if (table.views, table.landmarks) != (len(problem.view_ids), len(problem.landmark_ids)):
            raise InvalidInputError(
                f"problem: expected names for all views and landmarks of odometry and priors, {table.views} and "
                f"{table.landmarks}, got {len(problem.view_ids)} and {len(problem.landmark_ids)}"
            )
        return replace(table, view_ids=problem.view_ids, landmark_ids=problem.landmark_ids)
    if isinstance(problem, Sightings):
        if problem.sigma is None:
            each = deviations(1.0 if sigma is None else sigma, (len(problem),))
            problem = Sightings(problem.view, problem.landmark, problem.bearing, each)
        elif sigma is not None:
            raise InvalidInputError("sigma: the sightings have their own standard deviations; give only one of the two")
        else:
            each = problem.sigma
        views, landmarks = max(problem.view_count, views), max(problem.landmark_count, landmarks)
        if views * landmarks > PAIRS:
            raise InvalidInputError(
                f"sightings: expected nearly consecutive indices, got {len(problem)} sightings of "
                f"{landmarks} landmarks from {views} views"
            )
        return DenseOrSparse(views, landmarks, problem, each, dense=False)
    bearings = angles("bearings", problem, ("m", "n"), missing=True)
    seen = ~np.isnan(bearings)
    if not seen.any():
        raise InvalidInputError(f"bearings: expected at least one sighting, got none in shape {bearings.shape}")
    each = deviations(1.0 if sigma is None else sigma, bearings.shape, seen)
    view, landmark = np.nonzero(seen)
    views, landmarks = bearings.shape
    return DenseOrSparse(views, landmarks, Sightings(view, landmark, bearings[seen], each), each, dense=True)
