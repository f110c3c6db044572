# SPDX-License-Identifier: MIT OR Apache-2.0
"""Estimates with their uncertainty: landmarks from known poses, poses from known landmarks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bearslam.data.checks import FloatArray

if TYPE_CHECKING:
    from bearslam._core import RawFixes

__all__ = ["Fix"]


@dataclass(frozen=True, eq=False)
class Fix:
    """One landmark or pose, or n of them, and how well it is known.

    The covariance is that of least squares to first order, for independent bearings with the stated standard deviation
    and for poses (in resection, landmarks) that are known exactly: sigma^2 (J^T J)^-1 with the derivatives J of the
    bearings by the unknowns. Multiplied by the square of `sigma0`, it is that for residuals as large as they are.

    Where the value is NaN, so is the rest.

    Attributes
    ----------
    value : (2,), (3,), (n, 2) or (n, 3) ndarray
        What the plain call returns: positions (x, y), or poses (x, y, theta) [length, rad].
    covariance : (2, 2), (3, 3), (n, 2, 2) or (n, 3, 3) ndarray
        Covariance of the value in the map frame [length^2, length rad, rad^2].
    rms : float or (n,) ndarray
        Root mean square of the residuals [rad].
    sigma0 : float or (n,) ndarray
        Standard deviation of unit weight: root of the sum of (residual / sigma)^2 over the redundancy, which is the
        number of bearings less that of unknowns. About 1 where `sigma` is right; NaN without redundancy.
    """

    value: FloatArray
    covariance: FloatArray
    rms: float | FloatArray
    sigma0: float | FloatArray


def fix_from_core(raw: RawFixes, *, single: bool) -> Fix:
    """Fix of all rows, or of the only one."""
    value, covariance, rms, sigma0 = raw["value"], raw["covariance"], raw["rms"], raw["sigma0"]
    assert covariance is not None, "details were asked for"
    assert rms is not None
    assert sigma0 is not None
    if single:
        return Fix(value[0], covariance[0], float(rms[0]), float(sigma0[0]))
    return Fix(value, covariance, rms, sigma0)
