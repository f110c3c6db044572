#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""Reference values for both test suites, by plain, slow and independent means.

    python tests/data/make_reference.py            # writes reference.json beside this file
    python tests/data/make_reference.py --check    # recomputes and compares, writes nothing

Needs NumPy and SciPy, deliberately not bearslam, and about a minute. Seeded: the same scenes every
time. Where the library uses a closed form, this script goes another way:

* motion from a calibrated tensor: homographies between views, their eigenvectors, intersection of
  epipoles, all eight signs tried, then Newton on the definition of the tensor;
* many views: dense ``scipy.optimize.least_squares`` from dozens of starts, no elimination;
* Jacobians: complex step, exact to rounding; degeneracies: numerical rank by SVD.

Conventions: a pose is (x, y, heading), a bearing ``atan2(y_j - y_i, x_j - x_i) - heading_i``;
radians, counter-clockwise, (-pi, pi]; bearings are (views, landmarks), ``null`` where not seen.

What the file holds (every section is a list of records):

three_view
    ``null_vector``: smallest right singular vector, up to sign, of the rows
    [cos(a+b-c), sin(a+b-c), cos(a-b+c), sin(a-b+c), cos(-a+b+c), sin(-a+b+c)];
    ``singular_values`` of them, n = 5 has five. ``reweighted_null_vectors`` (with noise and n > 5;
    otherwise weights change nothing): after 1, 2 and 3 re-solves with every row divided by the norm
    of its gradient by (a, b, c) at the last vector. ``projective_tensor`` (n >= 7): T_ijk in C
    order, up to sign, smallest right singular vector of the n x 8 rows u (x) v (x) w, with
    ``projective_singular_values``. ``epipoles`` [k][i][j]: bearing modulo pi, in (-pi/2, pi/2], at
    which view i sees view j, of ``null_vector``; ``projective_epipoles`` (with noise) the same of
    ``projective_tensor``, ``null`` if complex. The two assignments k come in no particular order.
    ``solutions`` belong to ``null_vector``, not reweighted; fewest ``inconsistent`` sightings
    (negative depth) first, then least ``cost`` (sum of squared wrapped residuals). View 0 sits at
    the origin with heading 0, view 1 at distance 1. Landmarks: least squares over the three rays as
    lines, unit normals, unweighted.
many_view
    ``best_known_cost``: SUM (not half the sum) of squared wrapped residuals [rad^2] at the best
    optimum found; ``ml_poses``, ``ml_landmarks`` there, brought onto the truth by a similarity.
    ``rivals``: other maps, not similar to it, that cost the same. Four views of four landmarks are
    exactly determined, and often have one: another map that explains every bearing, signs and all.
jacobian
    Rows are sightings in view-major order; columns x, y, heading of every pose, then x, y of every
    landmark.
resection, triangulation
    Exact scenes: the answer is the truth.
align
    The similarity target = scale R(angle) source + translation with the least sum of squares, no
    reflection.
counting
    Null directions of the bearing Jacobian beyond the four of the gauge: ``extra`` measured here,
    ``expected`` from theory, ``poses`` and ``landmarks`` of one such scene. Singular values are
    relative to the largest.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Array = NDArray[np.float64]
Record = dict[str, Any]

REFERENCE = Path(__file__).with_name("reference.json")
# Metres between any two points of a scene: tests are about the method, not about luck.
MIN_DISTANCE = 0.4


# --- scenes ---------------------------------------------------------------------------------------


def wrap(angle: Array) -> Array:
    """Angle in [-pi, pi], without the rounding that adding and subtracting pi would bring."""
    return np.arctan2(np.sin(angle), np.cos(angle))


def sight(poses: Array, landmarks: Array) -> Array:
    """Bearings (m, n) [rad] of `landmarks` (n, 2) from `poses` (m, 3)."""
    delta = landmarks[None, :, :] - poses[:, None, :2]
    return wrap(np.arctan2(delta[..., 1], delta[..., 0]) - poses[:, None, 2])


def scene(rng: np.random.Generator, kind: str, m: int, n: int) -> tuple[Array, Array]:
    """Poses (m, 3), landmarks (n, 2): mixed in a 7 m x 5 m room, or robots ringed by them."""
    points: list[Array] = []
    while len(points) < m + n:
        if kind == "mixed":
            point = rng.uniform([0.0, 0.0], [7.0, 5.0])
        else:
            low, high = (0.0, 1.8) if len(points) < m else (2.5, 4.0)
            radius, turn = math.sqrt(rng.uniform(low**2, high**2)), rng.uniform(-math.pi, math.pi)
            point = np.array([radius * math.cos(turn), radius * math.sin(turn)])
        point = point.round(6)  # short in the file
        if all(np.hypot(*(point - other)) > MIN_DISTANCE for other in points):
            points.append(point)
    headings = rng.uniform(-math.pi, math.pi, m).round(6)
    return np.column_stack([points[:m], headings]), np.array(points[m:])


