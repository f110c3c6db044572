# SPDX-License-Identifier: MIT OR Apache-2.0
"""Resection: a pose from known landmarks."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from bearslam import _core
from bearslam.data.checks import FloatArray, floats

__all__ = ["resect"]


def resect(landmarks: ArrayLike, bearings: ArrayLike) -> FloatArray:
    """Pose of one view from its bearings to known landmarks, linearly.

    Solves (u1 y - u2 x) c + (u1 x + u2 y) s - u2 t1 + u1 t2 = 0 for all landmarks (x, y) at once, u = (cos, sin) of the
    bearing, with c^2 + s^2 = 1 and each row divided by the range: [[c, -s], [s, c]] and (t1, t2) take the map into the
    frame of the view.

    Parameters
    ----------
    landmarks : (n, 2) array_like of float
        Positions in the map frame [length].
    bearings : (n,) array_like of float
        Direction to each landmark in the frame of the view [rad]; NaN where it was not seen. At least three are needed.

    Returns
    -------
    (3,) ndarray
        Position and heading (x, y, theta) of the view in the map frame [length, rad].

    Raises
    ------
    InvalidInputError
        If shapes do not match, fewer than three landmarks were seen, or a number is not finite.
    DegenerateError
        If more than one pose fits: three landmarks on a circle with the view, or coincident landmarks.

    References
    ----------
    Dellaert and Stroupe, ICRA 2002 (the scan has lost the minus signs).

    Examples
    --------
    >>> import numpy as np
    >>> from bearslam import resect
    >>> pose = resect([[1.0, 0.0], [0.0, 2.0], [-3.0, 0.0], [0.0, -1.0]], [-0.5, np.pi / 2 - 0.5, np.pi - 0.5, -2.0708])
    >>> bool(np.allclose(pose, [0.0, 0.0, 0.5], atol=1e-4))
    True
    """
    points = floats("landmarks", landmarks, ("n", 2), missing=True)
    directions = floats("bearings", bearings, (len(points),), missing=True)
    seen = ~np.isnan(directions)
    return _core.resect(floats("landmarks", points[seen], ("n", 2)), directions[seen])
