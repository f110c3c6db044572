# SPDX-License-Identifier: MIT OR Apache-2.0
"""Fixes: landmarks from known poses and poses from known landmarks, with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bearslam.data.checks import FloatArray

if TYPE_CHECKING:
    from bearslam._core import RawFixes

__all__ = ["Fix"]


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
    """

    value: FloatArray
    covariance: FloatArray
    rms: float | FloatArray
    sigma0: float | FloatArray


def fix_from_core(raw: RawFixes, *, single: bool) -> Fix:
    """The fix of all rows, or of the only one."""
    value, covariance, rms, sigma0 = raw["value"], raw["covariance"], raw["rms"], raw["sigma0"]
    assert covariance is not None
    assert rms is not None
    assert sigma0 is not None
    if single:
        return Fix(value[0], covariance[0], float(rms[0]), float(sigma0[0]))
    return Fix(value, covariance, rms, sigma0)