# --- three views ----------------------------------------------------------------------------------


def calibrated_rows(bearings: NDArray[Any]) -> NDArray[Any]:
    """Rows (n, 6) with null vector (Re A, -Im A, Re B, -Im B, ...); complex input allowed."""
    a, b, c = bearings
    sums = (a + b - c, a - b + c, -a + b + c)
    return np.stack([f(s) for s in sums for f in (np.cos, np.sin)], axis=1)


def null_vector(rows: Array) -> tuple[Array, Array]:
    """Smallest right singular vector of `rows`, and all singular values."""
    _, singular, vt = np.linalg.svd(rows, full_matrices=True)
    return vt[-1], singular


def reweight(bearings: Array, vector: Array) -> Array:
    """Null vector after dividing each row by the gradient of its residual, by complex step."""
    step = 1e-30
    gradient = np.zeros(bearings.shape)
    for view in range(3):
        moved = bearings.astype(complex)
        moved[view] += 1j * step
        gradient[view] = (calibrated_rows(moved) @ vector).imag / step
    return null_vector(calibrated_rows(bearings) / np.linalg.norm(gradient, axis=0)[:, None])[0]


def calibrated_tensor(vector: Array) -> Array:
    """T_ijk (2, 2, 2): the trilinear form at bearings 0 and pi/2, where u = (1, 0) and (0, 1)."""
    a, b, c = vector[0::2] - 1j * vector[1::2]
    turn = (1, 1j, -1, -1j)  # e^{i k pi/2}, exact
    tensor = np.empty((2, 2, 2))
    for i, j, k in np.ndindex(2, 2, 2):
        tensor[i, j, k] = (a * turn[(i + j - k) % 4] + b * turn[(i - j + k) % 4] + c * turn[(-i + j + k) % 4]).real
    return tensor


def epipoles(tensor: Array) -> Array | None:
    """Bearings modulo pi [k, i, j] of view j in view i, from eigenvectors; None if complex."""
    quarter_turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    # Views count from 0. From view 1 to 2 along a fixed ray of view 0; to 0 along one of view 2.
    to_last = [quarter_turn @ tensor[i].T for i in (0, 1)]
    to_first = [quarter_turn @ tensor[:, :, k] for k in (0, 1)]
    # A direction of view 1 that maps to the same whichever ray was fixed points at another robot.
    values, vectors = np.linalg.eig(np.linalg.solve(to_last[1], to_last[0]))
    if np.iscomplexobj(values) and np.abs(values.imag).max() > 0:
        return None

    def carry(maps: list[Array], direction: Array) -> Array:
        image: Array = max((m @ direction for m in maps), key=lambda w: float(np.linalg.norm(w)))
        return image

    result = np.full((2, 3, 3), np.nan)
    for k in (0, 1):
        at_first, at_last = vectors[:, k].real, vectors[:, 1 - k].real
        directions = {
            (1, 0): at_first,
            (1, 2): at_last,
            (2, 0): carry(to_last, at_first),
            (2, 1): carry(to_last, at_last),
            (0, 1): carry(to_first, at_first),
            (0, 2): carry(to_first, at_last),
        }
        for (i, j), (x, y) in directions.items():
            angle = math.atan2(y, x)
            result[k, i, j] = angle - math.pi * math.ceil(angle / math.pi - 0.5)
    return result


def triangulate_lines(poses: Array, bearings: Array) -> Array:
    """Least squares over the lines of sight, unit normals, signs ignored."""
    angle = poses[:, 2:] + bearings
    normals = np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
    offsets = np.einsum("mnk,mk->mn", normals, poses[:, :2])
    points = [np.linalg.lstsq(normals[:, j], offsets[:, j])[0] for j in range(bearings.shape[1])]
    return np.array(points)


def inconsistent(poses: Array, landmarks: Array, bearings: Array) -> int:
    """Count the sightings that look away from their landmark."""
    return int((np.cos(bearings - sight(poses, landmarks)) < 0).sum())


