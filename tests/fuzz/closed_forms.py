# SPDX-License-Identifier: MIT OR Apache-2.0
"""Checks of the closed forms: three views, resection, triangulation, alignment."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from .maps import Fault
from .measure import EPS, turn

Arguments = dict[str, Any]


def align(arguments: Arguments, answer: Any) -> Iterator[Fault]:
    """Umeyama's similarity in the complex plane, (T21)."""
    x, y = (np.asarray(arguments[name], dtype=float) @ [1, 1j] for name in ("source", "target"))
    around, about = x - x.mean(), y - y.mean()
    square, product = np.vdot(around, around).real, np.vdot(around, about)
    size = np.sqrt(square * np.vdot(about, about).real)
    if not (size > 0 and np.isfinite(size) and abs(product) > 1e-6 * size and square > 1e-8 * np.vdot(x, x).real):
        return
    scale = product / square
    found = answer.scale * np.exp(1j * answer.angle)
    shift = y.mean() - scale * x.mean()
    allowed = 1e-8 * (abs(scale) * np.abs(x).max() + np.abs(y).max()) * size / abs(product)
    if abs(found - scale) > 1e-8 * abs(scale) * size / abs(product):
        yield "align", f"{found}, expected {scale}"
    if abs(answer.translation @ [1, 1j] - shift) > allowed:
        yield "align", f"translation {answer.translation}, expected {shift}"


def _residuals(poses: Any, points: Any, bearings: Any) -> tuple[Any, Any, Any]:
    """Residuals, offsets and squared distances."""
    offset = points - poses[..., :2]
    residual = turn(offset, poses[..., 2], bearings)
    return residual, offset, (offset**2).sum(axis=-1)


def _fix(value: Any, residual: Any, rows: Any, sigma: float, of: Any) -> Iterator[Fault]:
    """Covariance, rms and sigma0 of one fix from its residuals and the rows of its Jacobian."""
    covariance, rms, sigma0 = of
    count, unknowns = rows.shape
    scale = np.linalg.norm(rows, axis=0)
    values = np.linalg.svd(rows / scale, compute_uv=False)
    # Landmarks on one circle with the view, and rays that are parallel, have no covariance, nor have derivatives whose
    # squares overflow: then there is nothing but the value.
    least = values[-1] if np.isfinite(((rows / sigma) ** 2).sum() * count) else 0.0
    if least < 1e-6 and np.isnan([rms, sigma0]).all() and np.isnan(covariance).all():
        return
    square = float((residual**2).sum())
    if not np.isclose(rms, np.sqrt(square / count), rtol=1e-5, atol=1e-9):
        yield "fix", f"rms {rms!r}, expected {np.sqrt(square / count)!r}"
    if count > unknowns:
        expected = np.sqrt(square / (count - unknowns)) / sigma
        if not np.isclose(sigma0, expected, rtol=1e-5, atol=1e-9 / sigma):
            yield "fix", f"sigma0 {sigma0!r}, expected {expected!r}"
    elif not np.isnan(sigma0):
        yield "fix", f"sigma0 {sigma0!r} without redundancy"
    if not values[-1] > 1e-4 or not np.isfinite(value).all():
        return
    expected = sigma**2 * np.linalg.inv((rows / scale).T @ (rows / scale)) / np.outer(scale, scale)
    if not np.allclose(covariance, expected, rtol=1e-4, atol=1e-5 * np.sqrt(np.outer(*[np.diag(expected)] * 2)).max()):
        yield "fix", f"covariance {covariance.tolist()}, expected {expected.tolist()}"


def _parts(answer: Any, detailed: bool, single: bool) -> tuple[Any, list[Any]]:
    """Values and details, one per row."""
    value = answer.value if detailed else answer
    rows = value[None] if single else value
    if not detailed:
        return rows, []
    if single:
        return rows, [(answer.covariance, answer.rms, answer.sigma0)]
    return rows, list(zip(answer.covariance, answer.rms, answer.sigma0, strict=True))


def triangulate(arguments: Arguments, answer: Any) -> Iterator[Fault]:
    """Residuals and covariances at the positions; rays that point to them; the truth from exact bearings."""
    poses, table = np.asarray(arguments["poses"], dtype=float), np.asarray(arguments["bearings"], dtype=float)
    columns = table[:, None] if table.ndim == 1 else table
    detailed, sigma = arguments.get("details", False), arguments.get("sigma", 1.0)
    values, details = _parts(answer, detailed, table.ndim == 1)
    for j, point in enumerate(values):
        if np.isnan(point).any():
            if not np.isnan(point).all():
                yield "values", f"landmark {j} is {point}"
            continue
        seen = ~np.isnan(columns[:, j])
        residual, offset, square = _residuals(poses[seen], point, columns[seen, j])
        if seen.sum() < 2:
            yield "triangulate", f"landmark {j} from {seen.sum()} rays"
        if seen.sum() == 2 and np.abs(residual).max() > np.pi / 2 and square.min() > 1e-18 * np.abs(poses).max() ** 2:
            yield "triangulate", f"landmark {j} is behind a view: residuals {residual.tolist()}"
        if details and square.min() > 1e4 * EPS**2 * np.abs(poses).max() ** 2:
            rows = np.stack([-offset[:, 1], offset[:, 0]], axis=1) / square[:, None]
            size = np.abs(poses).max() + np.abs(point).max()
            if np.sqrt(square.min()) > 1e-5 * size:
                yield from _fix(point, residual, rows, sigma, details[j])


