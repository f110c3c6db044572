# SPDX-License-Identifier: MIT OR Apache-2.0
"""Whether a map that is said to have converged is a minimum: whether steps from it lower the cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from . import measure
from .measure import Request

SMALLEST = 1e-6
"""Singular values below this share of the largest, of columns of unit length, are left out: rounding decides there."""
STEPS = 1000
"""Steps that are tried. In a direction that is hardly determined the cost is quadratic for no more than a short one."""
MOST = 1e8
"""Damping beyond which no step is tried."""


@dataclass
class Place:
    """A map."""

    poses: Any
    landmarks: Any


def gain(request: Request, result: Any, least: float) -> float:
    """Decrease of the cost that a step in the determined directions promises, as a share of the cost.

    A gain below `least` may be an upper bound instead, which takes less time.
    """
    model = _Model.of(request, Place(result.poses, result.landmarks))
    if model is None:
        return 0.0
    cost = max(result.cost, 1e-300)
    # The gradient along a singular vector over its singular value is what the values have along it. With columns of
    # unit length the largest singular value is at least 1.
    most = float(((model.scaled.T @ model.values) ** 2).sum() / 2 / SMALLEST**2 / cost)
    if most < least:
        return most
    _, sizes, along = model.decomposed()
    return float((along[sizes > SMALLEST * sizes[0]] ** 2).sum() / 2 / cost)


def decrease(request: Request, result: Any, least: float) -> float:
    """Decrease of the cost by Levenberg-Marquardt steps from a map, as a share of it, until it is `least`."""
    place, damping = Place(result.poses, result.landmarks), SMALLEST**2
    # With outliers a component counts what it leaves out in its own way.
    start = cost = _cost(request, place) if request.robust else result.cost
    for _ in range(STEPS):
        model = _Model.of(request, place)
        if model is None:
            break
        right, sizes, along = model.decomposed()
        while damping < MOST:
            trial = model.after(right @ (-sizes / (sizes**2 + damping) * along))
            lower = _cost(request, trial)
            if lower < cost:
                break
            damping *= 10
        else:
            break
        place, cost, damping = trial, lower, damping / 10
        if start - cost >= least * result.cost:
            break
    return float((start - cost) / max(result.cost, 1e-300))


@dataclass
class _Model:
    """Residuals of a map linearised, with columns of unit length; those on which nothing depends are left out."""

    place: Place
    scaled: Any
    lengths: Any
    values: Any

    @classmethod
    def of(cls, request: Request, place: Place) -> _Model | None:
        views, landmarks = len(place.poses), len(place.landmarks)
        rows, values = _of_bearings(request, place)
        for kind, ends, value, root in request.priors:
            row, error = _of_prior(kind, ends, value, place, 3 * views + 2 * landmarks)
            if np.isfinite(error).all():
                rows = np.concatenate([rows, root @ row])
                values = np.concatenate([values, root @ error])
        lengths = np.linalg.norm(rows, axis=0)
        if not (np.isfinite(lengths).all() and np.isfinite(values).all() and lengths.any()):
            return None
        return cls(place, rows[:, lengths > 0] / lengths[lengths > 0], lengths, values)

    def decomposed(self) -> tuple[Any, Any, Any]:
        """The right singular vectors, the singular values, and what the values have along the left ones."""
        left, sizes, right = np.linalg.svd(self.scaled, full_matrices=False)
        return right.T, sizes, left.T @ self.values

    def after(self, step: Any) -> Place:
        """The map after a step in the scaled parameters."""
        whole = np.zeros(len(self.lengths))
        whole[self.lengths > 0] = step / self.lengths[self.lengths > 0]
        poses, landmarks = self.place.poses, self.place.landmarks
        count = poses.size
        return Place(poses + whole[:count].reshape(poses.shape), landmarks + whole[count:].reshape(landmarks.shape))


def _cost(request: Request, place: Place) -> float:
    residual, rounding = measure.residuals(request, place.poses, place.landmarks)
    bearings, _ = measure.cost_of_bearings(request, residual, rounding)
    return bearings + measure.cost_of_priors(request, place.poses, place.landmarks)[0]


def _of_bearings(request: Request, place: Place) -> tuple[Any, Any]:
    """Rows and residuals of the bearings, over sigma and times the root of the slope of the loss, (T12)."""
    residual, _ = measure.residuals(request, place.poses, place.landmarks)
    known = np.flatnonzero(np.isfinite(residual))
    view, landmark = request.view[known], request.landmark[known]
    ratio = residual[known] / request.sigma[known]
    root = np.sqrt(_slope(request, ratio**2))
    weight = root / request.sigma[known]
    offset = place.landmarks[landmark] - place.poses[view, :2]
    gradient = np.stack([-offset[:, 1], offset[:, 0]], axis=1) / (offset**2).sum(axis=1)[:, None] * weight[:, None]
    count = 3 * len(place.poses)
    rows = np.zeros((len(known), count + 2 * len(place.landmarks)))
    every = np.arange(len(known))
    for axis in range(2):
        rows[every, 3 * view + axis] = -gradient[:, axis]
        rows[every, count + 2 * landmark + axis] = gradient[:, axis]
    rows[every, 3 * view + 2] = -weight
    return rows, ratio * root


def _slope(request: Request, square: Any) -> Any:
    """Derivative of the loss by the square."""
    c = request.width
    if request.robust:
        return (square <= 9.0).astype(float)
    match request.loss:
        case "huber":
            return np.minimum(1.0, c / np.sqrt(np.maximum(square, 1e-300)))
        case "cauchy":
            return 1 / (1 + square / (c * c))
        case "truncated":
            return (square <= c * c).astype(float)
    return np.ones_like(square)


def _of_prior(kind: str, ends: tuple[int, ...], value: Any, place: Place, width: int) -> tuple[Any, Any]:
    """Derivatives and residual of odometry or a prior, (T25), not whitened."""
    row = np.zeros((len(value), width))
    if kind == "landmark":
        column = 3 * len(place.poses) + 2 * ends[0]
        row[:, column : column + 2] = np.eye(2)
        return row, place.landmarks[ends[0]] - value
    if kind == "pose":
        row[:, 3 * ends[0] : 3 * ends[0] + 3] = np.eye(3)
        error = place.poses[ends[0]] - value
        return row, np.append(error[:2], np.angle(np.exp(1j * error[2])))
    first, last = (place.poses[k] for k in ends)
    angle = first[2] + value[2]
    back = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    step = last[:2] - first[:2]
    row[:2, 3 * ends[1] : 3 * ends[1] + 2] = back
    row[:2, 3 * ends[0] : 3 * ends[0] + 2] = -back
    row[:2, 3 * ends[0] + 2] = back @ [step[1], -step[0]]
    row[2, 3 * ends[1] + 2], row[2, 3 * ends[0] + 2] = 1.0, -1.0
    c, s = np.cos(value[2]), np.sin(value[2])
    there = [c * value[0] + s * value[1], c * value[1] - s * value[0]]
    return row, np.append(back @ step - there, np.angle(np.exp(1j * (last[2] - first[2] - value[2]))))