def motion(epipole: Array, bearings: Array) -> Array:
    """Poses (3, 3) of one assignment: every sign tried, fewest wrong sightings kept."""
    trials = []
    for side, turn1, turn2 in itertools.product((1.0, -1.0), (0.0, math.pi), (0.0, math.pi)):
        heading1 = epipole[0, 1] - epipole[1, 0] + turn1
        heading2 = epipole[0, 2] - epipole[2, 0] + turn2
        p1 = side * np.array([math.cos(epipole[0, 1]), math.sin(epipole[0, 1])])
        ray0 = np.array([math.cos(epipole[0, 2]), math.sin(epipole[0, 2])])
        ray1 = np.array([math.cos(epipole[1, 2] + heading1), math.sin(epipole[1, 2] + heading1)])
        along = np.linalg.solve(np.column_stack([ray0, -ray1]), p1)
        poses = np.array([[0.0, 0.0, 0.0], [*p1, heading1], [*(along[0] * ray0), heading2]])
        poses[:, 2] = wrap(poses[:, 2])
        trials.append((inconsistent(poses, triangulate_lines(poses, bearings), bearings), poses))
    trials.sort(key=lambda trial: trial[0])
    if trials[0][0] == trials[1][0]:
        raise UnsuitableError("a view has as many sightings forward as backward")
    return trials[0][1]


def polish(poses: Array, vector: Array) -> Array:
    """Newton on the definition of the tensor: poses whose (A, B, C) is `vector` up to scale."""

    def tensor_of(x: Array) -> Array:
        direction, x2, y2, t1, t2, factor = x
        p0, p1, p2 = 0.0, np.exp(1j * direction), x2 + 1j * y2
        abc = np.array(
            [
                np.conj(p0 - p1) * np.exp(1j * (t1 - t2)),
                np.conj(p2 - p0) * np.exp(1j * (t2 - t1)),
                np.conj(p1 - p2) * np.exp(1j * (t1 + t2)),
            ]
        )
        image: Array = factor * np.column_stack([abc.real, -abc.imag]).ravel()
        return image

    x = np.array([math.atan2(poses[1, 1], poses[1, 0]), *poses[2, :2], poses[1, 2], poses[2, 2], 1.0])
    x[5] = vector @ tensor_of(x) / (tensor_of(x) @ tensor_of(x))
    for _ in range(8):
        steps = 1e-6 * np.eye(6)
        slope = np.column_stack([(tensor_of(x + s) - tensor_of(x - s)) / 2e-6 for s in steps])
        x = x - np.linalg.solve(slope, tensor_of(x) - vector)
    if np.abs(tensor_of(x) - vector).max() > 2e-15:
        raise UnsuitableError("Newton did not settle")
    polished = np.array([[0.0, 0.0, 0.0], [math.cos(x[0]), math.sin(x[0]), x[3]], [x[1], x[2], x[4]]])
    polished[:, 2] = wrap(polished[:, 2])
    if np.abs(polished - poses).max() > 1e-6:
        raise UnsuitableError("Newton went elsewhere")
    return polished


class UnsuitableError(Exception):
    """The scene would not make a good test; draw the next."""


def three_view_record(kind: str, n: int, noise_deg: float, rng: np.random.Generator) -> Record:
    """One well-conditioned scene with everything that is derived from its bearings."""
    poses, landmarks = scene(rng, kind, 3, n)
    bearings = wrap(sight(poses, landmarks) + math.radians(noise_deg) * rng.standard_normal((3, n)))
    rows = calibrated_rows(bearings)
    vector, singular = null_vector(rows)
    if singular[4] < 0.02 * singular[0] or (n > 5 and singular[5] > 0.2 * singular[4]):
        raise UnsuitableError("null vector badly determined")
    sides = np.hypot(vector[0::2], vector[1::2])
    kappa = (sides[2] ** 2 - sides[0] ** 2 - sides[1] ** 2) / (2 * sides[0] * sides[1])
    if abs(kappa) > 0.97:
        raise UnsuitableError("robots nearly collinear")
    angles = epipoles(calibrated_tensor(vector))
    if angles is None:
        raise UnsuitableError("triangle inequality broken")
    ranked: list[tuple[tuple[int, float, float], Record]] = []
    for assignment in angles:
        found = polish(motion(assignment, bearings), vector)
        points = triangulate_lines(found, bearings)
        cosines = np.cos(bearings - sight(found, points))
        if np.abs(cosines).min() < 0.05 or np.abs(points).max() > 50:
            raise UnsuitableError("a sign hangs by a thread")
        cost = float((wrap(bearings - sight(found, points)) ** 2).sum())
        wrong = int((cosines < 0).sum())
        off = mismatch(found[:, :2], poses[:, :2])
        solution = {"poses": found, "landmarks": points, "inconsistent": wrong, "cost": cost}
        # Costs of zero differ by rounding only: they tie, and the nearer to the truth leads.
        ranked.append(((wrong, round(cost, 20), off), solution))
    ranked.sort(key=lambda pair: pair[0])
    record: Record = {
        "kind": kind,
        "n": n,
        "noise_deg": noise_deg,
        "bearings": bearings,
        "true_poses": poses,
        "true_landmarks": landmarks,
        "null_vector": vector,
        "singular_values": singular,
        "epipoles": angles,
        "solutions": [solution for _, solution in ranked],
    }
    if noise_deg > 0 and n > 5:
        record["reweighted_null_vectors"] = weighted = [reweight(bearings, vector)]
        for _ in range(2):
            weighted.append(reweight(bearings, weighted[-1]))
    if n >= 7:
        u, v, w = (np.stack([np.cos(b), np.sin(b)], axis=1) for b in bearings)
        tensor, spectrum = null_vector(np.einsum("ni,nj,nk->nijk", u, v, w).reshape(n, 8))
        if spectrum[6] < 0.005 * spectrum[0]:
            raise UnsuitableError("projective tensor badly determined")
        record["projective_tensor"] = tensor
        record["projective_singular_values"] = spectrum
        if noise_deg > 0:
            record["projective_epipoles"] = epipoles(tensor.reshape(2, 2, 2))
    return record


