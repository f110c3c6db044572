# SPDX-License-Identifier: MIT OR Apache-2.0
"""Whether a map that is said to have converged is a minimum: what a Gauss-Newton step would gain."""

from __future__ import annotations

from typing import Any

import numpy as np

from .measure import Request

SMALLEST = 1e-6
"""Singular values below this share of the largest, of columns of unit length, are left out: rounding decides there."""


def gain(request: Request, result: Any, residual: Any, least: float) -> float:
    """Decrease of the cost that a step in the determined directions promises, as a share of the cost.

    A gain below `least` may be an upper bound instead, which takes less time.
    """
    views, landmarks = result.poses.shape[0], result.landmarks.shape[0]
    rows, values = _of_bearings(request, result, residual)
    for kind, place, value, root in request.priors:
        row, error = _of_prior(kind, place, value, result, 3 * views + 2 * landmarks)
        if np.isfinite(error).all():
            rows = np.concatenate([rows, root @ row])
            values = np.concatenate([values, root @ error])
    lengths = np.linalg.norm(rows, axis=0)
    if not (np.isfinite(lengths).all() and np.isfinite(values).all() and lengths.any()):
        return 0.0
    scaled = rows[:, lengths > 0] / lengths[lengths > 0]
    cost = max(result.cost, 1e-300)
    # The gradient along a singular vector over its singular value is what the values have along it. With columns of
    # unit length the largest singular value is at least 1.
    most = float(((scaled.T @ values) ** 2).sum() / 2 / SMALLEST**2 / cost)
    if most < least:
        return most
    left, sizes, _ = np.linalg.svd(scaled, full_matrices=False)
    used = left[:, sizes > SMALLEST * sizes[0]]
    return float(((used.T @ values) ** 2).sum() / 2 / cost)


def _of_bearings(request: Request, result: Any, residual: Any) -> tuple[Any, Any]:
    """Rows and residuals of the bearings, over sigma and times the root of the slope of the loss, (T12)."""
    known = np.flatnonzero(np.isfinite(residual))
    view, landmark = request.view[known], request.landmark[known]
    ratio = residual[known] / request.sigma[known]
    root = np.sqrt(_slope(request, ratio**2))
    weight = root / request.sigma[known]
    offset = result.landmarks[landmark] - result.poses[view, :2]
    gradient = np.stack([-offset[:, 1], offset[:, 0]], axis=1) / (offset**2).sum(axis=1)[:, None] * weight[:, None]
    count = 3 * len(result.poses)
    rows = np.zeros((len(known), count + 2 * len(result.landmarks)))
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


def _of_prior(kind: str, place: tuple[int, ...], value: Any, result: Any, width: int) -> tuple[Any, Any]:
    """Derivatives and residual of odometry or a prior, (T25), not whitened."""
    row = np.zeros((len(value), width))
    if kind == "landmark":
        column = 3 * len(result.poses) + 2 * place[0]
        row[:, column : column + 2] = np.eye(2)
        return row, result.landmarks[place[0]] - value
    if kind == "pose":
        row[:, 3 * place[0] : 3 * place[0] + 3] = np.eye(3)
        error = result.poses[place[0]] - value
        return row, np.append(error[:2], np.angle(np.exp(1j * error[2])))
    first, last = (result.poses[k] for k in place)
    angle = first[2] + value[2]
    back = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    step = last[:2] - first[:2]
    row[:2, 3 * place[1] : 3 * place[1] + 2] = back
    row[:2, 3 * place[0] : 3 * place[0] + 2] = -back
    row[:2, 3 * place[0] + 2] = back @ [step[1], -step[0]]
    row[2, 3 * place[1] + 2], row[2, 3 * place[0] + 2] = 1.0, -1.0
    c, s = np.cos(value[2]), np.sin(value[2])
    there = [c * value[0] + s * value[1], c * value[1] - s * value[0]]
    return row, np.append(back @ step - there, np.angle(np.exp(1j * (last[2] - first[2] - value[2]))))
