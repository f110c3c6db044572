# SPDX-License-Identifier: MIT OR Apache-2.0
"""Triangulation: landmarks from known poses."""

from __future__ import annotations

from typing import Literal, overload

from numpy.typing import ArrayLike

from bearslam import _core
from bearslam.data.checks import FloatArray, angles, check_magnitudes, flag, plain, posed, spread
from bearslam.data.fix import Fix, fix_from_core, warn_of_doubts

__all__ = ["triangulate"]


@overload
def triangulate(
    poses: ArrayLike, bearings: ArrayLike, *, sigma: float | None = None, details: Literal[False] = False
) -> FloatArray: ...
@overload
def triangulate(
    poses: ArrayLike, bearings: ArrayLike, *, sigma: float | None = None, details: Literal[True]
) -> Fix: ...
@overload
def triangulate(
    poses: ArrayLike, bearings: ArrayLike, *, sigma: float | None = None, details: bool = False
) -> FloatArray | Fix: ...
def triangulate(
    poses: ArrayLike, bearings: ArrayLike, *, sigma: float | None = None, details: bool = False
) -> FloatArray | Fix:
    """Positions of landmarks from bearings at known poses, by linear least squares.

    Parameters
    ----------
    poses : (m, 3) array_like of float
        Position and heading (x, y, theta) of each view in the map frame, theta within one turn [length, rad]; m >= 2.
    bearings : (m,) or (m, n) array_like of float
        Direction to one landmark, or to each of n, in the frame of each view [rad]; NaN where it was not seen.
    sigma : float, optional
        Standard deviation of a bearing, at most pi [rad]; only covariances and warnings depend on it. If it is not
        given, or 1 and more, the covariances are for one radian, and the fit is not tested.
    details : bool, default False
        Whether to return covariances and residuals as well.

    Returns
    -------
    (2,) or (n, 2) ndarray, or Fix
        Positions in the map frame [length]. NaN for a landmark that the rays do not determine: fewer than two rays,
        parallel rays, lines that intersect behind a view, or residuals above 0.35 rad, root mean square. With `details`
        a `Fix`: positions, covariances, residuals.

    Raises
    ------
    InvalidInputError
        If shapes do not match, a number is not finite or too large, an angle is most likely in degrees, or `sigma` is
        not above 0.

    Warns
    -----
    PoorFitWarning
        If `sigma` is given and residuals are more than half as large again as it predicts, and not by chance.
    AmbiguousWarning
        If a position is uncertain by more than a fifth of its range: the rays are nearly parallel.

    References
    ----------
    Dellaert and Stroupe, ICRA 2002.

    Examples
    --------
    >>> import numpy as np
    >>> from bearslam import triangulate
    >>> poses = [[0.0, 0.0, 0.0], [2.0, 0.0, np.pi / 2]]
    >>> triangulate(poses, [np.pi / 4, np.pi / 4]).round(6)
    array([1., 1.])
    >>> fix = triangulate(poses, [np.pi / 4, np.pi / 4], sigma=0.01, details=True)
    >>> np.sqrt(np.diag(fix.covariance)).round(6)
    array([0.014142, 0.014142])

    Diverging rays do not intersect; their lines do, behind the views.

    >>> triangulate([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]], [0.5, 0.2])
    array([nan, nan])
    """
    known = posed("poses", poses, ("m", 3))
    check_magnitudes("poses", known)
    table = plain("bearings", bearings)
    single = table.ndim == 1
    directions = angles("bearings", table, (len(known),) if single else (len(known), "n"), missing=True)
    deviation = 1.0 if sigma is None else spread("sigma", sigma, above=True)
    detailed = flag("details", details)
    columns = directions[:, None] if single else directions
    raw = _core.triangulate(known, columns, deviation)
    warn_of_doubts(raw, "landmark", single=single)
    if detailed:
        return fix_from_core(raw, single=single)
    return raw["value"][0] if single else raw["value"]