def mismatch(points: Array, target: Array) -> float:
    """Sum of squared distances after the best similarity."""
    return float(((similarity(points, target)[3] - target) ** 2).sum())


# --- many views -----------------------------------------------------------------------------------


def residuals(x: Array, bearings: Array) -> Array:
    """Wrap the bearing residuals of the sightings that exist; `x` stacks poses and landmarks."""
    m = bearings.shape[0]
    seen = np.isfinite(bearings)
    return wrap(sight(x[: 3 * m].reshape(m, 3), x[3 * m :].reshape(-1, 2)) - bearings)[seen]


def jacobian(x: Array, bearings: Array) -> Array:
    """Differentiate `residuals`, dense, one row after the other."""
    m, n = bearings.shape
    poses, landmarks = x[: 3 * m].reshape(m, 3), x[3 * m :].reshape(n, 2)
    rows = []
    for i, j in zip(*np.nonzero(np.isfinite(bearings)), strict=True):
        dx, dy = landmarks[j] - poses[i, :2]
        square = dx * dx + dy * dy
        row = np.zeros(3 * m + 2 * n)
        row[3 * i : 3 * i + 3] = dy / square, -dx / square, -1.0
        row[3 * m + 2 * j : 3 * m + 2 * j + 2] = -dy / square, dx / square
        rows.append(row)
    return np.array(rows)


def optimum(x: Array, bearings: Array) -> Array:
    """Local optimum by SciPy, then Gauss-Newton with minimum-norm steps until nothing moves."""
    found: Array = least_squares(
        residuals,
        x,
        jacobian,
        args=(bearings,),
        x_scale="jac",
        ftol=1e-15,
        xtol=1e-15,
        gtol=1e-15,
        max_nfev=300,
    ).x
    for _ in range(10):
        step = np.linalg.lstsq(jacobian(found, bearings), -residuals(found, bearings), rcond=1e-9)[0]
        if cost_of(found + step, bearings) < cost_of(found, bearings):
            found = found + step
    return found


def cost_of(x: Array, bearings: Array) -> float:
    """Sum of squared wrapped residuals."""
    return float((residuals(x, bearings) ** 2).sum())


def starts(rng: np.random.Generator, truth: Array, kind: str, m: int, n: int) -> Iterator[Array]:
    """Yield the truth, the truth disturbed more and more, and scenes unrelated to it."""
    yield truth
    for amount in np.linspace(0.05, 1.5, 15):
        yield truth + amount * rng.standard_normal(truth.size)
    for _ in range(150 if (m, n) == (4, 4) else 15):
        poses, landmarks = scene(rng, kind, m, n)
        yield np.concatenate([poses.ravel(), landmarks.ravel()])


