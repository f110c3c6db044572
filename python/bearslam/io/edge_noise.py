# SPDX-License-Identifier: MIT OR Apache-2.0
"""The noise of the edges of a graph: standard deviations, covariances and information, and the axes they refer to."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from decimal import Decimal
from functools import partial
from typing import NamedTuple

import numpy as np

from bearslam.data.checks import FloatArray, quote
from bearslam.data.sightings import SIGMA_RANGE
from bearslam.errors import InvalidInputError
from bearslam.io.information import INDEX, covariance, information, informations, is_diagonal, sigma

__all__ = [
    "EdgeNoise",
    "diagonal_of",
    "from_covariance",
    "from_information",
    "full_matrix",
    "in_map_axes",
    "independent",
    "noise_of_rows",
    "to_information",
    "upper_triangle",
]


class EdgeNoise(NamedTuple):
    """The noise of one edge.

    Attributes
    ----------
    sigma : tuple of float, or None
        Standard deviations; None where there are correlations.
    upper : callable
        Returns the upper triangle of the covariance, row by row.
    """

    sigma: tuple[float, ...] | None
    upper: Callable[[], tuple[float, ...]]


def independent(sigma: tuple[float, ...], upper: Callable[[], tuple[float, ...]], where: str) -> EdgeNoise:
    """Noise without correlations; its standard deviations are infinite or have squares that doubles can hold."""
    low, high = SIGMA_RANGE
    for value in sigma:
        if not (low <= value <= high or value == math.inf):
            raise InvalidInputError(f"{where}: expected standard deviations from {low:g} to {high:g}, got {value:g}")
    return EdgeNoise(sigma, upper)


def from_information(texts: tuple[str, ...], where: str, *, unknown: bool = False) -> EdgeNoise:
    """The noise of an edge from the upper triangle of its information; with `unknown`, 0 stands for an unknown."""
    if is_diagonal([Decimal(text) for text in texts]):
        diagonal = [texts[row[i]] for i, row in enumerate(INDEX[len(texts)])]
        for text in diagonal:
            if not (float(text) > 0 or (unknown and float(text) == 0)):
                raise InvalidInputError(f"{where}: expected information above 0, got {quote(text)}")
        deviations = tuple(math.inf if float(text) == 0 else sigma(text) for text in diagonal)
        return independent(deviations, partial(_upper, texts), where)
    upper = covariance(texts)
    if upper is None:
        raise InvalidInputError(f"{where}: expected information that is positive definite, got {' '.join(texts)}")
    return EdgeNoise(None, lambda: upper)


def _upper(texts: tuple[str, ...]) -> tuple[float, ...]:
    return covariance(texts) or ()


def from_covariance(upper: tuple[float, ...], where: str) -> EdgeNoise:
    """The noise of an edge from the upper triangle of its covariance."""
    diagonal = [upper[row[i]] for i, row in enumerate(INDEX[len(upper)])]
    if not all(value > 0 for value in diagonal):
        raise InvalidInputError(f"{where}: expected variances above 0, got {min(diagonal):g}")
    if is_diagonal(upper):
        return independent(tuple(map(math.sqrt, diagonal)), lambda: upper, where)
    return EdgeNoise(None, lambda: upper)


def in_map_axes(spread: EdgeNoise, turn: float, where: str) -> EdgeNoise:
    """Noise along the axes of a known pose, turned to the axes of the map."""
    deviations = spread.sigma
    if turn == 0 or (deviations is not None and deviations[0] == deviations[1]):
        return spread
    if deviations is not None and math.inf in deviations[:2]:
        raise InvalidInputError(
            f"{where}: expected information on both x and y or on neither, as the pose is rotated: bearslam has "
            "standard deviations along the axes of the map"
        )
    if deviations is not None and math.isinf(deviations[2]):
        raise InvalidInputError(
            f"{where}: expected the same information on x and y, as the pose is rotated and nothing is known of its "
            "heading: bearslam has standard deviations along the axes of the map"
        )
    local = full_matrix(spread.upper())
    axes = _axes(turn)
    upper = tuple(upper_triangle(axes @ local @ axes.T))
    return EdgeNoise(None, lambda: upper)


def to_information(kind: str, noise: tuple[float, ...], turn: float) -> tuple[tuple[str, ...], bool]:
    """Upper triangle of the information, along the axes of a turned pose, and whether reading it restores the noise."""
    if kind == "sigma":
        diagonal = ["0" if math.isinf(value) else information(value) for value in noise]
        texts = tuple(diagonal[i] if i == j else "0" for i in range(len(noise)) for j in range(i, len(noise)))
        if turn == 0 or noise[0] == noise[1]:
            return texts, True
    else:
        texts, exact = informations(noise)
        if turn == 0:
            return texts, exact
    axes = _axes(turn)
    local = axes.T @ full_matrix(list(map(float, texts))) @ axes
    return tuple(map(repr, upper_triangle(local))), False


def noise_of_rows(deviations: FloatArray) -> list[tuple[str, tuple[float, ...]]]:
    """Each row as ("sigma", standard deviations), or with correlations as ("covariance", upper triangle)."""
    if deviations.ndim == 3:
        size = deviations.shape[1]
        if deviations[:, ~np.eye(size, dtype=bool)].any():
            symmetric = (deviations + deviations.transpose(0, 2, 1)) / 2
            rows, columns = np.triu_indices(size)
            return [("covariance", tuple(row)) for row in symmetric[:, rows, columns].tolist()]
        deviations = np.sqrt(np.diagonal(deviations, axis1=1, axis2=2))
    return [("sigma", tuple(row)) for row in deviations.tolist()]


def _axes(turn: float) -> FloatArray:
    cosine, sine = math.cos(turn), math.sin(turn)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def full_matrix(upper: Sequence[float]) -> FloatArray:
    """The symmetric matrix of an upper triangle."""
    return np.array([[upper[i] for i in row] for row in INDEX[len(upper)]])


def upper_triangle(matrix: FloatArray) -> list[float]:
    """The upper triangle of a matrix, row by row."""
    values: list[float] = matrix[np.triu_indices(len(matrix))].tolist()
    return values


def diagonal_of(kind: str, noise: Sequence[float]) -> Sequence[float]:
    """Standard deviations, or the variances of an upper triangle."""
    return noise if kind == "sigma" else [noise[row[i]] for i, row in enumerate(INDEX[len(noise)])]
