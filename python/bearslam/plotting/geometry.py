# SPDX-License-Identifier: MIT OR Apache-2.0
"""Geometry of figures of maps: alignment, extent and rays, before anything is drawn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bearslam.data.align import Similarity
from bearslam.data.checks import FloatArray, IntArray
from bearslam.data.maps import Map, register
from bearslam.data.sightings import Sightings

__all__ = ["aligned_to", "extent", "linear_part", "sight_lines", "transformed", "without_far_points"]

SHOWN = 5.0
"""Distance from the median, relative to the upper quartile of distances, beyond which points are outside the frame."""


def aligned_to(source: Map, target: Map) -> Map:
    """A map aligned with another by a similarity."""
    return transformed(source, register(source, target))


def transformed(source: Map, similarity: Similarity) -> Map:
    """A map transformed by a similarity."""
    return Map(similarity.apply_poses(source.poses), similarity.apply(source.landmarks))


def linear_part(similarity: Similarity) -> FloatArray:
    """Matrix of a similarity, without its translation."""
    c, s = similarity.scale * np.cos(similarity.angle), similarity.scale * np.sin(similarity.angle)
    return np.array([[c, -s], [s, c]])


def extent(of: Map) -> float:
    """Diagonal of the bounding box of a map, without points far from all others."""
    points = without_far_points(of)
    return float(np.hypot(*np.ptp(points, axis=0))) if len(points) else 1.0


def without_far_points(of: Map) -> FloatArray:
    """Positions (k, 2) of views and landmarks, without those far from all others."""
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
    """Start and end (k, 2, 2) of every measured bearing, from the view to the distance of the landmark."""
    poses, points = drawn.poses[sightings.view[which]], drawn.landmarks[sightings.landmark[which]]
    start = poses[:, :2]
    reach = np.hypot(*(points - start).T)
    direction = poses[:, 2] + sightings.bearing[which]
    away = np.column_stack([np.cos(direction), np.sin(direction)])
    if not oriented:  # a line has two directions: take that of the landmark
        away *= np.where((away * (points - start)).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    end = start + reach[:, None] * away
    lines: FloatArray = np.stack([start, end], axis=1)
    return lines[np.isfinite(lines).all(axis=(1, 2))]