def many_view_record(
    kind: str,
    m: int,
    n: int,
    noise_deg: float,
    missing: float,
    rivals: int,
    rng: np.random.Generator,
) -> Record:
    """One scene with the fraction `missing` of its sightings gone, and the best optima found."""
    poses, landmarks = scene(rng, kind, m, n)
    bearings = wrap(sight(poses, landmarks) + math.radians(noise_deg) * rng.standard_normal((m, n)))
    bearings[rng.random((m, n)) < missing] = np.nan
    seen = np.isfinite(bearings)
    if missing > 0 and (seen.sum(axis=0).min() < 3 or seen.sum(axis=1).min() < 5):
        raise UnsuitableError("too little seen")
    truth = np.concatenate([poses.ravel(), landmarks.ravel()])
    spectrum = np.linalg.svd(jacobian(truth, bearings), compute_uv=False)
    if spectrum[truth.size - 5] < 3e-3 * spectrum[0]:
        raise UnsuitableError("badly conditioned")
    candidates = [optimum(x, bearings) for x in starts(rng, truth, kind, m, n)]
    costs = np.array([cost_of(x, bearings) for x in candidates])
    # Noise-free costs differ by rounding only; the first of equals started at the truth.
    best = candidates[int(np.argmin(np.round(costs, 20)))]
    distinct = [best]
    for k in np.flatnonzero(costs <= costs.min() * (1 + 1e-9) + 1e-20):
        x = candidates[k]
        spectrum = np.linalg.svd(jacobian(x, bearings), compute_uv=False)
        isolated = spectrum[truth.size - 5] > 1e-5 * spectrum[0]
        if isolated and all(mismatch(corners(x, m), corners(y, m)) > 1e-6 for y in distinct):
            distinct.append(x)
    if len(distinct) != rivals + 1:
        raise UnsuitableError("not the number of rivals asked for")
    maps = [aligned(x, m, np.vstack([poses[:, :2], landmarks])) for x in distinct]
    return {
        "kind": kind,
        "m": m,
        "n": n,
        "noise_deg": noise_deg,
        "missing": int((~seen).sum()),
        "bearings": bearings,
        "true_poses": poses,
        "true_landmarks": landmarks,
        "best_known_cost": cost_of(best, bearings),
        "ml_poses": maps[0][0],
        "ml_landmarks": maps[0][1],
        "rivals": [{"poses": p, "landmarks": q} for p, q in maps[1:]],
    }


def corners(x: Array, m: int) -> Array:
    """Positions of the robots, then of the landmarks, one row each."""
    return np.vstack([x[: 3 * m].reshape(m, 3)[:, :2], x[3 * m :].reshape(-1, 2)])


def aligned(x: Array, m: int, target: Array) -> tuple[Array, Array]:
    """Poses and landmarks of `x` after the best similarity to `target`."""
    _, angle, _, moved = similarity(corners(x, m), target)
    return np.column_stack([moved[:m], wrap(x[2 : 3 * m : 3] + angle)]), moved[m:]


# --- small parts ----------------------------------------------------------------------------------


