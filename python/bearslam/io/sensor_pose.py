# SPDX-License-Identifier: MIT OR Apache-2.0
"""The pose of the sensor on the vehicle: problems converted from the frame of the vehicle to that of the sensor."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from bearslam.data.align import wrap
from bearslam.data.checks import FloatArray, check_turn, floats
from bearslam.data.maps import Map
from bearslam.data.priors import Odometry, PosePriors
from bearslam.data.problem import Problem
from bearslam.data.sightings import Offsets, Sightings
from bearslam.errors import InvalidInputError

__all__ = ["in_sensor_frame"]


def in_sensor_frame(problem: Problem, sensor: ArrayLike) -> Problem:
    """Convert a problem whose views are poses of the vehicle to one whose views are poses of the sensor.

    A bearing computed in the frame of the vehicle is not the one at which the sensor saw the landmark, but with a range
    the latter can be restored. Views become poses of the sensor, offsets and bearings those that it measured, and
    motions and priors on poses, with their covariances, those of the sensor.

    Parameters
    ----------
    problem : Problem
        Problem in the frame of the vehicle.
    sensor : (2,) or (3,) array_like of float
        Pose (x, y) or (x, y, theta) of the sensor in the frame of the vehicle [length, rad].

    Returns
    -------
    Problem
        Problem in the frame of the sensor.

    Raises
    ------
    InvalidInputError
        If there are bearings without a range, unless the sensor is only rotated; if a prior covers some coordinates of
        a pose only; or if a landmark coincides with the sensor.
    """
    pose = floats("sensor", sensor, ("2 or 3",))
    if pose.shape not in ((2,), (3,)):
        raise InvalidInputError(f"sensor: expected x, y and, if it is rotated, theta, got {len(pose)} numbers")
    check_turn("sensor", pose[2:], expected="a heading in radians within one turn")
    place, turn = pose[:2], float(pose[2]) if len(pose) == 3 else 0.0
    seen, offsets = problem.sightings, problem.offsets
    bearing = seen.bearing - turn
    sigma = seen.sigma
    if place.any() and (offsets is None or len(offsets) < len(seen)):
        raise InvalidInputError(
            f"sensor: expected ranges with all {len(seen)} bearings, got {0 if offsets is None else len(offsets)}: "
            "without one a bearing cannot be converted to the sensor"
        )
    if offsets is not None:
        position = (offsets.position - place) @ _rotation(turn)
        if not position.any(axis=1).all():
            raise InvalidInputError("sensor: a landmark coincides with the sensor")
        offsets = Offsets(
            offsets.sighting,
            position,
            _carried(offsets.sigma, np.broadcast_to(_rotation(turn).T, (len(offsets), 2, 2))),
        )
        bearing[offsets.sighting] = offsets.bearing
        if sigma is not None:
            sigma = sigma.copy()
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                sigma[offsets.sighting] = offsets.bearing_sigma
    start = problem.start
    return Problem(
        Sightings(seen.view, seen.landmark, bearing, sigma),
        problem.view_ids,
        problem.landmark_ids,
        odometry=None if problem.odometry is None else _motions(problem.odometry, place, turn),
        pose_priors=None if problem.pose_priors is None else _known(problem.pose_priors, place, turn),
        landmark_priors=problem.landmark_priors,
        start=None if start is None else Map(_moved(start.poses, place, turn), start.landmarks),
        fixed_views=problem.fixed_views,
        fixed_landmarks=problem.fixed_landmarks,
        offsets=offsets,
        remarks=problem.remarks,
        others=problem.others,
    )


def _motions(odometry: Odometry, place: FloatArray, turn: float) -> Odometry:
    """Motions of the sensor from those of the vehicle."""
    end = _moved(odometry.delta, place, turn)
    delta = np.column_stack([(end[:, :2] - place) @ _rotation(turn), odometry.delta[:, 2]])
    # Adjoint: a small motion of the vehicle, in its frame, as one of the sensor in its own.
    adjoint = np.eye(3)
    adjoint[:2, :2] = _rotation(turn).T
    adjoint[:2, 2] = _rotation(turn).T @ [-place[1], place[0]]
    return Odometry(
        odometry.start,
        odometry.end,
        delta,
        _carried(odometry.sigma, np.broadcast_to(adjoint, (len(odometry), 3, 3))),
    )


def _known(priors: PosePriors, place: FloatArray, turn: float) -> PosePriors:
    pose = _moved(priors.pose, place, turn)
    sigma = priors.sigma
    if place.any():
        jacobian = np.tile(np.eye(3), (len(priors), 1, 1))
        jacobian[:, :2, 2] = pose[:, :2] - priors.pose[:, :2]
        jacobian[:, :2, 2] = jacobian[:, :2, 2][:, ::-1] * [-1, 1]
        lost = np.isinf(sigma) if sigma.ndim == 2 else np.zeros(len(priors), dtype=bool)[:, None]
        compass = lost[:, :2].all(axis=1)
        if (lost.any(axis=1) & ~compass).any() or (compass.any() and not compass.all()):
            raise InvalidInputError("sensor: expected priors on all coordinates of poses, or on the headings of all")
        if not compass.all():
            sigma = _carried(sigma, jacobian)
    return PosePriors(priors.view, pose, sigma)


def _moved(poses: FloatArray, place: FloatArray, turn: float) -> FloatArray:
    """Poses of the sensor from poses of the vehicle."""
    heading = poses[:, 2]
    cosine, sine = np.cos(heading), np.sin(heading)
    x, y = place
    turned = wrap(heading + turn) if turn else heading
    return np.column_stack([poses[:, :2] + np.column_stack([cosine * x - sine * y, sine * x + cosine * y]), turned])


def _carried(sigma: FloatArray, jacobians: FloatArray) -> FloatArray:
    """Covariances propagated through a linear map; standard deviations that it does not change are kept."""
    if sigma.ndim == 2:
        size = sigma.shape[1]
        if (jacobians == np.eye(size)).all() or (size == 2 and (sigma[:, 0] == sigma[:, 1]).all()):
            return sigma
        sigma = sigma[:, :, None] ** 2 * np.eye(size)
    carried: FloatArray = jacobians @ sigma @ jacobians.transpose(0, 2, 1)
    return (carried + carried.transpose(0, 2, 1)) / 2


def _rotation(turn: float) -> FloatArray:
    cosine, sine = math.cos(turn), math.sin(turn)
    return np.array([[cosine, -sine], [sine, cosine]])
