# SPDX-License-Identifier: MIT OR Apache-2.0
"""Robots in figures: triangles, or lines along their odometry if there are many views."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bearslam.data.checks import FloatArray, IntArray
from bearslam.data.maps import Map
from bearslam.plotting.legend import Entry
from bearslam.plotting.odometry_chains import OdometryChains, closure_lines, pieces
from bearslam.plotting.style import ESTIMATE, HEAVY, ROBOTS, Style, colors, shrunk

try:
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.lines import Line2D
except ImportError:
    raise ImportError('pictures need matplotlib: pip install "bearslam[plot]"') from None

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["MANY", "draw_closures", "draw_ends", "draw_paths", "draw_triangles", "headed", "triangles"]

MANY = 60
"""Number of views above which robots with odometry are drawn as lines."""
ARROWS = 24
"""Number of triangles along all lines of a map, which show the direction of travel."""
TRIANGLE = np.array([[1.0, 0.0], [-0.7, 0.6], [-0.7, -0.6]])
SIZE = 0.022
"""Size of a triangle among few, as a share of the map."""


def triangles(poses: FloatArray, size: float) -> FloatArray:
    """Corners (k, 3, 2) of triangles for the known poses; the first corner is the tip."""
    x, y, theta = poses[np.isfinite(poses).all(axis=1)].T
    corners = np.exp(1j * theta)[:, None] * (TRIANGLE @ [1, 1j]) * size + (x + 1j * y)[:, None]
    return np.stack([corners.real, corners.imag], axis=-1)


def headed(drawn: Map, scale: float) -> FloatArray:
    """Corners (k, 3, 2) of triangles for all known poses of a map, smaller if there are many."""
    known = int(np.isfinite(drawn.poses).all(axis=1).sum())
    return triangles(drawn.poses, SIZE * scale * shrunk(known, 10, 0.0))


def draw_triangles(ax: Axes, corners: FloatArray, style: Style, color: str | Sequence[str]) -> None:
    """Draw robots as triangles that point along their heading."""
    ax.add_collection(
        PolyCollection(
            list(corners),
            facecolors=color if style.filled else "none",
            edgecolors=color,
            linewidths=1.1 * shrunk(len(corners), 2 * MANY, 0.3),
            joinstyle="round",
            zorder=style.zorder,
            rasterized=len(corners) > HEAVY,
        )
    )


def draw_paths(ax: Axes, drawn: Map, of: OdometryChains, style: Style, scale: float, *, arrows: bool) -> None:
    """Draw robots as lines through their views with triangles at intervals, and views on no line as triangles."""
    own = colors(len(of.robots), style) if arrows else (style.color,) * len(of.robots)
    lone = np.ones(len(drawn.poses), dtype=bool)
    lines: list[FloatArray] = []
    views: list[IntArray] = []
    shades: list[str] = []
    for robot, color in zip(of.robots, own, strict=True):
        for piece in pieces(robot, drawn.poses[:, :2]):
            lone[piece] = False
            lines.append(drawn.poses[piece, :2])
            views.append(piece)
            shades.append(color)
    width = (1.3 if arrows else 0.8) * shrunk(len(drawn.poses), 1000, 0.7)
    ax.add_collection(
        LineCollection(lines, colors=shades, linewidths=width, capstyle="round", joinstyle="round", zorder=style.zorder)
    )
    if arrows and lines:
        chosen, marked = _spread(lines, views, shades)
        draw_triangles(ax, triangles(drawn.poses[chosen], 0.45 * SIZE * scale), style, marked)
    left = Map(drawn.poses[lone], drawn.landmarks)
    if np.isfinite(left.poses).all(axis=1).any():
        draw_triangles(ax, headed(left, scale), style, style.color)


def _spread(
    lines: Sequence[FloatArray], views: Sequence[IntArray], shades: Sequence[str]
) -> tuple[IntArray, tuple[str, ...]]:
    """Views evenly spaced along the lines, and their colours."""
    steps = [np.hypot(*np.diff(line, axis=0).T) for line in lines]
    total = sum(float(step.sum()) for step in steps)
    if total == 0:
        return np.empty(0, dtype=np.intp), ()
    gap = total / ARROWS
    chosen, marked = [], []
    for step, view, shade in zip(steps, views, shades, strict=True):
        gone = np.concatenate([[0.0], step.cumsum()])
        at = np.arange(0.5 * gap, gone[-1], gap)
        chosen += view[np.searchsorted(gone, at)].tolist()
        marked += [shade] * len(at)
    return np.array(chosen, dtype=np.intp), tuple(marked)


def draw_ends(ax: Axes, drawn: Map, of: OdometryChains, style: Style) -> Entry:
    """Mark the start of each robot with a hollow diamond and its end with a filled one."""
    size = 7.0 * shrunk(len(of.robots), len(ROBOTS), 0.4)
    for robot, color in zip(of.robots, colors(len(of.robots), style), strict=True):
        known = robot[np.isfinite(drawn.poses[robot, :2]).all(axis=1)]
        for view, face in zip(known[[0, -1]] if len(known) else (), ("white", color), strict=False):
            ax.add_line(_diamond(color, face, size, style.zorder + 0.2, *drawn.poses[view : view + 1, :2].T))
    several = len(set(colors(len(of.robots), style))) > 1
    color = "black" if several else style.color
    return (_diamond(color, "white", 6.0, 0.0), _diamond(color, color, 6.0, 0.0)), "start, end"


def _diamond(color: str, face: str, size: float, zorder: float, x: Any = (), y: Any = ()) -> Line2D:
    line = Line2D(x, y, linestyle="none", marker="D", markersize=size, zorder=zorder)
    line.set(markerfacecolor=face, markeredgecolor=color, markeredgewidth=1.4)
    return line


def draw_closures(ax: Axes, drawn: Map, of: OdometryChains) -> list[Entry]:
    """Draw motions between views that are not consecutive as thin lines; no entries without them."""
    lines = closure_lines(of, drawn.poses[:, :2])
    if len(lines) == 0:
        return []
    style: dict[str, Any] = {"colors": "#808080", "linewidths": 0.6 * shrunk(len(lines), 50, 0.4)}
    ax.add_collection(LineCollection(list(lines), zorder=ESTIMATE.zorder - 0.1, rasterized=len(lines) > HEAVY, **style))
    return [(Line2D([], [], color="#808080", linewidth=0.8), "loop closure")]
