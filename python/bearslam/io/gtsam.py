# SPDX-License-Identifier: MIT OR Apache-2.0
"""Maps as graphs of GTSAM; see `Reconstruction.to_gtsam`."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from bearslam.data.checks import FloatArray
from bearslam.data.estimate import Estimate, per_sighting

__all__ = ["to_gtsam"]

HELD = 1e-4
"""Standard deviation of the priors that fix the gauge [rad, or share of the size of the map]."""
RANK = 1e-8
"""Singular value below which a gauge freedom counts as fixed; lengths are shares of the size of the map."""


def to_gtsam(result: Estimate) -> tuple[Any, Any]:
    """Factors and initial values of a reconstruction."""
    try:
        gtsam: Any = importlib.import_module("gtsam")
    except ImportError as error:
        raise ImportError(f"a graph for GTSAM needs gtsam: pip install gtsam ({error})") from None
    return _Builder(result, gtsam).build()


class _Builder:
    """A graph under construction, with the gauge freedom that is left."""

    def __init__(self, result: Estimate, gtsam: Any) -> None:
        self.result, self.gtsam = result, gtsam
        self.graph = gtsam.NonlinearFactorGraph()
        self.views = ~np.isnan(result.poses[:, 0])
        self.landmarks = ~np.isnan(result.landmarks[:, 0])
        points = np.concatenate([result.poses[self.views, :2], result.landmarks[self.landmarks]])
        self.middle = points.mean(axis=0)
        self.size = float(np.sqrt(((points - self.middle) ** 2).sum(axis=1).mean()))
        # Rows: derivatives of the known numbers with respect to translation along x and y, rotation about the centroid,
        # and scale.
        self.known: FloatArray = np.zeros((0, 4))

    def build(self) -> tuple[Any, Any]:
        values = self.gtsam.Values()
        for i in np.flatnonzero(self.views).tolist():
            values.insert(self._x(i), self.gtsam.Pose2(*self.result.poses[i]))
        for j in np.flatnonzero(self.landmarks).tolist():
            values.insert(self._l(j), self.result.landmarks[j])
        self._bearings()
        self._motions()
        self._known_poses()
        self._known_landmarks()
        self._hold()
        return self.graph, values

    def _x(self, view: int) -> Any:
        return self.gtsam.symbol("x", view)

    def _l(self, landmark: int) -> Any:
        return self.gtsam.symbol("l", landmark)

    def _bearings(self) -> None:
        result, seen = self.result, self.result.sightings
        sigma = np.ones(len(seen)) if seen.sigma is None else seen.sigma
        used = per_sighting(result, result.inliers) & self.views[seen.view] & self.landmarks[seen.landmark]
        bearing = seen.bearing.copy()
        if not result.oriented:  # the direction of a line towards the landmark
            away = result.landmarks[seen.landmark] - result.poses[seen.view, :2]
            ahead = np.arctan2(away[:, 1], away[:, 0]) - result.poses[seen.view, 2]
            bearing[np.cos(ahead - bearing) < 0] += np.pi
        for k in np.flatnonzero(used).tolist():
            keys = self._x(int(seen.view[k])), self._l(int(seen.landmark[k]))
            noise = self.gtsam.noiseModel.Isotropic.Sigma(1, float(sigma[k]))
            self.graph.add(self.gtsam.BearingFactor2D(*keys, self.gtsam.Rot2.fromAngle(float(bearing[k])), noise))

    def _motions(self) -> None:
        odometry = self.result.odometry
        if odometry is None:
            return
        for k in np.flatnonzero(self.views[odometry.start] & self.views[odometry.end]).tolist():
            start, end = int(odometry.start[k]), int(odometry.end[k])
            delta, noise = self.gtsam.Pose2(*odometry.delta[k]), self._noise(odometry.sigma[k])
            self.graph.add(self.gtsam.BetweenFactorPose2(self._x(start), self._x(end), delta, noise))
            moved = (self.result.poses[end, :2] - self.result.poses[start, :2]) / self.size
            self._know(np.outer(moved, [0, 0, 0, 1]))

    def _known_poses(self) -> None:
        priors = self.result.pose_priors
        if priors is None:
            return
        for i, pose, sigma in zip(priors.view.tolist(), priors.pose, priors.sigma, strict=True):
            if not self.views[i]:
                continue
            key, there = self._x(i), self._place(self.result.poses[i, :2])
            heading = np.array([[0.0, 0, 1, 0]])
            if sigma.ndim == 2:
                # GTSAM's axes are those of the pose.
                c, s = np.cos(pose[2]), np.sin(pose[2])
                turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
                noise = self._noise(turn.T @ sigma @ turn)
                self.graph.add(self.gtsam.PriorFactorPose2(key, self.gtsam.Pose2(*pose), noise))
                self._know(there, heading)
                continue
            # Position and heading separately, in the axes of the map.
            known = np.isfinite(sigma)
            if known[:2].any():
                noise = self._noise(sigma[:2])
                self.graph.add(self.gtsam.PoseTranslationPrior2D(key, self.gtsam.Pose2(*pose), noise))
                self._know(there[known[:2]])
            if known[2]:
                noise = self._noise(sigma[2:])
                self.graph.add(self.gtsam.PoseRotationPrior2D(key, self.gtsam.Pose2(*pose), noise))
                self._know(heading)

    def _known_landmarks(self) -> None:
        priors = self.result.landmark_priors
        if priors is None:
            return
        for j, position, sigma in zip(priors.landmark.tolist(), priors.position, priors.sigma, strict=True):
            if self.landmarks[j]:
                self.graph.add(self.gtsam.PriorFactorPoint2(self._l(j), position, self._noise(sigma)))
                self._know(self._place(self.result.landmarks[j]))

    def _hold(self) -> None:
        """Fix the remaining gauge freedom at the map, with zero cost there, so that the optimum does not change."""
        views = np.flatnonzero(self.views).tolist()
        if not views:
            return
        first = views[0]
        pose = self.gtsam.Pose2(*self.result.poses[first])
        isotropic = self.gtsam.noiseModel.Isotropic.Sigma
        if self._frees(np.array([[0.0, 0, 1, 0]])):
            self.graph.add(self.gtsam.PoseRotationPrior2D(self._x(first), pose, isotropic(1, HELD)))
        away = self.result.poses[views, :2] - self.result.poses[first, :2]
        reach = np.hypot(*away.T)
        last = int(np.argmax(reach))
        if reach[last] > 0 and self._frees(np.array([[0.0, 0, 0, 1]])):
            keys = self._x(first), self._x(views[last])
            noise = isotropic(1, HELD * self.size)
            self.graph.add(self.gtsam.RangeFactorPose2(*keys, float(reach[last]), noise))
        rows = self._place(self.result.poses[first, :2])
        held = np.array([HELD * self.size if self._frees(row[None]) else np.inf for row in rows])
        if np.isfinite(held).any():
            self.graph.add(self.gtsam.PoseTranslationPrior2D(self._x(first), pose, self._noise(held)))

    def _place(self, point: FloatArray) -> FloatArray:
        """Derivative of a point with respect to the gauge of the whole map."""
        x, y = (point - self.middle) / self.size
        return np.array([[1.0, 0, -y, x], [0, 1, x, y]])

    def _know(self, *rows: FloatArray) -> None:
        self.known = np.concatenate([self.known, *rows])
        if len(self.known) > 4:
            # The same information in four rows.
            self.known = np.linalg.qr(self.known).R

    def _frees(self, rows: FloatArray) -> bool:
        """Whether these rows depend on a gauge freedom that is left; they count as known from now on."""
        before = np.linalg.matrix_rank(self.known, tol=RANK) if len(self.known) else 0
        self._know(rows)
        return bool(np.linalg.matrix_rank(self.known, tol=RANK) > before)

    def _noise(self, sigma: FloatArray) -> Any:
        """Noise model of standard deviations, some of which may be infinite, or of a covariance."""
        models = self.gtsam.noiseModel
        if sigma.ndim == 2:
            return models.Gaussian.Covariance(sigma)
        if np.isfinite(sigma).all():
            return models.Diagonal.Sigmas(sigma)
        return models.Gaussian.SqrtInformation(np.diag(1 / sigma))
