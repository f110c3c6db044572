# SPDX-License-Identifier: MIT OR Apache-2.0
"""Figures of maps. Needs matplotlib, which the rest of the package does not."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from bearslam.data.checks import FloatArray
from bearslam.data.estimate import Estimate, outliers
from bearslam.data.maps import Map, MapLike, pick, register
from bearslam.io.atomic import replacing
from bearslam.io.endings import ending_of
from bearslam.io.text import printable
from bearslam.io.view_names import parse_view_name
from bearslam.plotting.ellipses import draw_ellipses
from bearslam.plotting.geometry import extent, linear_part, sight_lines, transformed, without_far_points
from bearslam.plotting.legend import Entry, legend
from bearslam.plotting.odometry_chains import OdometryChains, odometry_chains
from bearslam.plotting.rays import draw_outliers, draw_rays
from bearslam.plotting.style import ESTIMATE, HEAVY, TRUTH, Style, colors, shrunk
from bearslam.plotting.trajectories import MANY, draw_closures, draw_ends, draw_paths, draw_triangles, headed

try:
    import matplotlib as mpl
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D
    from matplotlib.patheffects import withStroke
except ImportError:
    raise ImportError('pictures need matplotlib: pip install "bearslam[plot]"') from None

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["FORMATS", "draw_map", "draw_names", "draw_offsets", "draw_to_file", "finish", "plot", "save_figure"]

FORMATS = (".png", ".svg", ".pdf")
SIZE = (8.0, 5.0)
"""Size of a figure, with room for the legend beside the map [inches]."""
ENCIRCLED = 20
"""Number of views of a long trajectory that have an ellipse; more would hide the map."""
LABELLED = 30
"""Largest number of views that are labelled; more labels would hide the map."""
FEW = 50
"""Number of landmarks above which their markers shrink."""


def plot(result: Estimate, ax: Axes | None = None, truth: MapLike | None = None) -> Axes:
    """Draw a reconstruction; see `Reconstruction.plot`."""
    if ax is None:
        import matplotlib.pyplot as plt

        _, ax = plt.subplots(figsize=SIZE, layout="constrained")
    views = len(result.poses)
    shown = Map(result.poses, result.landmarks)
    paths = odometry_chains(result.odometry if views > MANY else None, views)
    stretched = np.eye(2)
    entries: list[Entry] = []
    if truth is None:
        scale = extent(shown)
    else:
        target = pick("truth", truth, views, len(shown.landmarks))
        similarity = register(shown, target)
        shown, stretched = transformed(shown, similarity), linear_part(similarity)
        scale = extent(target)
        if paths.robots:
            draw_paths(ax, target, paths, TRUTH, scale, arrows=False)
            entries.append(_landmarks(ax, target, TRUTH, "truth", _stroke(TRUTH.color)))
        else:
            entries.append(draw_map(ax, target, TRUTH, "truth", scale))
    entries += (
        _draw_paths(ax, shown, paths, scale, result.view_ids)
        if paths.robots
        else [draw_map(ax, shown, ESTIMATE, "estimate", scale)]
    )
    if result.pose_covariance is not None and result.landmark_covariance is not None:
        every = 1 if views <= MANY else -(-views // ENCIRCLED)
        covariances = np.concatenate([result.pose_covariance[::every, :2, :2], result.landmark_covariance])
        points = np.concatenate([shown.poses[::every, :2], shown.landmarks])
        of = [] if result.covariance_frame is None else [result.covariance_frame.replace("_", " ")]
        of += [f"1 view in {every}"] if every > 1 else []
        entries += draw_ellipses(ax, points, covariances, stretched, scale, ",\n".join(of), ESTIMATE.zorder + 0.05)
    wrong = outliers(result)
    lines, dashed = (sight_lines(shown, result.sightings, which, oriented=result.oriented) for which in (~wrong, wrong))
    entries.append(draw_rays(ax, lines, "bearing"))
    if len(dashed):
        entries.append(draw_outliers(ax, dashed))
        lines = np.concatenate([lines, dashed])
    draw_names(ax, shown, ESTIMATE, scale, result.view_ids or range(views), lines)
    finish(ax, "map units" if truth is None else "m")
    frame(ax, shown)
    ax.legend(**legend(entries), loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
    return ax


def _robots(paths: OdometryChains, names: Sequence[str] | None) -> list[str]:
    """Names of robots: from the names of their views, ``robot@time``, or numbers."""
    called = [None if names is None else parse_view_name(names[robot[0]]).robot for robot in paths.robots]
    return [
        str(number) if name is None or called.count(name) > 1 else printable(name) for number, name in enumerate(called)
    ]


def _draw_paths(ax: Axes, shown: Map, paths: OdometryChains, scale: float, names: Sequence[str] | None) -> list[Entry]:
    """Draw the estimate with robots as lines along their odometry."""
    draw_paths(ax, shown, paths, ESTIMATE, scale, arrows=True)
    own = colors(len(paths.robots), ESTIMATE)
    above = replace(ESTIMATE, zorder=ESTIMATE.zorder + 0.1)  # markers above ellipses that are smaller than they are
    if len(set(own)) > 1:
        entries: list[Entry] = [
            (_stroke(color), f"robot {name}") for name, color in zip(_robots(paths, names), own, strict=True)
        ]
        entries.append(_landmarks(ax, shown, replace(above, color="black"), "landmark"))
    else:
        entries = [_landmarks(ax, shown, above, "estimate", _stroke(ESTIMATE.color))]
    entries.append(draw_ends(ax, shown, paths, ESTIMATE))
    return entries + draw_closures(ax, shown, paths)


def draw_map(ax: Axes, drawn: Map, style: Style, label: str, scale: float) -> Entry:
    """Draw robots as triangles and landmarks as markers; what is undetermined is left out."""
    draw_triangles(ax, headed(drawn, scale), style, style.color)
    return _landmarks(ax, drawn, style, label, _symbol(style, ">", 8.0))


def _landmarks(ax: Axes, drawn: Map, style: Style, label: str, *before: Line2D) -> Entry:
    """Draw landmarks as markers; return a legend entry for them and the symbols `before` them."""
    points = drawn.landmarks[np.isfinite(drawn.landmarks).all(axis=1)]
    size = style.size * shrunk(len(points), FEW, 0.35)
    markers = _symbol(style, style.marker, size, *points.T)
    markers.set_rasterized(len(points) > HEAVY)
    ax.add_line(markers)
    ax.autoscale_view()
    return (*before, _symbol(style, style.marker, max(size, 0.6 * style.size))), label


def _symbol(style: Style, marker: str, size: float, x: ArrayLike = (), y: ArrayLike = ()) -> Line2D:
    line = Line2D(x, y, color=style.color, linestyle="none", marker=marker, markersize=size, zorder=style.zorder)
    line.set(markerfacecolor=style.face, markeredgecolor=style.color, markeredgewidth=min(1.1, 0.3 * size))
    return line


def _stroke(color: str) -> Line2D:
    return Line2D([], [], color=color, linewidth=1.3)


def frame(ax: Axes, drawn: Map) -> None:
    """Limit the axes to the map without points far from all others, which would shrink it to a dot."""
    points = without_far_points(drawn)
    if len(points) < sum(np.isfinite(part).all(axis=1).sum() for part in drawn):
        margin = 0.1 * extent(drawn)
        ax.set_xlim(points[:, 0].min() - margin, points[:, 0].max() + margin)
        ax.set_ylim(points[:, 1].min() - margin, points[:, 1].max() + margin)


def draw_names(
    ax: Axes, drawn: Map, style: Style, scale: float, names: Sequence[object], lines: FloatArray, *others: Map
) -> None:
    """Write names beside the robots, as far as possible from lines and from the points of this and other maps."""
    if len(drawn.poses) > LABELLED:
        return
    edges = [lines]
    points = []
    for one in (drawn, *others):
        corners = headed(one, scale)
        edges += [np.stack([corners[:, k - 1], corners[:, k]], axis=1) for k in range(3)]
        points.append(one.landmarks)
    start, end = np.concatenate(edges).transpose(1, 0, 2)
    along = np.linspace(0.0, 1.0, 101)[:, None, None]
    occupied = np.concatenate([(start + along * (end - start)).reshape(-1, 2), *points]) @ [1, 1j]
    occupied = occupied[np.isfinite(occupied)]
    away = (0.04 if len(drawn.poses) <= 10 else 0.03) * scale
    for name, (x, y, heading) in zip(names, drawn.poses, strict=True):
        if np.isfinite(x + y + heading):
            around = heading + np.pi + np.linspace(-2.4, 2.4, 49)  # away from the tip of the triangle
            places = x + 1j * y + away * np.exp(1j * around)
            place = places[np.argmax(np.abs(places[:, None] - occupied).min(axis=1).round(6))]
            occupied = np.append(occupied, place + 0.01 * scale * np.array([0, 1, -1]))
            text = ax.text(
                place.real, place.imag, printable(name), color=style.color, fontsize=8, clip_on=True, parse_math=False
            )
            text.set(ha="center", va="center", zorder=style.zorder + 1)
            text.set_path_effects([withStroke(linewidth=2.0, foreground="white")])


def draw_offsets(ax: Axes, start: Map, end: Map, style: Style) -> None:
    """Draw dotted lines between corresponding points of two maps."""
    lines = np.stack([np.concatenate([one.poses[:, :2], one.landmarks]) for one in (start, end)], axis=1)
    lines = lines[np.isfinite(lines).all(axis=(1, 2))]
    ax.add_collection(
        LineCollection(list(lines), colors=style.color, linewidths=0.8, linestyles=":", zorder=style.zorder - 0.1)
    )


def finish(ax: Axes, unit: str) -> None:
    """Set equal scales and label the axes."""
    ax.set_aspect("equal", adjustable="box")
    ax.set_xlabel(f"x [{unit}]")
    ax.set_ylabel(f"y [{unit}]")
    ax.grid(color="#e6e6e6", linewidth=0.6)
    ax.set_axisbelow(True)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)


def draw_to_file(result: Estimate, path: str | os.PathLike[str], truth: MapLike | None = None) -> None:
    """Draw a reconstruction to a file, over the truth if there is one."""
    from matplotlib.figure import Figure

    width = 8.0 if result.covariance_frame is None else 8.5  # the legend states the frame
    figure = Figure(figsize=(width, 5.0), layout="constrained")
    plot(result, figure.add_subplot(), truth)
    save_figure(figure, path, cropped=True)  # axes of equal scales leave empty margins


def save_figure(figure: Figure, path: str | os.PathLike[str], *, cropped: bool = False) -> None:
    """Write a figure to a file in one step, with empty margins cropped on request.

    The same figure gives the same bytes.
    """
    suffix = ending_of(path, FORMATS)
    undated: dict[str, dict[str, str | None]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    with (
        mpl.rc_context({"svg.hashsalt": "bearslam"}),
        warnings.catch_warnings(),
        replacing(path) as file,
    ):
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font", UserWarning)  # it is drawn as a box
        around: dict[str, Any] = {"bbox_inches": "tight", "pad_inches": 0.1} if cropped else {}
        figure.savefig(file, format=suffix[1:], dpi=200, metadata=undated[suffix], **around)
