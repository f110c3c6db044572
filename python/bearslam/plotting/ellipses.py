# SPDX-License-Identifier: MIT OR Apache-2.0
"""Covariances in figures, as ellipses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bearslam.data.checks import FloatArray
from bearslam.plotting.legend import Entry
from bearslam.plotting.style import HEAVY, shrunk

try:
    from matplotlib.collections import EllipseCollection
    from matplotlib.lines import Line2D
except ImportError:
    raise ImportError('pictures need matplotlib: pip install "bearslam[plot]"') from None

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["COVERED", "RADIUS", "draw_ellipses"]

COVERED = 0.95
"""Probability that a point lies within its ellipse, for Gaussian errors."""
RADIUS = float(np.sqrt(-2.0 * np.log(1.0 - COVERED)))
"""Radius of the ellipse in standard deviations; its square is the chi-square quantile for two degrees of freedom."""
LARGE = 0.25
"""Semi-major axis, as a share of the map, above which an ellipse does not enlarge the frame."""
WIDTH = 0.9
STYLE: dict[str, Any] = {"facecolors": "none", "edgecolors": "#e69f00"}
"""Orange of Okabe and Ito, which stands out from the robots and landmarks below the ellipses."""


def draw_ellipses(
    ax: Axes,
    points: FloatArray,
    covariances: FloatArray,
    stretched: FloatArray,
    scale: float,
    note: str,
    zorder: float,
) -> list[Entry]:
    """Draw ellipses around points (k, 2) for covariances (k, 2, 2), which `stretched` takes into their frame.

    Unbounded ones are left out. The note is added to the legend.

    Returns the entries of the legend, none without ellipses.
    """
    known = np.isfinite(points).all(axis=1) & np.isfinite(covariances).all(axis=(1, 2))
    if not known.any():
        return []
    points, covariances = points[known], stretched @ covariances[known] @ stretched.T
    squares, axes = np.linalg.eigh(covariances)
    # By rounding, the variance of what is held fixed may be slightly negative.
    minor, major = RADIUS * np.sqrt(np.maximum(squares, 0.0)).T
    ellipses = EllipseCollection(
        2 * major,
        2 * minor,
        np.degrees(np.arctan2(axes[:, 1, 1], axes[:, 0, 1])),
        units="xy",
        offsets=points,
        offset_transform=ax.transData,
        zorder=zorder,
        linewidths=WIDTH * shrunk(len(points), 70, 0.5),
        rasterized=len(points) > HEAVY,
        **STYLE,
    )
    ellipses.set_in_layout(False)  # clipped to the axes, however large they are
    ax.add_collection(ellipses)
    reach = RADIUS * np.sqrt(np.maximum(np.diagonal(covariances, axis1=1, axis2=2), 0.0))
    small = major < LARGE * scale
    ax.update_datalim(np.concatenate([(points - reach)[small], (points + reach)[small]]))
    ax.autoscale_view()
    symbol = Line2D([], [], linestyle="none", marker="o", markersize=9, markeredgewidth=WIDTH)
    symbol.set(markerfacecolor=STYLE["facecolors"], markeredgecolor=STYLE["edgecolors"])
    return [(symbol, f"{100 * COVERED:.0f} % ellipse" + (f"\n({note})" if note else ""))]
