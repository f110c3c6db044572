# SPDX-License-Identifier: MIT OR Apache-2.0
"""Maps: poses and landmarks, taken from anything that has them, and compared with the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from bearslam.data.align import Similarity, align, wrap
from bearslam.data.checks import FloatArray, floats, posed
from bearslam.errors import InvalidInputError

__all__ = ["Errors", "HasMap", "Map", "MapLike", "compare", "is_mirrored", "pick", "register"]


class HasMap(Protocol):
    """Anything with poses and landmarks: a reconstruction, a simulated scene, a three-view solution."""

    @property
    def poses(self) -> FloatArray:
        """(m, 3): x, y, theta."""

    @property
    def landmarks(self) -> FloatArray:
        """(n, 2): x, y."""


class Map(NamedTuple):
    """Poses (m, 3) and landmarks (n, 2) in one frame; rows of NaN are unknown."""

    poses: FloatArray
    landmarks: FloatArray


MapLike: TypeAlias = HasMap | tuple[ArrayLike, ArrayLike]


@dataclass(frozen=True)
class Errors:
    """Root-mean-square differences between a map and the truth, after alignment by a similarity.

    Attributes
    ----------
    position, landmark : float
        Errors of the positions of views and of landmarks [length of the truth]. NaN where there are none to compare.
    heading : float
        Error of the headings [rad].
    radius : float
        Root-mean-square distance of the compared true landmarks from their centroid [length of the truth].
    """

    position: float
    landmark: float
    heading: float
    radius: float


def pick(name: str, value: MapLike, views: int | None = None, landmarks: int | None = None) -> Map:
    """The poses and landmarks of anything that has them, checked to be of the given size, with headings in radians."""
    if isinstance(value, tuple):
        if len(value) != 2:
            raise InvalidInputError(f"{name}: expected (poses, landmarks), got a tuple of {len(value)}")
        poses, points = value
    else:
        try:
            poses, points = value.poses, value.landmarks
        except AttributeError:
            got = type(value).__name__
            raise InvalidInputError(f"{name}: expected a map or (poses, landmarks), got {got}") from None
    return Map(
        posed(f"{name}: poses", poses, ("m" if views is None else views, 3), missing=True),
        floats(f"{name}: landmarks", points, ("n" if landmarks is None else landmarks, 2), missing=True),
    )


def register(source: Map, target: Map) -> Similarity:
    """Similarity that best aligns all points of one map, views and landmarks alike, with those of another."""
    points = [np.concatenate([one.poses[:, :2], one.landmarks]) for one in (source, target)]
    known = np.isfinite(points[0] + points[1]).all(axis=1)
    if known.sum() < 2:
        raise InvalidInputError(
            f"truth: expected the positions of at least two views or landmarks of the map, got {int(known.sum())}"
        )
    return align(points[0][known], points[1][known])


def compare(estimate: MapLike, truth: MapLike) -> Errors:
    """Errors of the views and landmarks that a map and the truth both have."""
    target = pick("truth", truth)
    source = pick("estimate", estimate, len(target.poses), len(target.landmarks))
    similarity = register(source, target)
    views = similarity.apply_poses(source.poses) - target.poses
    landmarks = similarity.apply(source.landmarks) - target.landmarks
    compared = target.landmarks[np.isfinite(landmarks).all(axis=1)]
    around = compared - compared.mean(axis=0) if len(compared) else compared
    return Errors(_rms(views[:, :2]), _rms(landmarks), _rms(wrap(views[:, 2:])), _rms(around))


CLOSER = 0.2
"""Share of the errors of a map that its mirror image may have to be called the right one; those of maps that are
merely inaccurate have more."""


def is_mirrored(estimate: HasMap, truth: Map) -> bool:
    """Whether the mirror image of a map, which explains the same bearings counted clockwise, is closer to the truth."""
    mirror = Map(estimate.poses * (1.0, -1.0, -1.0), estimate.landmarks * (1.0, -1.0))
    places = [
        np.hypot(*np.nan_to_num((found.position, found.landmark)))
        for found in (compare(mirror, truth), compare(estimate, truth))
    ]
    return bool(places[0] < CLOSER * places[1])


def _rms(rows: FloatArray) -> float:
    square = (rows**2).sum(axis=1)
    known = square[np.isfinite(square)]
    return float(np.sqrt(known.mean())) if len(known) else float("nan")
