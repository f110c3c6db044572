# SPDX-License-Identifier: MIT OR Apache-2.0
"""The calibrated three-view estimator in NumPy alone, as fast as NumPy can be: a reference for the compiled batch.

It is the same estimator: rows of (T1), null vector, Sampson weights (T4), both motions in closed form (T6), (T7),
signs by majority (T8), ranking, landmarks by (T10); see ``docs/theory.md``. What makes it fast:

* no Python loop over problems; the problems are the last axis of all arrays, so that every operation runs over
  contiguous memory, in blocks that fit the cache;
* large arrays of complex numbers as pairs of real arrays (a conjugate, a real part or a real factor then costs nothing
  extra), small ones as complex arrays;
* results are written to existing arrays, which stay in the cache;
* sine and cosine from one tangent of half the angle: six times as fast, where NumPy has a vectorised tangent;
* the residuals of a landmark from the determinant of its three lines, see `settle`;
* null vectors by elimination over all problems at once, see `by_elimination`: LAPACK, called once per problem by
  NumPy, takes several times as long as everything else. It is included for comparison: `NULL_VECTORS`.

Left out, in NumPy's favour: tests for bearings that are not finite, for landmarks that do not determine the motion,
for coincident views and for parallel rays, none of which occur in generic scenes, and the flag for nearly collinear
views. For one thread, set ``OPENBLAS_NUM_THREADS=1`` and the like before NumPy is imported.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["NULL_VECTORS", "three_view_batch"]

Array = NDArray[np.float64]
Solutions = tuple[Array, Array, NDArray[np.int64], Array]
NullVector = Callable[[Array], Array]

MIN_LANDMARKS = 5

# Largest number of bearings per view and of problems per block, and number of landmarks at a time in `settle`: found by
# trial, with a second-level cache of 2 MB.
BEARINGS = 40_000
BLOCK = 2000
GROUP = 5

# Power iteration: steps before the first check, squared change of a converged vector, largest number of rounds after.
LEAD = 4
STANDS_STILL = 1e-20
ROUNDS = 12


def three_view_batch(
    bearings: Array,
    reweights: int = 0,
    *,
    null_vector: NullVector | None = None,
    block: int | None = None,
    group: int = GROUP,
) -> Solutions:
    """Both motions of many triples of views, and their landmarks.

    Parameters
    ----------
    bearings : (k, 3, n) ndarray
        Bearings of `k` problems with `n` landmarks [rad].
    reweights : int
        Rounds of Sampson weights.
    null_vector : callable
        One of `NULL_VECTORS`; the fastest by default.
    block, group : int
        Problems and landmarks at a time.

    Returns
    -------
    poses : (k, 2, 3, 3) ndarray
        Position and heading (x, y, theta) of each view under both motions, the better first.
    landmarks : (k, 2, n, 2) ndarray
    inconsistent : (k, 2) ndarray of int
    cost : (k, 2) ndarray
        Where noise has flattened the triangle of views there is one motion: the second is NaN, its `inconsistent` -1.
    """
    count, _, landmarks = bearings.shape
    if landmarks < MIN_LANDMARKS:
        raise ValueError(f"bearings: expected at least {MIN_LANDMARKS} landmarks, got {landmarks}")
    if null_vector is None:
        null_vector = NULL_VECTORS["elimination"]
    if block is None:
        block = max(1, min(BLOCK, BEARINGS // landmarks))
    found = (
        np.empty((count, 2, 3, 3)),
        np.empty((count, 2, landmarks, 2)),
        np.empty((count, 2), np.int64),
        np.empty((count, 2)),
    )
    with np.errstate(all="ignore"):
        for start in range(0, count, block):
            part = slice(start, start + block)
            solve_block(bearings[part], reweights, null_vector, group, tuple(array[part] for array in found))
    return found


def solve_block(bearings: Array, reweights: int, null_vector: NullVector, group: int, found: Solutions) -> None:
    """Solve some problems and write into slices of the results."""
    landmarks = bearings.shape[2]
    cos, sin = unit(np.array(bearings.transpose(1, 2, 0), order="C"))
    turns, rows = products(cos, sin)
    tensor = null_vector(rows)
    # Five landmarks are fitted exactly, whatever their weights.
    for _ in range(reweights if landmarks > MIN_LANDMARKS else 0):
        tensor = null_vector(rows * weights(tensor, rows))
    *motion, flat = motions(tensor)
    x, y, positions, theta, inconsistent, cost = settle(cos, sin, turns, motion, group)

    poses, points, *_ = found
    poses[:, :, 0] = 0.0
    poses[:, :, 1:, :2] = positions.transpose(3, 2, 1, 0)
    poses[:, :, 1:, 2] = theta.transpose(2, 1, 0)
    points[..., 0] = x.transpose(2, 0, 1)
    points[..., 1] = y.transpose(2, 0, 1)
    found[2][:] = inconsistent.T
    found[3][:] = cost.T
    first, second = inconsistent
    swapped = np.flatnonzero((first > second) | ((first == second) & (cost[0] > cost[1])))
    merged = np.flatnonzero(flat)
    for array in found:
        array[swapped] = array[swapped, ::-1]
        array[merged, 1] = -1 if array.dtype == np.int64 else np.nan


def unit(angles: Array) -> tuple[Array, Array]:
    """Cosine and sine from the tangent of half the angle; `angles` are overwritten."""
    angles *= 0.5
    tangent = np.tan(angles, out=angles)
    cos = np.square(tangent)
    cos += 1.0
    np.divide(2.0, cos, out=cos)
    tangent *= cos
    cos -= 1.0
    return cos, tangent


def products(cos: Array, sin: Array) -> tuple[Array, Array]:
    """Bearings of views 1 and 2 relative to view 0, and the rows of (T1).

    Returns
    -------
    turns : (2, 2, n, k) ndarray
        Real and imaginary parts of ``u* v`` and ``u* w``.
    rows : (6, n, k) ndarray
    """
    _, landmarks, count = cos.shape
    (u, v, w), (ui, vi, wi) = cos, sin
    turns = np.empty((2, 2, landmarks, count))
    scratch = np.empty((2, landmarks, count))
    np.multiply(u, cos[1:], out=turns[0])
    turns[0] += np.multiply(ui, sin[1:], out=scratch)
    np.multiply(u, sin[1:], out=turns[1])
    turns[1] -= np.multiply(ui, cos[1:], out=scratch)

    # u v w* = v (u* w)*, u* v w = v (u* w), u v* w = w (u* v)*.
    (e, f), (ei, fi) = turns
    a, b = scratch
    rows = np.empty((6, landmarks, count))
    np.multiply(f, v, out=a)
    np.multiply(fi, vi, out=b)
    np.add(a, b, out=rows[0])
    np.subtract(a, b, out=rows[4])
    np.multiply(f, vi, out=a)
    np.multiply(fi, v, out=b)
    np.subtract(a, b, out=rows[1])
    np.add(a, b, out=rows[5])
    np.multiply(e, w, out=rows[2])
    rows[2] += np.multiply(ei, wi, out=a)
    np.multiply(e, wi, out=rows[3])
    rows[3] -= np.multiply(ei, w, out=a)
    return turns, rows


def weights(tensor: Array, rows: Array) -> Array:
    """One over the standard deviations of the rows, (T4)."""
    parts = np.multiply(tensor[0::2, None], rows[1::2])
    scratch = np.multiply(tensor[1::2, None], rows[0::2])
    parts -= scratch
    # (P + Q - R)^2 + (P - Q + R)^2 + (-P + Q + R)^2 = 4 (P^2 + Q^2 + R^2) - (P + Q + R)^2
    total = np.add(parts[0], parts[1], out=scratch[0])
    total += parts[2]
    np.square(total, out=total)
    variance = np.einsum("ijk,ijk->jk", parts, parts, out=scratch[1])
    variance *= 4.0
    variance -= total
    variance += np.finfo(float).eps
    np.sqrt(variance, out=variance)
    return np.divide(1.0, variance, out=variance)


def motions(tensor: Array) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Both motions modulo pi in every heading, (T6) and (T7).

    Returns
    -------
    cos, sin : (2, 2, k) ndarray
        Of the headings of views 1 and 2, by view and branch.
    positions : (2, 2, 2, k) ndarray
        By coordinate, view and branch.
    flat : (k,) ndarray of bool
        Noise has left no triangle: both motions are the same.
    """
    squares = np.square(tensor)
    a, b, c = sides = np.sqrt(squares[0::2] + squares[1::2])
    phase = np.empty(sides.shape, complex)
    np.divide(tensor[0::2], sides, out=phase.real)
    np.divide(tensor[1::2], -sides, out=phase.imag)
    halves = 0.5 / (a * b)
    area = (a + b + c) * (b + c - a) * (a + c - b) * (a + b - c)
    flat = ~(area > 0.0)
    beta = np.empty((2, len(a)), complex)
    cos = ((c - a) * (c + a) - b * b) * halves
    cos[flat] = np.copysign(1.0, cos[flat])
    beta.real = cos
    np.multiply(np.sqrt(np.maximum(area, 0.0)), halves, out=beta.imag[0])
    np.negative(beta.imag[0], out=beta.imag[1])

    opposite = -(beta * b + a)
    gamma = opposite / np.sqrt(np.square(opposite.real) + np.square(opposite.imag))
    beta_star = beta.conj()
    doubled = np.empty((3, *beta.shape), complex)
    np.multiply(phase[0] * phase[1], beta_star, out=doubled[0])
    back = (doubled[0] * gamma).conj()
    np.multiply(phase[0] * phase[2], back, out=doubled[1])
    np.multiply(phase[1] * phase[2], back * beta_star, out=doubled[2])

    # Square roots of unit numbers.
    large = np.sqrt((1.0 + np.abs(doubled.real)) * 0.5)
    small = doubled.imag * 0.5 / large
    left = doubled.real < 0.0
    cos = np.where(left, small, large)
    sin = np.where(left, large, small)

    positions = np.empty((2, 2, *beta.shape))
    np.multiply(cos[0], -a, out=positions[0, 0])
    np.multiply(sin[0], a, out=positions[1, 0])
    np.multiply(cos[0] * beta.real - sin[0] * beta.imag, b, out=positions[0, 1])
    np.multiply(cos[0] * beta.imag + sin[0] * beta.real, -b, out=positions[1, 1])
    return cos[1:], sin[1:], positions, flat


