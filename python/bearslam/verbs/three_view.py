# SPDX-License-Identifier: MIT OR Apache-2.0
"""Three views of the same landmarks: motion and map in closed form, by the trifocal tensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bearslam import _core
from bearslam.data.checks import FloatArray, IntArray, angles, choice, floats, whole
from bearslam.errors import InvalidInputError

__all__ = ["ThreeViewBatch", "ThreeViewSolution", "epipoles", "three_view", "three_view_batch", "trifocal_tensor"]

ThreeViewMethod = Literal["calibrated", "projective"]
THREE_VIEW_METHODS = ("calibrated", "projective")
LANDMARKS = {"calibrated": 5, "projective": 7}
"""Smallest number of landmarks for each method."""


@dataclass(frozen=True, eq=False, repr=False)
class ThreeViewSolution:
    """One of the two motions that a trifocal tensor allows, with its landmarks.

    Attributes
    ----------
    poses : (3, 3) ndarray
        Position and heading (x, y, theta) of each view; the first at the origin with heading 0, the second at
        distance 1 from it [baselines, rad].
    landmarks : (n, 2) ndarray
        Positions in the same frame [baselines].
    inconsistent : int
        Sightings that point away from their landmark (cheirality); without noise 0 for the true motion.
    cost : float
        Half the sum of the squared differences between measured and predicted bearings [rad^2].
    near_collinear : bool
        Whether the three views are so nearly collinear that the two solutions merge: expect a large error.
    """

    poses: FloatArray
    landmarks: FloatArray
    inconsistent: int
    cost: float
    near_collinear: bool

    def __repr__(self) -> str:
        flag = ", near collinear" if self.near_collinear else ""
        return (
            f"<ThreeViewSolution: {len(self.landmarks)} landmarks, cost {self.cost:.3g}, "
            f"{self.inconsistent} inconsistent{flag}>"
        )


def three_view(
    bearings: ArrayLike, *, method: ThreeViewMethod = "calibrated", reweights: int = 2
) -> list[ThreeViewSolution]:
    """Motion of three views and positions of n landmarks from bearings alone, in closed form.

    The rays of three views to one landmark meet in a point, which is a trilinear equation in the three bearings as unit
    vectors. Its coefficients, the trifocal tensor, follow linearly from the bearings, and the motion follows from the
    tensor in closed form, up to a similarity of the plane and a twofold ambiguity.

    Parameters
    ----------
    bearings : (3, n) array_like of float
        Direction to each landmark in the frame of each view, counter-clockwise from its heading [rad].
    method : {"calibrated", "projective"}
        "calibrated" exploits that bearings are angles: six unknowns, n >= 5. "projective" is the method of the paper:
        eight unknowns, n >= 7.
    reweights : int
        Number of times that the calibrated equations are solved again, each divided by its standard deviation.

    Returns
    -------
    list of ThreeViewSolution
        Best first: fewest sightings that point away from their landmark, then lowest cost. Two solutions, of which the
        true one may come second in noise; or one, if noise makes the views seem collinear, so that both merge.

    Raises
    ------
    InvalidInputError
        If the shape is not (3, n), n is too small, or a bearing is not finite.
    DegenerateError
        If more than one tensor fits the bearings: all landmarks on one line, or on one circular cubic curve through
        the three views, or two coincident views.

    References
    ----------
    F. Dellaert and A. Stroupe, "Linear 2D Localization and Mapping for Single and Multiple Robot Scenarios", ICRA 2002.
    K. Astrom and M. Oskarsson, "Solutions and Ambiguities of the Structure and Motion Problem for 1D
    Retinal Vision", Journal of Mathematical Imaging and Vision 12(2), 2000, for five landmarks.

    Examples
    --------
    >>> import numpy as np
    >>> from bearslam import align, simulate, three_view
    >>> scene = simulate("mixed", 3, 5, noise=0.0, seed=1)
    >>> solutions = three_view(scene.bearings)
    >>> errors = [
    ...     np.abs(align(s.landmarks, scene.landmarks).apply(s.landmarks) - scene.landmarks).max() for s in solutions
    ... ]
    >>> bool(min(errors) < 1e-6)  # one of them is the truth, to 1e-6 m
    True

    Landmarks along one wall do not determine the motion:

    >>> wall = np.arctan2(2.0, np.linspace(-3, 3, 9) - np.array([[0.0], [1.0], [-0.5]]))
    >>> three_view(wall)
    Traceback (most recent call last):
    bearslam.errors.DegenerateError: ...
    """
    array = angles("bearings", bearings, (3, "n"))
    choice("method", method, THREE_VIEW_METHODS)
    return [ThreeViewSolution(**raw) for raw in _core.three_view(array, method, whole("reweights", reweights, 0))]


@dataclass(frozen=True, eq=False, repr=False)
class ThreeViewBatch:
    """Both solutions of each of k three-view problems, best first; NaN where there is none.

    Attributes
    ----------
    poses : (k, 2, 3, 3) ndarray
        Poses of both solutions, as in `ThreeViewSolution`.
    landmarks : (k, 2, n, 2) ndarray
        Positions in the same frames.
    inconsistent : (k, 2) ndarray of int
        Sightings that point away from their landmark; -1 where there is no solution.
    cost : (k, 2) ndarray
        Half the sum of the squared differences between measured and predicted bearings [rad^2].
    near_collinear : (k,) ndarray of bool
        Whether the two solutions merge: expect a large error.
    """

    poses: FloatArray
    landmarks: FloatArray
    inconsistent: IntArray
    cost: FloatArray
    near_collinear: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.poses)

    def __repr__(self) -> str:
        solved = int((self.inconsistent[:, 0] >= 0).sum())
        return f"<ThreeViewBatch: {solved} of {len(self)} problems with {self.landmarks.shape[2]} landmarks solved>"


def three_view_batch(
    bearings: ArrayLike, *, method: ThreeViewMethod = "calibrated", reweights: int = 2
) -> ThreeViewBatch:
    """Solve many three-view problems on all cores.

    Parameters
    ----------
    bearings : (k, 3, n) array_like of float
        k problems as `three_view` takes them [rad].
    method, reweights
        As for `three_view`.

    Returns
    -------
    ThreeViewBatch
        The results of `three_view` in arrays. A degenerate problem is not an error: its numbers are NaN.

    Raises
    ------
    InvalidInputError
        If the shape is not (k, 3, n), n is too small, or a bearing is not finite.

    References
    ----------
    As for `three_view`.

    Examples
    --------
    >>> import numpy as np
    >>> from bearslam import simulate, three_view_batch
    >>> scenes = [simulate("mixed", 3, 9, noise=0.01, seed=seed).bearings for seed in range(100)]
    >>> found = three_view_batch(np.stack(scenes))
    >>> found.poses.shape, found.landmarks.shape
    ((100, 2, 3, 3), (100, 2, 9, 2))
    """
    array = angles("bearings", bearings, ("k", 3, "n"))
    needed = LANDMARKS[choice("method", method, THREE_VIEW_METHODS)]
    count, _, landmarks = array.shape
    if landmarks < needed:
        raise InvalidInputError(f"bearings: expected at least {needed} landmarks, got {landmarks}")
    poses, points, inconsistent, cost, near_collinear = _core.three_view_batch(
        array, method, whole("reweights", reweights, 0)
    )
    return ThreeViewBatch(
        poses.reshape(count, 2, 3, 3), points.reshape(count, 2, landmarks, 2), inconsistent, cost, near_collinear
    )


def trifocal_tensor(bearings: ArrayLike, *, method: ThreeViewMethod = "calibrated", reweights: int = 2) -> FloatArray:
    """Trifocal tensor of three views, from the bearings of n landmarks.

    Minimises sum_k (sum_ijl T_ijl u_i v_j w_l)^2 over the tensors of unit norm, where u, v, w = (cos a, sin a) are the
    directions of one landmark in the three views.

    Parameters
    ----------
    bearings : (3, n) array_like of float
        Direction to each landmark in the frame of each view [rad].
    method : {"calibrated", "projective"}
        "calibrated" stays in the six-dimensional space of tensors of calibrated views, n >= 5; "projective" does not,
        n >= 7.
    reweights : int
        Number of times that the calibrated equations are solved again, each divided by its standard deviation.

    Returns
    -------
    (2, 2, 2) ndarray
        T[i, j, l], of unit Frobenius norm. Its sign is arbitrary.

    Raises
    ------
    InvalidInputError
        If the shape is not (3, n), n is too small, or a bearing is not finite.
    DegenerateError
        If more than one tensor fits; see `three_view`.

    References
    ----------
    Dellaert and Stroupe, ICRA 2002.

    Examples
    --------
    >>> import numpy as np
    >>> from bearslam import simulate, trifocal_tensor
    >>> scene = simulate("mixed", 3, 8, noise=0.0, seed=1)
    >>> u, v, w = np.stack([np.cos(scene.bearings), np.sin(scene.bearings)], axis=1)
    >>> tensor = trifocal_tensor(scene.bearings)
    >>> bool(np.abs(np.einsum("ijl,ik,jk,lk->k", tensor, u, v, w)).max() < 1e-12)
    True
    """
    array = angles("bearings", bearings, (3, "n"))
    choice("method", method, THREE_VIEW_METHODS)
    return _core.trifocal_tensor(array, method, whole("reweights", reweights, 0))


def epipoles(tensor: ArrayLike) -> FloatArray:
    """Bearings at which three views see one another, from their trifocal tensor.

    Parameters
    ----------
    tensor : (2, 2, 2) array_like of float
        Trifocal tensor, of any scale and sign, not zero.

    Returns
    -------
    (2, 3, 3) ndarray
        For each of the two solutions k, [k, i, j] is the bearing at which view i sees view j, modulo pi [rad]; NaN for
        i = j.

    Raises
    ------
    InvalidInputError
        If the shape is wrong or a number is not finite.
    DegenerateError
        If the epipoles are complex, with the discriminant as `value` (too much noise), or undefined (coincident views).

    References
    ----------
    Dellaert and Stroupe, ICRA 2002: the epipoles of the second view are the eigenvectors of M = L^-1 K, K
    and L the intrinsic homographies of the tensor from the second view to the third.

    Examples
    --------
    >>> import numpy as np
    >>> from bearslam import epipoles, simulate, trifocal_tensor
    >>> scene = simulate("mixed", 3, 8, noise=0.0, seed=1)
    >>> x, y, theta = scene.poses.T
    >>> truth = np.arctan2(y[1] - y[0], x[1] - x[0]) - theta[0]  # view 1 as seen by view 0
    >>> found = epipoles(trifocal_tensor(scene.bearings))[:, 0, 1]
    >>> bool(np.abs(np.sin(found - truth)).min() < 1e-6)
    True
    """
    return _core.epipoles(floats("tensor", tensor, (2, 2, 2)))