def resect(arguments: Arguments, answer: Any) -> Iterator[Fault]:
    """Residuals and covariances at the poses."""
    points, table = np.asarray(arguments["landmarks"], dtype=float), np.asarray(arguments["bearings"], dtype=float)
    rows = table[None] if table.ndim == 1 else table
    detailed, sigma = arguments.get("details", False), arguments.get("sigma", 1.0)
    values, details = _parts(answer, detailed, table.ndim == 1)
    for i, pose in enumerate(values):
        if np.isnan(pose).any():
            if not np.isnan(pose).all():
                yield "values", f"pose {i} is {pose}"
            continue
        seen = ~np.isnan(rows[i])
        if seen.sum() < 3:
            yield "resect", f"view {i} from {seen.sum()} landmarks"
        if not abs(pose[2]) <= np.pi:
            yield "values", f"heading {pose[2]!r}"
        residual, offset, square = _residuals(pose, points[seen], rows[i, seen])
        size = np.abs(points[seen]).max() + np.abs(pose[:2]).max()
        if details and np.sqrt(square.min()) > 1e-5 * size:
            gradient = np.stack([offset[:, 1], -offset[:, 0]], axis=1) / square[:, None]
            jacobian = np.column_stack([gradient, -np.ones(len(gradient))])
            yield from _fix(pose, residual, jacobian, sigma, details[i])


def three_view(arguments: Arguments, answer: Any) -> Iterator[Fault]:
    """Cost and cheirality at the solutions, and their frame and order."""
    bearings = np.asarray(arguments["bearings"], dtype=float)
    if not 1 <= len(answer) <= 2:
        yield "three_view", f"{len(answer)} solutions"
    keys = [(one.inconsistent, one.cost) for one in answer]
    if keys != sorted(keys):
        yield "three_view", f"not in order: {keys}"
    for one in answer:
        yield from _solution(bearings, one.poses, one.landmarks, one.inconsistent, one.cost)


def three_view_batch(arguments: Arguments, answer: Any) -> Iterator[Fault]:
    """The same for each problem of a batch."""
    for k, bearings in enumerate(np.asarray(arguments["bearings"], dtype=float)):
        for which in range(2):
            poses, points = answer.poses[k, which], answer.landmarks[k, which]
            inconsistent, cost = answer.inconsistent[k, which], answer.cost[k, which]
            if inconsistent < 0:
                if not (np.isnan(poses).all() and np.isnan(points).all() and np.isnan(cost)):
                    yield "three_view", f"problem {k} has no solution {which}, but numbers"
                continue
            yield from _solution(bearings, poses, points, inconsistent, cost)


def _solution(bearings: Any, poses: Any, points: Any, inconsistent: int, cost: float) -> Iterator[Fault]:
    if not (np.isfinite(poses).all() and np.isfinite(cost)):
        yield "three_view", f"poses {poses.tolist()}, cost {cost}"
        return
    if np.any(poses[0] != 0) or abs(np.hypot(*poses[1, :2]) - 1) > 1e-9:
        yield "three_view", f"poses {poses.tolist()} are not in their frame"
    known = np.isfinite(points).all(axis=1)
    residual, _, square = _residuals(poses[:, None], points[known][None], bearings[:, known])
    size = np.abs(points[known]).max(initial=1.0)
    near = np.sqrt(square) < 1e-6 * size
    if known.all() and not near.any():
        expected = float((residual**2).sum() / 2)
        if not np.isclose(cost, expected, rtol=1e-6, atol=1e-9):
            yield "three_view", f"cost {cost!r}, expected {expected!r}"
        behind = int((np.abs(residual) > np.pi / 2).sum())
        close = int((np.abs(np.abs(residual) - np.pi / 2) < 1e-6).sum())
        if abs(behind - inconsistent) > close:
            yield "three_view", f"{inconsistent} inconsistent, expected {behind}"


def tensor(arguments: Arguments, answer: Any) -> Iterator[Fault]:
    """Unit norm, epipoles that satisfy the tensor with every bearing of the third view."""
    found, epipoles = answer
    if abs(np.linalg.norm(found) - 1) > 1e-12:
        yield "tensor", f"of norm {np.linalg.norm(found)}"
    if epipoles.shape != (2, 3, 3) or not np.isnan(epipoles[:, range(3), range(3)]).all():
        yield "tensor", f"epipoles {epipoles.tolist()}"
        return
    e = np.stack([np.cos(epipoles), np.sin(epipoles)], axis=-1)
    for one in e:
        # Views 0 and 1 that look at each other look along one line, which every ray of view 2 meets.
        pairs = [
            np.einsum("ijl,i,j", found, one[0, 1], one[1, 0]),
            np.einsum("ijl,i,l", found, one[0, 2], one[2, 0]),
            np.einsum("ijl,j,l", found, one[1, 2], one[2, 1]),
        ]
        if not np.abs(pairs).max() < 1e-5:
            yield "tensor", f"epipoles {epipoles.tolist()} leave {np.abs(pairs).max():.1e}"