def settle(
    cos: Array, sin: Array, turns: Array, motion: list[Array], group: int
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Landmarks, signs by majority (T8), cost.

    In the frame of the ray of view 0, with the rays ``1``, ``r = u* v h1``, ``s = u* w h2`` (``h`` the headings) and
    the distances ``d1``, ``d2`` of view 0 from the lines of the other two, the point of (T10) misses the three lines
    by ``D / W`` times the sines of the angles between the other two: ``(Im r* s, -Im s, Im r)`` is the null vector of
    the three lines' normals, ``D`` its product with their offsets and ``W`` its square.

    Returns
    -------
    x, y : (2, n, k) ndarray
        Landmarks by branch.
    positions : (2, 2, 2, k) ndarray
        Of views 1 and 2: coordinate, view, branch.
    theta : (2, 2, k) ndarray
        Their headings: view, branch.
    inconsistent, cost : (2, k) ndarray
    """
    head_cos, head_sin, positions = motion
    _, landmarks, count = cos.shape
    # Positions of views 1 and 2 in their own frames.
    own_x = head_cos * positions[0] + head_sin * positions[1]
    own_y = head_cos * positions[1] - head_sin * positions[0]
    hc, hs, px, py = (array[:, :, None] for array in (head_cos, head_sin, own_x, own_y))

    x = np.empty((2, landmarks, count))
    y = np.empty((2, landmarks, count))
    behind = np.zeros((3, 2, count))
    total = np.zeros((3, 2, count))
    signed = np.zeros((3, 2, count))
    squares = np.zeros((2, count))
    group = min(group, landmarks)
    tally = np.min_scalar_type(group)
    memory = np.empty((16, 2, group, count))
    for start in range(0, landmarks, group):
        part = slice(start, min(start + group, landmarks))
        space = memory[:, :, : part.stop - start]
        ahead, sines, angles = space[0:3], space[3:6], space[6:9]
        cosines, offsets, scratch = space[9:11], space[11:13], space[13:15]
        w, t = space[15], space[6]
        c0, s0 = cos[0, part], sin[0, part]
        ck, sk = cos[1:, None, part], sin[1:, None, part]
        turn_cos, turn_sin = turns[:, :, None, part]

        # Rays of views 1 and 2: cosines and sines[1:] relative to that of view 0.
        np.multiply(hc, turn_cos, out=cosines)
        cosines -= np.multiply(hs, turn_sin, out=scratch)
        np.multiply(hc, turn_sin, out=sines[1:])
        sines[1:] += np.multiply(hs, turn_cos, out=scratch)
        (c1, c2), (s12, s1, s2) = cosines, sines
        np.multiply(c1, s2, out=s12)
        s12 -= np.multiply(s1, c2, out=t)
        # Views 1 and 2 along their own rays, and across them.
        np.multiply(ck, px, out=ahead[1:])
        ahead[1:] += np.multiply(sk, py, out=scratch)
        np.multiply(ck, py, out=offsets)
        offsets -= np.multiply(sk, px, out=scratch)
        o1, o2 = offsets

        # D and W.
        np.multiply(o2, s1, out=w)
        w -= np.multiply(o1, s2, out=t)
        # The landmark along the ray of view 0, and across it.
        along, across = ahead[0], scratch[0]
        np.multiply(c2, o1, out=along)
        along -= np.multiply(c1, o2, out=t)
        along *= s12
        along -= np.multiply(o2, s2, out=t)
        along -= np.multiply(o1, s1, out=t)
        np.einsum("ibjk,ibjk->bjk", sines, sines, out=t)
        np.divide(1.0, t, out=t)
        along *= t
        w *= t
        np.multiply(w, s12, out=across)
        np.multiply(c0, along, out=x[:, part])
        x[:, part] += np.multiply(s0, across, out=t)
        np.multiply(s0, along, out=y[:, part])
        y[:, part] -= np.multiply(c0, across, out=t)
        # Landmark less view, along the rays of views 1 and 2; `across` has the other sign.
        cosines *= along
        np.subtract(cosines, ahead[1:], out=ahead[1:])
        np.multiply(sines[1:], across, out=offsets)
        ahead[1:] -= offsets

        # Angles between sighting and line, negative for those that point away.
        sines *= w
        np.abs(sines, out=sines)
        np.divide(s12, ahead[0], out=angles[0])
        np.divide(s2, ahead[1], out=angles[1])
        np.divide(s1, ahead[2], out=angles[2])
        np.arctan(angles, out=angles)
        behind += np.add.reduce(np.signbit(angles).view(np.uint8), axis=2, dtype=tally)
        signed += np.add.reduce(angles, axis=2)
        squares += np.einsum("ibjk,ibjk->bk", angles, angles)
        np.abs(angles, out=angles)
        total += np.add.reduce(angles, axis=2)

    turned = behind > landmarks - behind
    sign = 1.0 - 2.0 * turned
    wrong = np.where(turned, landmarks - behind, behind)
    # Those that point away are off by pi minus their angle.
    wrong_angles = (total - signed * sign) * 0.5
    cost = (squares + (np.pi * (np.pi * wrong - 2.0 * wrong_angles)).sum(axis=0)) * 0.5
    scale = sign[0] / np.sqrt(np.square(positions[0, 0]) + np.square(positions[1, 0]))
    x *= scale[:, None]
    y *= scale[:, None]
    side = sign[1:] * sign[0]
    theta = np.arctan2(head_sin * side, head_cos * side)
    return x, y, positions * scale, theta, wrong.sum(axis=0), cost


def scale_to_unit(vectors: Array) -> Array:
    """Scale the columns, in place."""
    vectors /= np.sqrt(np.einsum("ik,ik->k", vectors, vectors))
    return vectors


def by_elimination(rows: Array) -> Array:
    """Elimination over all problems at once: reflections for five landmarks, the Gram matrix for more."""
    return by_reflections(rows) if rows.shape[1] == MIN_LANDMARKS else by_gram(rows)


def by_reflections(rows: Array) -> Array:
    """Householder's triangular factor of five rows, then back substitution."""
    columns, count, _ = rows.shape
    work = rows.copy()
    for k in range(count):
        column = work[k, k:]
        head = np.copysign(np.sqrt(np.einsum("jk,jk->k", column, column)), column[0])
        column[0] += head
        others = work[k + 1 :, k:]
        step = np.einsum("jk,ijk->ik", column, others)
        step /= head * column[0]
        others -= step[:, None] * column
        np.negative(head, out=column[0])
    vector = np.zeros((columns, rows.shape[2]))
    vector[count] = -1.0
    for i in reversed(range(count)):
        # Row i of the factor is work[i:, i].
        np.einsum("jk,jk->k", work[i + 1 :, i], vector[i + 1 :], out=vector[i])
        vector[i] /= -work[i, i]
    return scale_to_unit(vector)


def by_gram(rows: Array) -> Array:
    """Power iteration with the inverse of the Gram matrix of the columns; squared for the few that are slow."""
    columns, _, count = rows.shape
    gram = np.empty((columns, columns, count))
    for i in range(columns):
        np.einsum("jk,ijk->ik", rows[i], rows[i:], out=gram[i, i:])
    # gram = L D L^T; row i of `inverse` is row i of the inverse of L.
    inverse = np.zeros_like(gram)
    inverse[0, 0] = 1.0
    lower = np.empty_like(gram)
    scratch = np.empty((columns, count))
    for k in range(columns - 1):
        factors = np.divide(gram[k, k + 1 :], gram[k, k], out=lower[k, k + 1 :])
        for i in range(k + 1, columns):
            gram[i, i:] -= np.multiply(factors[i - k - 1], gram[k, i:], out=scratch[: columns - i])
        row = inverse[k + 1]
        np.einsum("ak,ajk->jk", lower[: k + 1, k + 1], inverse[: k + 1, : k + 1], out=row[: k + 1])
        np.negative(row[: k + 1], out=row[: k + 1])
        row[k + 1] = 1.0
    # Without noise the last pivot is rounding error: any small number will do.
    pivots = np.maximum(np.abs(gram.diagonal().T), 1e-300)
    # Inverse of the matrix, of unit trace.
    scaled = inverse / pivots[:, None]
    power = gram
    for i in range(columns):
        np.einsum("ak,ajk->jk", inverse[i:, i], scaled[i:, i:], out=power[i, i:])
        power[i + 1 :, i] = power[i, i + 1 :]
    power /= np.einsum("iik->k", power)
    previous = power[columns - 1]
    for _ in range(LEAD - 1):
        previous = np.einsum("ijk,jk->ik", power, previous)
    vector = previous = scale_to_unit(previous)
    slow = np.arange(count)
    for _ in range(ROUNDS):
        following = scale_to_unit(np.einsum("ijk,jk->ik", power, previous))
        moved = following - previous
        still_moving = np.flatnonzero(np.einsum("ik,ik->k", moved, moved) > STANDS_STILL)
        if len(slow) == count:
            vector = following
        else:
            vector[:, slow] = following
        if len(still_moving) == 0:
            break
        slow = slow[still_moving]
        previous = following[:, still_moving]
        power = power[:, :, still_moving]
        power = np.einsum("ijk,jlk->ilk", power, power)
        power /= np.einsum("iik->k", power)
    return vector


def by_svd(rows: Array) -> Array:
    """LAPACK's singular value decomposition of all rows."""
    return np.linalg.svd(rows.transpose(2, 1, 0), full_matrices=rows.shape[1] < len(rows))[2][:, -1].T


def by_qr(rows: Array) -> Array:
    """LAPACK's triangular factor, then the singular value decomposition of that; for five rows the complement."""
    if rows.shape[1] < len(rows):
        return np.linalg.qr(rows.transpose(2, 0, 1), mode="complete")[0][:, :, -1].T
    return np.linalg.svd(np.linalg.qr(rows.transpose(2, 1, 0), mode="r"))[2][:, -1].T


def by_eigh(rows: Array) -> Array:
    """LAPACK's eigenvectors of the Gram matrix of the columns."""
    matrix = np.ascontiguousarray(rows.transpose(2, 1, 0))
    return np.linalg.eigh(matrix.transpose(0, 2, 1) @ matrix)[1][:, :, 0].T


NULL_VECTORS: dict[str, NullVector] = {
    "elimination": by_elimination,
    "svd": by_svd,
    "qr": by_qr,
    "eigh": by_eigh,
}
