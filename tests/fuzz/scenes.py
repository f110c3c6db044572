# SPDX-License-Identifier: MIT OR Apache-2.0
"""Scenes: robots, landmarks, and who sees what at which bearing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .dice import Dice

LAYOUTS = {
    "open": 6,
    "enclosed": 3,
    "path": 4,
    "loop": 2,
    "standing": 2,
    "wall": 2,
    "corridor": 1.5,
    "circle": 0.7,
    "line": 1,
    "one_place": 0.7,
    "two_places": 1,
    "far": 1,
}
"""How often robots and landmarks are where."""


@dataclass
class Scene:
    """Poses (m, 3), landmarks (n, 2) and the robot of each view; bearings (m, n), NaN where not seen."""

    poses: Any
    landmarks: Any
    robots: Any
    bearings: Any
    noise: float
    layout: str


def wrap(angle: Any) -> Any:
    """Angles in (-pi, pi]."""
    return np.pi - np.mod(np.pi - angle, 2 * np.pi)


def draw(dice: Dice) -> Scene:
    """A random scene, most of them small."""
    layout = dice.weighted(LAYOUTS)
    views, landmarks = _size(dice)
    robots = np.sort(dice.numbers.integers(dice.weighted({1: 6, 2: 2, 3: 1}), size=views))
    points = _landmarks(dice, layout, landmarks)
    poses = _poses(dice, layout, views, robots)
    if dice.chance(0.1):
        _similarity(dice, poses, points)
    noise = 0.0 if dice.chance(0.25) else dice.power(-4, -1.3)
    offset = points[None] - poses[:, None, :2]
    bearings = wrap(np.arctan2(offset[..., 1], offset[..., 0]) - poses[:, 2:])
    bearings = bearings + noise * dice.normal(views, landmarks)
    _hide(dice, layout, bearings, np.hypot(offset[..., 0], offset[..., 1]), robots)
    if dice.chance(0.15):
        _spoil(dice, bearings)
    return Scene(poses, points, robots, wrap(bearings), noise, layout)


SIZES = {
    "few": (7, (3, 6), (4, 9)),
    "tiny": (1, (1, 5), (1, 6)),
    "four": (0.6, (3, 8), (4, 4)),
    "some": (0.35, (5, 14), (4, 20)),
    "many": (0.02, (15, 80), (8, 40)),
}
"""How often scenes have so many views and landmarks. With many, a call takes a hundred times longer than with few."""


def _size(dice: Dice) -> tuple[int, int]:
    _, views, landmarks = SIZES[dice.weighted({kind: share for kind, (share, _, _) in SIZES.items()})]
    return dice.whole(*views), dice.whole(*landmarks)


def _landmarks(dice: Dice, layout: str, count: int) -> Any:
    points = dice.numbers.uniform([0, 0], [7, 5], (count, 2))
    across = dice.numbers.integers(2, size=count).astype(bool)
    if layout == "enclosed":
        points[across, 0] = np.round(points[across, 0] / 7) * 7
        points[~across, 1] = np.round(points[~across, 1] / 5) * 5
    elif layout == "wall":
        points[:, 1] = 5.0 + dice.pick([0.0, 0.0, 1e-6, 1e-2]) * dice.normal(count)
    elif layout == "corridor":
        points *= [6, 1]
        points[:, 1] = np.where(across, -1.0, 1.0) * dice.real(0.5, 2)
    elif layout == "circle":
        angle = dice.numbers.uniform(0, 2 * np.pi, count)
        points = 3 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    elif layout == "far":
        points[: 1 + count // 4] *= dice.power(1, 7)
    elif layout == "two_places":
        points[count // 2 :] += 20.0
    return points


def _poses(dice: Dice, layout: str, count: int, robots: Any) -> Any:
    poses = np.column_stack(
        [dice.numbers.uniform([0, 0], [7, 5], (count, 2)), dice.numbers.uniform(-np.pi, np.pi, count)]
    )
    if layout in ("path", "corridor", "standing"):
        for robot in np.unique(robots):
            own = np.flatnonzero(robots == robot)
            poses[own] = _drive(dice, len(own), layout)
    elif layout == "loop":
        angle = np.arange(count) * 2 * np.pi / max(count, 1)
        poses = np.column_stack([3.5 + 2 * np.cos(angle), 2.5 + 2 * np.sin(angle), wrap(angle + np.pi / 2)])
    elif layout == "circle":
        angle = dice.numbers.uniform(0, 2 * np.pi, count)
        radius = dice.pick([1.5, 3.0])
        poses[:, :2] = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    elif layout == "line":
        poses[:, 1] = 2.0 + dice.pick([0.0, 1e-6, 1e-3]) * dice.normal(count)
    elif layout == "one_place":
        poses[count // 2 :, :2] = poses[0, :2]
    elif layout == "two_places":
        poses[count // 2 :, :2] += 20.0
    return poses


def _drive(dice: Dice, count: int, layout: str) -> Any:
    """A trajectory, on which the robot may stand, turn in place or creep."""
    heading = dice.real(-np.pi, np.pi) + np.cumsum(0.3 * dice.normal(count))
    step = np.full(count, 0.8)
    if layout == "standing":
        step *= dice.numbers.random(count) < 0.5
        step += dice.pick([0.0, 0.0, 1e-4])
    if layout == "corridor":
        heading = 0.1 * dice.normal(count)
    path = np.cumsum(step[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
    return np.column_stack([path + dice.numbers.uniform([0, 0], [4, 3]), wrap(heading)])


def _similarity(dice: Dice, poses: Any, points: Any) -> None:
    """Another unit of length, and another place far from the origin."""
    scale, shift = dice.power(-4, 5), dice.pick([0.0, 1.0, 1e4]) * dice.normal(2)
    poses[:, :2] = scale * (poses[:, :2] + shift)
    points[:] = scale * (points + shift)


def _hide(dice: Dice, layout: str, bearings: Any, ranges: Any, robots: Any) -> None:
    """Remove what is not seen."""
    kind = dice.weighted({"all": 5, "some": 3, "range": 2, "apart": 0.5})
    if kind == "some":
        bearings[dice.numbers.random(bearings.shape) > dice.real(0.4, 0.97)] = np.nan
    elif kind == "range":
        bearings[ranges > np.quantile(ranges, dice.real(0.3, 0.9))] = np.nan
    elif kind == "apart":
        bearings[: len(bearings) // 2, bearings.shape[1] // 2 :] = np.nan
        bearings[len(bearings) // 2 :, : bearings.shape[1] // 2] = np.nan
    elif layout == "two_places":
        bearings[ranges > 15] = np.nan
    if dice.chance(0.03):
        bearings[dice.whole(0, len(bearings) - 1)] = np.nan
    if dice.chance(0.03):
        bearings[:, dice.whole(0, bearings.shape[1] - 1)] = np.nan


def _spoil(dice: Dice, bearings: Any) -> None:
    """Outliers: exchanged identities, bearings off by pi, random bearings."""
    share = dice.pick([0.02, 0.1, 0.3, 0.6])
    for view, landmark in np.argwhere(dice.numbers.random(bearings.shape) < share):
        kind = dice.pick(["exchange", "pi", "random"])
        if kind == "exchange":
            other = dice.whole(0, bearings.shape[1] - 1)
            pair = bearings[view, [landmark, other]]
            bearings[view, [other, landmark]] = pair
        elif kind == "pi":
            bearings[view, landmark] += np.pi
        elif not np.isnan(bearings[view, landmark]):
            bearings[view, landmark] = dice.real(-np.pi, np.pi)
