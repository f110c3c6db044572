# SPDX-License-Identifier: MIT OR Apache-2.0
"""Covariances in pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bearslam.coerce import FloatArray

try:
    from matplotlib.artist import Artist
    from matplotlib.collections import EllipseCollection
    from matplotlib.lines import Line2D
except ImportError:
    raise ImportError('pictures need matplotlib: pip install "bearslam[plot]"') from None

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["COVERED", "RADIUS", "draw_ellipses"]

COVERED = 0.95
"""Probability that a point is within its ellipse, if errors are Gaussian."""
RADIUS = float(np.sqrt(-2.0 * np.log(1.0 - COVERED)))
"""The radius of that ellipse, in standard deviations: squared it is the quantile of chi-square with two degrees."""


def draw_ellipses(
    ax: Axes, points: FloatArray, covariances: FloatArray, color: str, zorder: float, frame: str | None
) -> list[tuple[Artist, str]]:
    """Ellipses around points (k, 2) for covariances (k, 2, 2); those without bounds are left out.

    Returns what the legend says of them: nothing where there are none.
    """
    known = np.isfinite(points).all(axis=1) & np.isfinite(covariances).all(axis=(1, 2))
    if not known.any():
        return []
    squares, axes = np.linalg.eigh(covariances[known])
    half = RADIUS * np.sqrt(np.maximum(squares, 0.0))  # rounding may leave what is held a little below zero
    half_minor, half_major = half.T
    angles = np.degrees(np.arctan2(axes[:, 1, 1], axes[:, 0, 1]))
    ax.add_collection(
        EllipseCollection(
            2 * half_major,
            2 * half_minor,
            angles,
            units="xy",
            offsets=points[known],
            offset_transform=ax.transData,
            facecolors=(color, 0.12),
            edgecolors=color,
            linewidths=0.7,
            zorder=zorder - 0.05,
        )
    )
    symbol = Line2D([], [], color=color, linestyle="none", marker="o", markersize=9, alpha=1.0)
    symbol.set(markerfacecolor=(color, 0.12), markeredgecolor=color, markeredgewidth=0.7)
    where = "" if frame is None else f"\n(frame: {frame.replace('_', ' ')})"
    return [(symbol, f"{100 * COVERED:.0f} % ellipse{where}")]