def similarity(source: Array, target: Array) -> tuple[float, float, Array, Array]:
    """Scale, angle, translation, moved source; S. Umeyama, PAMI 13(4), 1991, (40) to (43)."""
    mean_s, mean_t = source.mean(axis=0), target.mean(axis=0)
    covariance = (target - mean_t).T @ (source - mean_s) / len(source)
    u, d, vt = np.linalg.svd(covariance)
    sign = np.array([1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    rotation = u @ np.diag(sign) @ vt
    scale = float((d * sign).sum() / ((source - mean_s) ** 2).sum() * len(source))
    translation = mean_t - scale * rotation @ mean_s
    angle = math.atan2(rotation[1, 0], rotation[0, 0])
    return scale, angle, translation, scale * source @ rotation.T + translation


def complex_step_jacobian(poses: Array, landmarks: Array) -> Array:
    """Jacobian of all bearings by complex step: no derivative written down, exact to rounding."""
    m, n = len(poses), len(landmarks)
    x = np.concatenate([poses.ravel(), landmarks.ravel()])
    step = 1e-30
    columns = []
    for k in range(x.size):
        z = x.astype(complex)
        z[k] += 1j * step
        p, q = z[: 3 * m].reshape(m, 3), z[3 * m :].reshape(n, 2)
        dx, dy = (q[None, :, axis] - p[:, None, axis] for axis in (0, 1))
        steep = np.abs(dy) > np.abs(dx)  # two arctangents that differ by a constant
        safe_dx, safe_dy = np.where(steep, 1.0, dx), np.where(steep, dy, 1.0)
        angle = np.where(steep, -np.arctan(dx / safe_dy), np.arctan(dy / safe_dx))
        columns.append((angle - p[:, 2:]).imag.ravel() / step)
    return np.column_stack(columns)


def jacobian_records(rng: np.random.Generator) -> Iterator[Record]:
    """Complex-step Jacobians of two small scenes, checked against central differences."""
    for kind, m, n in (("mixed", 3, 5), ("enclosed", 4, 4)):
        poses, landmarks = scene(rng, kind, m, n)
        matrix = complex_step_jacobian(poses, landmarks)
        x = np.concatenate([poses.ravel(), landmarks.ravel()])
        bearings = sight(poses, landmarks)
        differences = np.column_stack(
            [wrap(residuals(x + s, bearings) - residuals(x - s, bearings)) / 2e-6 for s in 1e-6 * np.eye(x.size)]
        )
        assert np.abs(matrix - differences).max() < 1e-7  # rounding 1e-16 / 1e-6, truncation 1e-12
        yield {
            "kind": kind,
            "m": m,
            "n": n,
            "poses": poses,
            "landmarks": landmarks,
            "bearings": bearings,
            "jacobian": matrix,
        }


def resection_records(rng: np.random.Generator) -> Iterator[Record]:
    """Exact scenes of one view, away from the circle through the landmarks."""
    for kind, n in itertools.product(("mixed", "enclosed"), (3, 4, 8)):
        while True:
            poses, landmarks = scene(rng, kind, 1, n)
            # Rows of the linear resection, unknowns (cos, sin, t1, t2).
            u, v = np.cos(sight(poses, landmarks)[0]), np.sin(sight(poses, landmarks)[0])
            x, y = landmarks.T
            spectrum = np.linalg.svd(np.column_stack([u * y - v * x, u * x + v * y, -v, u]), compute_uv=False)
            if spectrum[2] > 0.03 * spectrum[0]:
                break
        yield {
            "kind": kind,
            "n": n,
            "landmarks": landmarks,
            "bearings": sight(poses, landmarks)[0],
            "pose": poses[0],
        }


def triangulation_records(rng: np.random.Generator) -> Iterator[Record]:
    """Exact scenes in which every landmark has at least 11 degrees of parallax."""
    for kind, m, n, missing in (
        ("mixed", 2, 6, 0.0),
        ("enclosed", 2, 6, 0.0),
        ("mixed", 3, 6, 0.0),
        ("mixed", 6, 8, 0.3),
        ("enclosed", 6, 8, 0.3),
    ):
        while True:
            poses, landmarks = scene(rng, kind, m, n)
            bearings = sight(poses, landmarks)
            bearings[rng.random((m, n)) < missing] = np.nan
            rays = bearings + poses[:, 2:]
            apart = np.abs(np.sin(rays[:, None, :] - rays[None, :, :]))  # sine of the parallax of every pair
            if np.nan_to_num(apart).max(axis=(0, 1)).min() > 0.2:
                break
        yield {
            "kind": kind,
            "m": m,
            "n": n,
            "poses": poses,
            "bearings": bearings,
            "landmarks": landmarks,
        }


def align_records(rng: np.random.Generator) -> Iterator[Record]:
    """Point sets that differ by a similarity, by noise too, and by a reflection too."""
    for name, count, noise, mirror in (
        ("two points", 2, 0.0, 1.0),
        ("exact", 6, 0.0, 1.0),
        ("noisy", 8, 0.3, 1.0),
        ("mirrored", 8, 0.3, -1.0),
    ):
        source = rng.uniform(-4, 4, (count, 2))
        angle, scale = rng.uniform(-3, 3), rng.uniform(0.3, 3)
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        target = scale * source * [1.0, mirror] @ turn.T + rng.uniform(-5, 5, 2)
        target = target + noise * rng.standard_normal((count, 2))
        scale, angle, translation, moved = similarity(source, target)
        yield {
            "name": name,
            "source": source,
            "target": target,
            "scale": scale,
            "angle": angle,
            "translation": translation,
            "sum_of_squares": float(((moved - target) ** 2).sum()),
        }


# --- counting -------------------------------------------------------------------------------------

Draw = Callable[[np.random.Generator, int], Array]


def anywhere(rng: np.random.Generator, count: int) -> Array:
    """Draw generic points."""
    return rng.uniform([-3.0, -2.5], [3.0, 2.5], (count, 2))


def on_line(rng: np.random.Generator, count: int, height: float = 0.7, slope: float = 0.3) -> Array:
    """Points on one line."""
    x = np.linspace(-3.0, 3.0, count) + rng.uniform(-0.2, 0.2, count)
    return np.column_stack([x, height + slope * x])


def on_circle(rng: np.random.Generator, count: int, phase: float = 0.0) -> Array:
    """Points on one circle."""
    turn = phase + 2 * math.pi * (np.arange(count) + rng.uniform(-0.3, 0.3, count)) / count
    return np.column_stack([0.4 + 2.5 * np.cos(turn), -0.2 + 2.5 * np.sin(turn)])


def other_line(rng: np.random.Generator, count: int) -> Array:
    """Points on one line, not that of `on_line`."""
    return on_line(rng, count, -1.6, -0.4)


def between_on_circle(rng: np.random.Generator, count: int) -> Array:
    """Points on the circle of `on_circle`, in its gaps."""
    return on_circle(rng, count, 0.37)


def one_off(draw: Draw) -> Draw:
    """Like `draw`, with the last point elsewhere."""
    return lambda rng, count: np.vstack([draw(rng, count - 1), [[0.3, 2.1]]])


def two_coincide(rng: np.random.Generator, count: int) -> Array:
    """Draw generic points, the first two of them the same."""
    points = anywhere(rng, count)
    points[1] = points[0]
    return points


def square(rng: np.random.Generator, count: int) -> Array:
    """Four corners, so on a circle."""
    assert count == 4
    return np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])


