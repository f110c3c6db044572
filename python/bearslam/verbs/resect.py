# SPDX-License-Identifier: MIT OR Apache-2.0
"""Resection: poses from known landmarks."""

from __future__ import annotations

from typing import Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from bearslam import _core
from bearslam.data.checks import FloatArray, angles, check_magnitudes, flag, floats, plain, spread
from bearslam.data.fix import Fix, fix_from_core, warn_of_doubts
from bearslam.errors import InvalidInputError

__all__ = ["resect"]


@overload
def resect(
    landmarks: ArrayLike, bearings: ArrayLike, *, sigma: float | None = None, details: Literal[False] = False
) -> FloatArray: ...
@overload
def resect(landmarks: ArrayLike, bearings: ArrayLike, *, sigma: float | None = None, details: Literal[True]) -> Fix: ...
@overload
def resect(
    landmarks: ArrayLike, bearings: ArrayLike, *, sigma: float | None = None, details: bool = False
) -> FloatArray | Fix: ...
def resect(
    landmarks: ArrayLike, bearings: ArrayLike, *, sigma: float | None = None, details: bool = False
) -> FloatArray | Fix:
    """Pose of one view, or of each of several, from bearings to known landmarks, by linear least squares.

    Solves (u1 y - u2 x) c + (u1 x + u2 y) s - u2 t1 + u1 t2 = 0 for all landmarks (x, y) at once, u = (cos, sin) of the
    bearing, with c^2 + s^2 = 1 and each row divided by the range: [[c, -s], [s, c]] and (t1, t2) take the map into the
    frame of the view.

    Parameters
    ----------
    landmarks : (n, 2) array_like of float
        Positions in the map frame [length]; those that no view has seen may be NaN.
    bearings : (n,) or (m, n) array_like of float
        Direction to each landmark in the frame of one view, or of each of m [rad]; NaN where it was not seen. A view
        needs at least three.
    sigma : float, optional
        Standard deviation of a bearing, at most pi [rad]; only covariances and warnings depend on it. If it is not
        given, or 1 and more, the covariances are for one radian, and the fit is not tested.
    details : bool, default False
        Whether to return covariances and residuals as well.

    Returns
    -------
    (3,) or (m, 3) ndarray, or Fix
        Position and heading (x, y, theta) of each view in the map frame [length, rad]; of several, NaN for one that
        cannot be resected, or whose bearings contradict each other. With `details` a `Fix`: poses, covariances,
        residuals.

    Raises
    ------
    InvalidInputError
        If shapes do not match, a number is not finite or too large, an angle is most likely in degrees, `sigma` is not
        above 0, or the only view has seen fewer than three landmarks.
    DegenerateError
        If more than one pose fits the only view: it is on one circle with its landmarks, or they coincide. Or if none
        does: its residuals are above 0.35 rad, root mean square, as those of clockwise bearings are.

    Warns
    -----
    PoorFitWarning
        If `sigma` is given and residuals are more than half as large again as it predicts, and not by chance.
    AmbiguousWarning
        If a position is uncertain by more than a fifth of its range: the view is nearly on one circle with its
        landmarks.

    References
    ----------
    Dellaert and Stroupe, ICRA 2002 (the minus signs are missing from the scan).

    Examples
    --------
    >>> import numpy as np
    >>> from bearslam import resect
    >>> landmarks = [[1.0, 0.0], [0.0, 2.0], [-3.0, 0.0], [0.0, -1.0]]
    >>> bearings = [-0.5, np.pi / 2 - 0.5, np.pi - 0.5, -np.pi / 2 - 0.5]
    >>> pose = resect(landmarks, bearings)
    >>> bool(np.allclose(pose, [0.0, 0.0, 0.5]))
    True

    Several views at once; the second sees too few landmarks.

    >>> resect(landmarks, [bearings, [0.1, 0.2, np.nan, np.nan]]).shape
    (2, 3)
    >>> fix = resect(landmarks, bearings, sigma=0.01, details=True)
    >>> np.sqrt(np.diag(fix.covariance)).round(4)
    array([0.0092, 0.01  , 0.0054])
    """
    points = floats("landmarks", landmarks, ("n", 2), missing=True)
    check_magnitudes("landmarks", points)
    table = plain("bearings", bearings)
    single = table.ndim == 1
    directions = angles("bearings", table, (len(points),) if single else ("m", len(points)), missing=True)
    deviation = 1.0 if sigma is None else spread("sigma", sigma, above=True)
    detailed = flag("details", details)
    rows = directions[None] if single else directions
    seen = np.flatnonzero(np.isfinite(rows).any(axis=0))
    unknown = np.argwhere(np.isnan(points[seen]))
    if len(unknown):
        row, axis = unknown[0]
        index = seen[row]
        raise InvalidInputError(
            f"landmarks[{index}, {axis}]: expected a finite number for a landmark that was seen, got nan"
        )
    raw = _core.resect(points[seen], rows[:, seen], deviation, single)
    warn_of_doubts(raw, "view", single=single)
    if detailed:
        return fix_from_core(raw, single=single)
    return raw["value"][0] if single else raw["value"]
