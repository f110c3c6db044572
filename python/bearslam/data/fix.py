# SPDX-License-Identifier: MIT OR Apache-2.0
"""Fixes: landmarks from known poses and poses from known landmarks, with their uncertainty."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bearslam.data.checks import FloatArray
from bearslam.errors import AmbiguousWarning, PoorFitWarning

if TYPE_CHECKING:
    from bearslam._core import RawFixes

__all__ = ["DOUBTFUL", "Fix", "fix_from_core", "warn_of_doubts"]

DOUBTFUL = 0.2
"""Uncertainty of a position as a share of its range, or of a map as a share of its size, that is not to be trusted."""


@dataclass(frozen=True, eq=False)
class Fix:
    """One landmark or pose, or n of them, with covariances and residuals.

    The covariance is that of least squares to first order, sigma^2 (J^T J)^-1, where J is the Jacobian of the bearings
    with respect to the unknowns. It assumes independent bearings with the stated standard deviation, and poses (in
    resection, landmarks) that are known exactly. Multiply it by the square of `sigma0` to scale it to the residuals.

    Where the value is NaN, so is the rest.

    Attributes
    ----------
    value : (2,), (3,), (n, 2) or (n, 3) ndarray
        What the call returns without details: positions (x, y), or poses (x, y, theta) [length, rad].
    covariance : (2, 2), (3, 3), (n, 2, 2) or (n, 3, 3) ndarray
        Covariance of the value in the map frame [length^2, length rad, rad^2].
    rms : float or (n,) ndarray
        Root mean square of the residuals [rad].
    sigma0 : float or (n,) ndarray
        Standard deviation of unit weight, a posteriori: the square root of the sum of (residual / sigma)^2 over the
        redundancy, the number of bearings minus that of unknowns. About 1 if `sigma` is right; NaN without redundancy.
    p_value : float or (n,) ndarray
        Probability that errors of the standard deviation `sigma` leave residuals as large as these (chi-square test).
        NaN without redundancy, and without a stated `sigma`.
    uncertainty : float or (n,) ndarray
        Standard deviation of the position in its least determined direction, as a share of the root-mean-square range,
        for residuals of one `sigma`, or as large as they are if that is more. Be careful above 0.2: the rays are nearly
        parallel, or the view is nearly on one circle with its landmarks (the danger circle). NaN without redundancy if
        `sigma` is not stated.
    """

    value: FloatArray
    covariance: FloatArray
    rms: float | FloatArray
    sigma0: float | FloatArray
    p_value: float | FloatArray
    uncertainty: float | FloatArray


def fix_from_core(raw: RawFixes, *, single: bool) -> Fix:
    """The fix of all rows, or of the only one."""
    members = (raw["value"], raw["covariance"], raw["rms"], raw["sigma0"], raw["p_value"], raw["uncertainty"])
    if single:
        value, covariance, *numbers = (member[0] for member in members)
        return Fix(value, covariance, *map(float, numbers))
    return Fix(*members)


def warn_of_doubts(raw: RawFixes, noun: str, *, single: bool) -> None:
    """Warn of fixes that are not to be trusted: one warning of each kind, at the caller of the verb."""
    poor = raw["poor"]
    loose = raw["uncertainty"] > DOUBTFUL
    for found, category, what, advice in (
        (
            poor,
            PoorFitWarning,
            "the residuals are {sigma0:.3g} times as large as sigma predicts",
            "look for a wrong bearing or identity, or state a larger sigma",
        ),
        (
            loose & ~poor,
            AmbiguousWarning,
            "the position is uncertain by {uncertainty:.0%} of its range: rays are nearly parallel, or view and "
            "landmarks nearly on one circle",
            "add bearings in other directions",
        ),
    ):
        places = np.flatnonzero(found)
        if len(places):
            worst = places[np.argmax(raw["sigma0" if found is poor else "uncertainty"][places])]
            told = what.format(sigma0=raw["sigma0"][worst], uncertainty=raw["uncertainty"][worst])
            who = "" if single else f"{len(places)} of {len(found)} {noun}s, worst {noun} {worst}: "
            warnings.warn(f"{who}{told}; {advice}", category, stacklevel=3)