def trapezoid(rng: np.random.Generator, count: int) -> Array:
    """Four corners, not isosceles, so not on a circle."""
    assert count == 4
    return np.array([[0.0, 0.0], [3.0, 0.0], [1.4, 1.5], [0.2, 1.5]])


# (name, poses, landmarks, sizes, extra null directions)
CONFIGURATIONS: list[tuple[str, Draw, Draw, list[tuple[int, int]], int]] = [
    ("generic", anywhere, anywhere, [(3, 5), (4, 4), (3, 10)], 0),
    ("two views", anywhere, anywhere, [(2, 5), (2, 12)], 2),
    ("three views of four landmarks", anywhere, anywhere, [(3, 4)], 1),
    ("three landmarks", anywhere, anywhere, [(4, 3), (6, 3)], 2),
    ("three collinear poses", on_line, anywhere, [(3, 5), (3, 12)], 1),
    ("collinear poses", on_line, anywhere, [(4, 8), (8, 8), (10, 8)], 0),
    ("three collinear poses and one off the line", one_off(on_line), anywhere, [(4, 8)], 0),
    ("two coincident poses of three", two_coincide, anywhere, [(3, 8)], 2),
    ("two coincident poses of four", two_coincide, anywhere, [(4, 8)], 0),
    ("four landmarks on a circle", anywhere, square, [(4, 4), (7, 4)], 1),
    ("four landmarks not on a circle", anywhere, trapezoid, [(4, 4), (7, 4)], 0),
    ("collinear landmarks", anywhere, on_line, [(5, 8), (10, 15)], 1),
    ("collinear landmarks but one", anywhere, one_off(on_line), [(5, 8), (10, 15)], 0),
    ("poses on one line, landmarks on another", other_line, on_line, [(5, 8)], 2),
    ("everything on one line", on_line, on_line, [(4, 6)], 8),
    ("everything on one circle", on_circle, between_on_circle, [(5, 8)], 5),
    ("three poses and all landmarks on one circle", on_circle, between_on_circle, [(3, 8)], 3),
    ("poses on a circle, landmarks generic", on_circle, anywhere, [(5, 8)], 0),
    ("landmarks on a circle, poses generic", anywhere, on_circle, [(5, 8)], 0),
]


def counting_records(rng: np.random.Generator) -> Iterator[Record]:
    """Numerical rank of the bearing Jacobian in every configuration."""
    for name, draw_poses, draw_landmarks, sizes, expected in CONFIGURATIONS:
        for m, n in sizes:
            for _ in range(200):  # until zero and nonzero singular values are far apart
                points, landmarks = draw_poses(rng, m), draw_landmarks(rng, n)
                poses = np.column_stack([points, rng.uniform(-math.pi, math.pi, m)])
                distances = np.linalg.norm(points[:, None] - landmarks[None], axis=-1)
                if distances.min() < 0.15:
                    continue
                matrix = complex_step_jacobian(poses, landmarks)
                spectrum = np.linalg.svd(matrix, compute_uv=False)
                spectrum = np.pad(spectrum, (0, matrix.shape[1] - spectrum.size)) / spectrum[0]
                extra = int((spectrum < 1e-10).sum()) - 4
                rank = matrix.shape[1] - 4 - extra
                if spectrum[rank - 1] > 1e-3:
                    break
            else:
                raise RuntimeError(f"{name}: no scene with a clear rank")
            yield {
                "name": name,
                "m": m,
                "n": n,
                "extra": extra,
                "expected": expected,
                "smallest_nonzero": float(spectrum[rank - 1]),
                "largest_zero": float(spectrum[rank]),
                "poses": poses,
                "landmarks": landmarks,
            }


