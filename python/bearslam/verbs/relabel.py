# SPDX-License-Identifier: MIT OR Apache-2.0
"""Wrong identities of landmarks put right by a map."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from bearslam import _core
from bearslam.data.maps import MapLike, pick
from bearslam.data.problem import Problem, ProblemLike
from bearslam.data.request import Request
from bearslam.data.sightings import Sightings

__all__ = ["LabelChange", "relabel"]

P = TypeVar("P", bound=ProblemLike)


@dataclass(frozen=True)
class LabelChange:
    """A bearing that has been given to another landmark.

    Attributes
    ----------
    view : int
        Index of the view.
    old, new : int
        Index of the landmark before and after.
    """

    view: int
    old: int
    new: int


def relabel(
    problem: P, reconstruction: MapLike, *, sigma: ArrayLike | None = None, oriented: bool = True
) -> tuple[P, tuple[LabelChange, ...]]:
    """Put wrong identities of landmarks right, by a map that explains the bearings.

    In each view all bearings are assigned anew to the landmarks of the map, at the least sum of squared residuals over
    sigma, each truncated at three standard deviations, with a little preference for their own identities. The map is
    refined, and this is repeated. Left alone are bearings that a second landmark explains within two standard
    deviations, those that would displace them, and bearings that no landmark explains, unless their identity goes to
    another bearing: they then take one that is left, and remain outliers.

    Parameters
    ----------
    problem : (m, n) array_like of float, Sightings or Problem
        As for `solve`.
    reconstruction : Reconstruction, Scene or (poses, landmarks)
        Map, usually of ``solve(..., robust=True)``. It must be right: look at its `explained`.
    sigma : float or array_like of float, optional
        Standard deviations of the bearings [rad], unless the sightings have their own.
    oriented : bool
        As for `solve`.

    Returns
    -------
    repaired : (m, n) ndarray, Sightings or Problem
        The problem with these identities, in the form in which it was given. A table of `sigma` is not changed.
    changes : tuple of LabelChange
        What has changed, view by view.

    Raises
    ------
    InvalidInputError
        If an argument is out of range, sigma is not stated, or the map is not of the size of the problem.

    See Also
    --------
    solve : with ``robust=True`` finds the map.

    Examples
    --------
    >>> from bearslam import relabel, simulate, solve
    >>> scene = simulate("mixed", 12, 15, noise=0.01, seed=3, outliers=0.3, outlier_kind="exchanged")
    >>> result = solve(scene.bearings, sigma=0.01, robust=True)
    >>> repaired, changes = relabel(scene.bearings, result, sigma=0.01)
    >>> solve(repaired, sigma=0.01, robust=True).inliers.sum() > result.inliers.sum() + 40
    np.True_
    """
    request = Request(problem, sigma, loss="squared", oriented=oriented)
    request.require_sigma("relabel")
    guess = pick("reconstruction", reconstruction, request.table.views, request.table.landmarks)
    changed = _core.relabel(request, guess.poses, guess.landmarks)
    changes = tuple(LabelChange(view, old, new) for _, view, old, new in changed)
    place, _, _, new = np.array(changed, dtype=np.int64).reshape(-1, 4).T
    seen = request.table.sightings
    landmark = seen.landmark.copy()
    landmark[place] = new
    if request.table.dense:
        table = np.full((request.table.views, request.table.landmarks), np.nan)
        table[seen.view, landmark] = seen.bearing
        return cast("P", table), changes
    given = problem.sightings if isinstance(problem, Problem) else cast("Sightings", problem)
    sightings = Sightings(given.view, landmark, given.bearing, given.sigma)
    if isinstance(problem, Problem):
        return cast("P", replace(problem, sightings=sightings)), changes
    return cast("P", sightings), changes
