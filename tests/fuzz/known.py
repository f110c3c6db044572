# SPDX-License-Identifier: MIT OR Apache-2.0
"""What is known besides bearings: odometry, priors on poses and landmarks, and how well."""

from __future__ import annotations

from typing import Any

import numpy as np

from .dice import Dice
from .scenes import Scene, wrap

Arrays = dict[str, Any]


def odometry(dice: Dice, scene: Scene) -> Arrays | None:
    """Motions along each robot, some of them missing or repeated; good, poor, or of another scale."""
    pairs = [
        (int(view), int(view) + 1)
        for view in range(len(scene.robots) - 1)
        if scene.robots[view] == scene.robots[view + 1]
    ]
    if len(scene.robots) > 2 and dice.chance(0.2):
        pairs += [(first, second) for first, second in (_pair(dice, len(scene.robots)) for _ in range(2))]
    keep = dice.pick([1.0, 1.0, 1.0, 0.8, 0.4])
    pairs = [pair for pair in pairs if dice.chance(keep)]
    if not pairs:
        return None
    start, end = np.array(pairs).T
    size = _size(scene)
    x, y, theta = (scene.poses[end] - scene.poses[start]).T
    c, s = np.cos(scene.poses[start, 2]), np.sin(scene.poses[start, 2])
    delta = np.column_stack([c * x + s * y, c * y - s * x, wrap(theta)])
    sigma = np.array([0.01 * size, 0.01 * size, 0.01]) * dice.pick([0.1, 1, 1, 1, 5, 30])
    quality = dice.weighted({"good": 5, "exact": 1, "poor": 2, "scaled": 1, "useless": 0.5})
    error = {"good": 1.0, "poor": dice.real(2, 10), "useless": 50.0}.get(quality, 0.0)
    delta += error * sigma * dice.normal(len(delta), 3)
    if quality == "scaled":
        delta[:, :2] *= dice.power(-1, 1)
    return {"start": start, "end": end, "delta": delta, "sigma": noise(dice, sigma, len(delta))}


def pose_priors(dice: Dice, scene: Scene) -> Arrays | None:
    """Priors on all of a pose, on its position, its heading, or one coordinate."""
    view = dice.subset(len(scene.poses), dice.pick([0.2, 0.5, 1.0]))
    if len(view) == 0:
        return None
    sigma = np.array([0.02 * _size(scene), 0.02 * _size(scene), 0.02]) * dice.pick([1e-3, 0.1, 1, 1, 10])
    parts = dice.weighted({"all": 4, "position": 3, "heading": 3, "x": 1, "none": 0.2})
    known = {"all": (1, 1, 1), "position": (1, 1, 0), "heading": (0, 0, 1), "x": (1, 0, 0), "none": (0, 0, 0)}[parts]
    pose = scene.poses[view] + dice.pick([0.0, 1.0, 1.0, 8.0]) * sigma * dice.normal(len(view), 3)
    if parts == "all" and dice.chance(0.5):
        return {"view": view, "pose": pose, "sigma": noise(dice, sigma, len(view))}
    each = np.where(known, sigma, np.inf)
    if dice.chance(0.3):
        each = np.where(dice.numbers.random((len(view), 3)) < 0.7, each, np.inf)
    if dice.chance(0.05):
        view = np.append(view, view[0])
        pose = np.append(pose, pose[:1], axis=0)
        each = np.broadcast_to(each, (len(view) - 1, 3))
        each = np.append(each, each[:1], axis=0)
    return {"view": view, "pose": pose, "sigma": each}


def landmark_priors(dice: Dice, scene: Scene) -> Arrays | None:
    """Known landmarks, mostly a few."""
    landmark = dice.subset(len(scene.landmarks), dice.pick([0.2, 0.4, 1.0]))
    if len(landmark) == 0:
        return None
    sigma = np.full(2, 0.01 * _size(scene)) * dice.pick([1e-4, 0.1, 1, 1, 10])
    position = scene.landmarks[landmark] + dice.pick([0.0, 1.0, 1.0, 8.0]) * sigma * dice.normal(len(landmark), 2)
    each = float(sigma[0]) if dice.chance(0.3) else noise(dice, sigma, len(landmark))
    return {"landmark": landmark, "position": position, "sigma": each}


def noise(dice: Dice, sigma: Any, count: int) -> Any:
    """Standard deviations for all, for each, or covariances, some of them nearly singular."""
    kind = dice.weighted({"all": 3, "each": 3, "covariance": 2, "extreme": 0.3})
    if kind == "all":
        return sigma
    each = sigma * np.exp(0.5 * dice.normal(count, len(sigma)))
    if kind == "each":
        return each
    if kind == "extreme":
        return each * 10.0 ** dice.numbers.uniform(-12, 12, each.shape)
    mixing = np.eye(len(sigma)) + dice.pick([0.0, 0.3, 3.0]) * dice.normal(count, len(sigma), len(sigma))
    factor = each[:, :, None] * mixing
    covariance = factor @ factor.transpose(0, 2, 1)
    return (covariance + covariance.transpose(0, 2, 1)) / 2


def start(dice: Dice, scene: Scene) -> tuple[Any, Any]:
    """A start of the refinement: near the truth or garbage, whole or in part."""
    poses, points, size = scene.poses.copy(), scene.landmarks.copy(), _size(scene)
    kind = dice.weighted({"truth": 2, "near": 5, "rough": 2, "garbage": 1.5, "collapsed": 0.5})
    error = {"truth": 0.0, "near": 0.03, "rough": 0.3, "garbage": 3.0, "collapsed": 0.0}[kind]
    poses += error * np.array([size, size, 1.0]) * dice.normal(len(poses), 3)
    points += error * size * dice.normal(len(points), 2)
    if kind == "collapsed":
        points[:] = poses[0, :2]
        poses[dice.subset(len(poses), 0.7)] = poses[0]
    if dice.chance(0.25):
        poses[dice.subset(len(poses), 0.2)] = np.nan
        points[dice.subset(len(points), 0.2)] = np.nan
    if dice.chance(0.05):
        poses[dice.whole(0, len(poses) - 1), dice.whole(0, 2)] = np.nan
    return poses, points


def _size(scene: Scene) -> float:
    """Typical length of the scene."""
    return float(np.median(np.abs(scene.landmarks - np.median(scene.landmarks, axis=0)))) + 1e-3


def _pair(dice: Dice, count: int) -> tuple[int, int]:
    first, second = dice.numbers.choice(count, 2, replace=False)
    return int(first), int(second)