# --- the file -------------------------------------------------------------------------------------


def first_suitable(seed: int, make: Callable[[np.random.Generator], Record]) -> Record:
    """Draw from a stream of this record's own until the scene suits."""
    rng = np.random.default_rng([20020511, seed])
    while True:
        try:
            return make(rng)
        except UnsuitableError:
            continue


def build() -> dict[str, list[Record]]:
    """Draw and solve everything; the seeds are fixed."""
    kinds = ("mixed", "enclosed")
    three = [
        *itertools.product(kinds, (5, 6, 7, 9, 12, 20), (0.0,)),
        *itertools.product(kinds, (5, 7, 12, 20), (0.3,)),
    ]
    many = [
        ("mixed", 4, 4, 0.0, 0.0, 0),
        ("enclosed", 4, 4, 0.0, 0.0, 1),
        ("mixed", 4, 7, 1.0, 0.0, 0),
        ("enclosed", 4, 7, 0.5, 0.0, 0),
        ("mixed", 5, 5, 0.5, 0.0, 0),
        ("enclosed", 5, 5, 0.5, 0.0, 0),
        ("mixed", 6, 9, 1.0, 0.0, 0),
        ("enclosed", 6, 9, 0.5, 0.0, 0),
        ("mixed", 8, 11, 0.5, 0.0, 0),
        ("enclosed", 8, 11, 1.0, 0.0, 0),
        ("mixed", 12, 15, 1.0, 0.0, 0),
        ("enclosed", 12, 15, 0.5, 0.0, 0),
        ("mixed", 8, 11, 1.0, 0.25, 0),
        ("enclosed", 12, 15, 1.0, 0.25, 0),
    ]
    small = np.random.default_rng(20020511)
    return {
        "three_view": [first_suitable(k, partial(three_view_record, *a)) for k, a in enumerate(three)],
        "many_view": [first_suitable(100 + k, partial(many_view_record, *a)) for k, a in enumerate(many)],
        "jacobian": [*jacobian_records(small)],
        "resection": [*resection_records(small)],
        "triangulation": [*triangulation_records(small)],
        "align": [*align_records(small)],
        "counting": [*counting_records(small)],
    }


def plain(value: Any) -> Any:
    """Arrays to lists, NaN to None, so that the file is strict JSON with every digit."""
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [plain(item) for item in value]
    if isinstance(value, float) and math.isnan(value):
        return None
    return value


def to_text(sections: dict[str, list[Record]]) -> str:
    """One record a line: small, and a change shows which record it touched."""
    parts = []
    for name, records in sections.items():
        lines = [json.dumps(plain(r), separators=(",", ":"), allow_nan=False) for r in records]
        parts.append(f'"{name}":[\n' + ",\n".join(lines) + "\n]")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def differences(old: Any, new: Any, where: str = "") -> Iterator[str]:
    """Places where two files disagree by more than another BLAS explains."""
    if isinstance(old, dict) and isinstance(new, dict) and old.keys() == new.keys():
        for key in old:
            yield from differences(old[key], new[key], f"{where}.{key}")
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for k, (a, b) in enumerate(zip(old, new, strict=True)):
            yield from differences(a, b, f"{where}[{k}]")
    elif isinstance(old, float) and isinstance(new, float):
        if not math.isclose(old, new, rel_tol=1e-7, abs_tol=1e-9):
            yield f"{where}: {old!r} in the file, {new!r} now"
    elif old != new:
        yield f"{where}: {old!r} in the file, {new!r} now"


def main() -> int:
    """Write the file, or compare with it."""
    parser = argparse.ArgumentParser(description="Write or check tests/data/reference.json.")
    parser.add_argument("--check", action="store_true", help="compare, do not write")
    args = parser.parse_args()
    sections = build()
    for record in sections["counting"]:
        verdict = "" if record["extra"] == record["expected"] else f"  expected {record['expected']}"
        print(f"{record['name']} ({record['m']}x{record['n']}): {record['extra']} extra{verdict}")
    text = to_text(sections)
    if not args.check:
        REFERENCE.write_text(text, encoding="utf-8")
        return 0
    found = [*differences(json.loads(REFERENCE.read_text(encoding="utf-8")), json.loads(text))]
    print("\n".join(found[:20]) or "the file agrees")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
