# SPDX-License-Identifier: MIT OR Apache-2.0
"""Requests to the core: a problem with its odometry and priors, checked."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bearslam.data.checks import choice, flag
from bearslam.data.normalize import GAPS, DenseOrSparse, normalize
from bearslam.data.options import LOSSES
from bearslam.data.priors import LandmarkPriors, Odometry, PosePriors
from bearslam.data.problem import Problem, ProblemLike
from bearslam.errors import InvalidInputError

__all__ = ["Request"]

LARGEST_SIGMA = 0.5
"""Largest plausible standard deviation of a bearing [rad]: a larger one was most likely left at its default."""

T = TypeVar("T")


class Request:
    """A problem as the core reads it, and the `table` that brings the answer back into the form of the problem.

    The core reads the attributes views, landmarks, view, landmark, bearing, sigma, oriented, odometry, pose_priors and
    landmark_priors.
    """

    def __init__(
        self,
        problem: ProblemLike,
        sigma: ArrayLike | None,
        *,
        loss: str,
        oriented: bool,
        odometry: Odometry | None = None,
        pose_priors: PosePriors | None = None,
        landmark_priors: LandmarkPriors | None = None,
    ) -> None:
        motions = _instance("odometry", odometry, Odometry)
        poses = _instance("pose_priors", pose_priors, PosePriors)
        points = _instance("landmark_priors", landmark_priors, LandmarkPriors)
        if isinstance(problem, Problem):
            motions = problem.odometry if motions is None else motions
            poses = problem.known_poses() if poses is None else poses
            points = problem.known_landmarks() if points is None else points
        self.odometry, self.pose_priors, self.landmark_priors = motions, poses, points
        views = [] if motions is None else [motions.start, motions.end]
        views += [] if poses is None else [poses.view]
        landmarks = [] if points is None else [points.landmark]
        self.table: DenseOrSparse = normalize(
            problem,
            sigma,
            views=max((int(index.max(initial=-1)) + 1 for index in views), default=0),
            landmarks=max((int(index.max(initial=-1)) + 1 for index in landmarks), default=0),
        )
        entries = len(self.table.sightings) + sum(map(len, [*views, *landmarks]))
        if max(self.table.views, self.table.landmarks) > GAPS * entries:
            raise InvalidInputError(
                f"sightings: expected nearly consecutive indices, got {self.table.views} views and "
                f"{self.table.landmarks} landmarks in {entries} sightings, motions and priors"
            )
        if choice("loss", loss, LOSSES) != "squared":
            self.require_sigma(f"loss={loss!r}")
        for name, given in (("odometry", motions), ("pose_priors", poses), ("landmark_priors", points)):
            if given is not None:
                self.require_sigma(name)
        self.oriented = flag("oriented", oriented)
        self.views, self.landmarks = self.table.views, self.table.landmarks
        seen = self.table.sightings
        self.view, self.landmark, self.bearing, self.sigma = seen.view, seen.landmark, seen.bearing, self.table.sigma

    def keep(self, inliers: NDArray[np.bool_]) -> None:
        """Leave out the outliers among the sightings; `inliers` has one entry for each."""
        if len(inliers) != len(self.view):
            raise InvalidInputError(
                f"reconstruction: expected one of this problem, with {len(self.view)} sightings, "
                f"got one with {len(inliers)}"
            )
        self.view, self.landmark = self.view[inliers], self.landmark[inliers]
        self.bearing, self.sigma = self.bearing[inliers], self.sigma[inliers]

    def require_sigma(self, what: str) -> None:
        """Refuse implausible standard deviations: whatever weighs bearings against something else needs true ones."""
        sigma = self.table.sigma
        if (sigma > LARGEST_SIGMA).any():
            raise InvalidInputError(
                f"sigma: expected the standard deviation of a bearing in radians, at most {LARGEST_SIGMA:g}, which "
                f"{what} needs; got {sigma.max():g}"
            )


def _instance(name: str, value: T | None, kind: type[T]) -> T | None:
    if value is not None and not isinstance(value, kind):
        raise InvalidInputError(f"{name}: expected None or {kind.__name__}, got {type(value).__name__}")
    return value
