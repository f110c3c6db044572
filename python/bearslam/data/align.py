# SPDX-License-Identifier: MIT OR Apache-2.0
"""Similarities of the plane: the gauge freedom of bearings alone, and the alignment of one map with another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bearslam import _core
from bearslam.data.checks import FloatArray, check_magnitudes, floats, posed

__all__ = ["Similarity", "align"]


@dataclass(frozen=True, eq=False)
class Similarity:
    """Scaling, rotation and translation of the plane: x -> scale R(angle) x + translation.

    Attributes
    ----------
    scale : float
        Scale factor, above 0.
    angle : float
        Rotation, counter-clockwise [rad].
    translation : (2,) ndarray
        Image of the origin [length of the target].
    """

    scale: float
    angle: float
    translation: FloatArray

    def apply(self, points: ArrayLike) -> FloatArray:
        """Points (k, 2) transformed into the frame of the target; NaN stays NaN."""
        array = floats("points", points, ("k", 2), missing=True)
        check_magnitudes("points", array)
        return self._moved(array)

    def _moved(self, array: FloatArray) -> FloatArray:
        c, s = self.scale * np.cos(self.angle), self.scale * np.sin(self.angle)
        moved: FloatArray = array @ np.array([[c, s], [-s, c]]) + self.translation
        return moved

    def apply_poses(self, poses: ArrayLike) -> FloatArray:
        """Poses (k, 3) transformed into the frame of the target, headings in (-pi, pi]; NaN stays NaN."""
        array = posed("poses", poses, ("k", 3), missing=True)
        check_magnitudes("poses", array)
        return np.column_stack([self._moved(array[:, :2]), wrap(array[:, 2] + self.angle)])


def align(source: ArrayLike, target: ArrayLike) -> Similarity:
    """Similarity that best maps the source points to the target points, in the least-squares sense.

    Parameters
    ----------
    source, target : (k, 2) array_like of float
        Corresponding points, k >= 2 [length of each frame].

    Returns
    -------
    Similarity
        From the frame of the source to that of the target, without reflection.

    Raises
    ------
    InvalidInputError
        If shapes differ, there are fewer than two points, or a number is not finite or too large.
    DegenerateError
        If all source points, or all target points, coincide.

    References
    ----------
    S. Umeyama, "Least-Squares Estimation of Transformation Parameters Between Two Point Patterns", PAMI 13(4), 1991.

    Examples
    --------
    >>> from bearslam import align
    >>> similarity = align([[0, 0], [1, 0], [0, 1]], [[3, 1], [3, 3], [1, 1]])
    >>> round(similarity.scale, 9), round(similarity.angle, 9)
    (2.0, 1.570796327)
    >>> similarity.apply([[1, 1]]).round(6)
    array([[1., 3.]])
    """
    points = floats("source", source, ("k", 2))
    images = floats("target", target, (len(points), 2))
    for name, array in (("source", points), ("target", images)):
        check_magnitudes(name, array)
    scale, angle, x, y = _core.align(points, images)
    return Similarity(scale, angle, np.array([x, y]))


def wrap(angle: FloatArray) -> FloatArray:
    """Angles wrapped to (-pi, pi] [rad]."""
    return np.pi - np.mod(np.pi - angle, 2 * np.pi)
