# SPDX-License-Identifier: MIT OR Apache-2.0
"""Triangulation: landmarks from known poses."""

from __future__ import annotations

from numpy.typing import ArrayLike

from bearslam import _core
from bearslam.data.checks import FloatArray, floats

__all__ = ["triangulate"]


def triangulate(poses: ArrayLike, bearings: ArrayLike) -> FloatArray:
    """Positions of landmarks from bearings at known poses: the least-squares intersection of the rays, linearly.

    Parameters
    ----------
    poses : (m, 3) array_like of float
        Position and heading (x, y, theta) of each view in the map frame [length, rad]; m >= 2.
    bearings : (m, n) array_like of float
        Direction to each landmark in the frame of each view [rad]; NaN where it was not seen.

    Returns
    -------
    (n, 2) ndarray
        Positions in the map frame [length]. NaN for a landmark that the rays do not determine: seen fewer than twice,
        along parallel rays, or if the rays intersect behind the views.

    Raises
    ------
    InvalidInputError
        If shapes do not match or a number is not finite.

    References
    ----------
    Dellaert and Stroupe, ICRA 2002.

    Examples
    --------
    >>> import numpy as np
    >>> from bearslam import triangulate
    >>> poses = [[0.0, 0.0, 0.0], [2.0, 0.0, np.pi / 2]]
    >>> triangulate(poses, [[np.pi / 4], [np.pi / 4]]).round(6)
    array([[1., 1.]])
    """
    known = floats("poses", poses, ("m", 3))
    return _core.triangulate(known, floats("bearings", bearings, (len(known), "n"), missing=True))
