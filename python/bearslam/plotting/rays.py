# SPDX-License-Identifier: MIT OR Apache-2.0
"""Bearings in figures, as rays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bearslam.data.checks import FloatArray
from bearslam.plotting.legend import Entry
from bearslam.plotting.style import HEAVY, RAY, WRONG

try:
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D
except ImportError:
    raise ImportError('pictures need matplotlib: pip install "bearslam[plot]"') from None

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["RAYS", "draw_outliers", "draw_rays"]

RAYS = 2000
"""Largest number of bearings drawn, outliers not counted: more would only blur the map."""


def draw_rays(ax: Axes, lines: FloatArray, label: str) -> Entry:
    """Draw bearings as thin lines: all of them, or one in k; the legend states k."""
    every = -(-len(lines) // RAYS)
    if every > 1:
        lines = lines[::every]
        label = f"{label} (1 in {every})"
    few = min(1.0, 150 / max(len(lines), 1))
    style: dict[str, Any] = {"linewidths": max(0.7 * few, 0.3), "alpha": max(0.6 * few, 0.1)}
    ax.add_collection(LineCollection(list(lines), colors=RAY, zorder=1.0, rasterized=len(lines) > HEAVY, **style))
    return Line2D([], [], color=RAY, linewidth=0.9), label


def draw_outliers(ax: Axes, lines: FloatArray) -> Entry:
    """Draw all outliers as dashed lines above the other bearings."""
    few = (50 / max(len(lines), 50)) ** 0.5
    style: dict[str, Any] = {"linewidths": max(few, 0.45), "alpha": max(few, 0.6), "linestyles": (0, (4, 2))}
    ax.add_collection(LineCollection(list(lines), colors=WRONG, zorder=1.2, rasterized=len(lines) > HEAVY, **style))
    return Line2D([], [], color=WRONG, linewidth=1.0, linestyle=(0, (4, 2))), "outlier"
