# SPDX-License-Identifier: MIT OR Apache-2.0
"""What there is to draw of a map, before any of it is drawn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bearslam.data.align import Similarity
from bearslam.data.checks import FloatArray, IntArray
from bearslam.data.maps import Map, register
from bearslam.data.sightings import Sightings

__all__ = ["aligned_to", "extent", "linear_part", "sight_lines", "transformed", "without_far_points"]

SHOWN = 5.0
"""Points that are farther from the middle than so many times most of the others are left out of the frame."""


def aligned_to(source: Map, target: Map) -> Map:
    """A map moved into the frame of another, by the similarity that fits best."""
    return transformed(source, register(source, target))


def transformed(source: Map, similarity: Similarity) -> Map:
    """A map as a similarity takes it."""
    return Map(similarity.apply_poses(source.poses), similarity.apply(source.landmarks))


def linear_part(similarity: Similarity) -> FloatArray:
    """The matrix of a similarity, without its translation."""
    c, s = similarity.scale * np.cos(similarity.angle), similarity.scale * np.sin(similarity.angle)
    return np.array([[c, -s], [s, c]])


def extent(of: Map) -> float:
    """Length of the diagonal of the box around a map, points far from all others apart."""
    points = without_far_points(of)
    return float(np.hypot(*np.ptp(points, axis=0))) if len(points) else 1.0


def without_far_points(of: Map) -> FloatArray:
    """Positions (k, 2) of views and landmarks, those far from all others apart."""
    points: FloatArray = np.concatenate([of.poses[:, :2], of.landmarks])
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) == 0:
        return points
    away = np.hypot(*(points - np.median(points, axis=0)).T)
    near: FloatArray = points[away <= SHOWN * np.quantile(away, 0.75)]
    return near


def sight_lines(
    drawn: Map,
    sightings: Sightings,
    which: NDArray[np.bool_] | IntArray | slice = slice(None),
    *,
    oriented: bool = True,
) -> FloatArray:
    """Start and end (k, 2, 2) of every bearing as it was measured, from the robot as far as the landmark."""
    poses, points = drawn.poses[sightings.view[which]], drawn.landmarks[sightings.landmark[which]]
    start = poses[:, :2]
    reach = np.hypot(*(points - start).T)
    direction = poses[:, 2] + sightings.bearing[which]
    away = np.column_stack([np.cos(direction), np.sin(direction)])
    if not oriented:  # a line goes both ways: to where the landmark is
        away *= np.where((away * (points - start)).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    end = start + reach[:, None] * away
    lines: FloatArray = np.stack([start, end], axis=1)
    return lines[np.isfinite(lines).all(axis=(1, 2))]
