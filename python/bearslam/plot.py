# SPDX-License-Identifier: MIT OR Apache-2.0
"""Pictures of maps. Needs matplotlib, which the rest of the package does without."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bearslam.atomic import replacing
from bearslam.coerce import FloatArray
from bearslam.ellipses import draw_ellipses
from bearslam.files import kind
from bearslam.maps import Map, MapLike, pick, register
from bearslam.reconstruction import outliers
from bearslam.report import printable

try:
    import matplotlib as mpl
    from matplotlib.artist import Artist
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.legend_handler import HandlerTuple
    from matplotlib.lines import Line2D
    from matplotlib.patheffects import withStroke
except ImportError:
    raise ImportError('pictures need matplotlib: pip install "bearslam[plot]"') from None

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bearslam.align import Similarity
    from bearslam.problem import Sightings
    from bearslam.reconstruction import Reconstruction

__all__ = [
    "ESTIMATE",
    "FORMATS",
    "LINEAR",
    "PAPER",
    "TRUTH",
    "Entry",
    "Look",
    "draw_map",
    "draw_names",
    "draw_offsets",
    "draw_outliers",
    "draw_rays",
    "draw_to_file",
    "extent",
    "finish",
    "laid_over",
    "legend",
    "plot",
    "save_figure",
    "sight_lines",
]

FORMATS = (".png", ".svg", ".pdf")
Entry: TypeAlias = tuple[Artist | tuple[Artist, ...], str]
"""Of the legend: one symbol or several, and what they stand for."""


@dataclass(frozen=True)
class Look:
    """How one map among several is drawn."""

    color: str
    marker: str
    size: float
    filled: bool
    zorder: float


# The colours are those of Okabe and Ito, which every kind of colour vision tells apart; shape and filling tell the maps
# apart in black and white.
TRUTH = Look("#404040", "s", 8.0, filled=False, zorder=3.0)
PAPER = Look("#d55e00", "D", 5.0, filled=False, zorder=3.2)
LINEAR = Look("#009e73", "P", 5.5, filled=True, zorder=3.3)
ESTIMATE = Look("#0072b2", "o", 4.0, filled=True, zorder=3.4)
RAY = "#56b4e9"
WRONG = "#cc79a7"
TRIANGLE = np.array([[1.0, 0.0], [-0.7, 0.6], [-0.7, -0.6]])
SIZE = (8.0, 5.0)
"""Of a figure, with room for the legend beside the map [inches]."""
LABELLED = 30
"""Robots that are labelled; more labels than that hide the map."""
SHOWN = 5.0
"""Points that are farther from the middle than so many times most of the others are left out of the frame."""


def plot(result: Reconstruction, ax: Axes | None = None, truth: MapLike | None = None) -> Axes:
    """Draw a reconstruction; see `Reconstruction.plot`."""
    if ax is None:
        import matplotlib.pyplot as plt

        _, ax = plt.subplots(figsize=SIZE, layout="constrained")
    shown = Map(result.poses, result.landmarks)
    stretched = np.eye(2)
    if truth is None:
        scale = extent(shown)
        entries = []
    else:
        target = pick("truth", truth, len(shown.poses), len(shown.landmarks))
        similarity = register(shown, target)
        shown, stretched = _moved(shown, similarity), _stretch(similarity)
        scale = extent(target)
        entries = [draw_map(ax, target, TRUTH, "truth", scale)]
    entries.append(draw_map(ax, shown, ESTIMATE, "estimate", scale))
    if result.pose_covariance is not None and result.landmark_covariance is not None:
        covariances = np.concatenate([result.pose_covariance[:, :2, :2], result.landmark_covariance])
        points = np.concatenate([shown.poses[:, :2], shown.landmarks])
        frame_of = result.covariance_frame
        entries += draw_ellipses(ax, points, covariances, stretched, scale, frame_of, ESTIMATE.zorder + 0.05)
    wrong = outliers(result)
    lines, dashed = (sight_lines(shown, result.sightings, which, oriented=result.oriented) for which in (~wrong, wrong))
    entries.append(draw_rays(ax, lines, "bearing"))
    if len(dashed):
        entries.append(draw_outliers(ax, dashed))
        lines = np.concatenate([lines, dashed])
    draw_names(ax, shown, ESTIMATE, scale, result.view_ids or range(len(shown.poses)), lines)
    finish(ax, "map units" if truth is None else "m")
    frame(ax, shown)
    ax.legend(**legend(entries), loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
    return ax


def laid_over(source: Map, target: Map) -> Map:
    """A map moved into the frame of another, by the similarity that fits best."""
    return _moved(source, register(source, target))


def _moved(source: Map, similarity: Similarity) -> Map:
    return Map(similarity.apply_poses(source.poses), similarity.apply(source.landmarks))


def _stretch(similarity: Similarity) -> FloatArray:
    """The matrix of a similarity, without its translation."""
    c, s = similarity.scale * np.cos(similarity.angle), similarity.scale * np.sin(similarity.angle)
    return np.array([[c, -s], [s, c]])


def extent(of: Map) -> float:
    """Length of the diagonal of the box around a map, points far from all others apart."""
    points = _central(of)
    return float(np.hypot(*np.ptp(points, axis=0))) if len(points) else 1.0


def frame(ax: Axes, drawn: Map) -> None:
    """Axes as wide as the map, points far from all others apart: a landmark near infinity would make a dot of it."""
    points = _central(drawn)
    if len(points) < sum(np.isfinite(part).all(axis=1).sum() for part in drawn):
        margin = 0.1 * extent(drawn)
        ax.set_xlim(points[:, 0].min() - margin, points[:, 0].max() + margin)
        ax.set_ylim(points[:, 1].min() - margin, points[:, 1].max() + margin)


def _central(of: Map) -> FloatArray:
    points: FloatArray = np.concatenate([of.poses[:, :2], of.landmarks])
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) == 0:
        return points
    away = np.hypot(*(points - np.median(points, axis=0)).T)
    central: FloatArray = points[away <= SHOWN * np.quantile(away, 0.75)]
    return central


def draw_map(ax: Axes, drawn: Map, look: Look, label: str, scale: float) -> Entry:
    """Robots as triangles that point where they head, landmarks as markers; what is undetermined is left out."""
    face = look.color if look.filled else "none"
    ax.add_collection(
        PolyCollection(
            list(_triangles(drawn, scale)),
            facecolors=face,
            edgecolors=look.color,
            linewidths=1.1,
            joinstyle="round",
            zorder=look.zorder,
        )
    )

    def symbol(marker: str, size: float, x: ArrayLike = (), y: ArrayLike = ()) -> Line2D:
        line = Line2D(x, y, color=look.color, linestyle="none", marker=marker, markersize=size, zorder=look.zorder)
        line.set(markerfacecolor=face, markeredgecolor=look.color, markeredgewidth=1.1)
        return line

    ax.add_line(symbol(look.marker, look.size, *drawn.landmarks.T))
    ax.autoscale_view()
    return (symbol(">", 8.0), symbol(look.marker, look.size)), label


def _triangles(drawn: Map, scale: float) -> FloatArray:
    """Corners (k, 3, 2) of the robots."""
    x, y, theta = drawn.poses[np.isfinite(drawn.poses).all(axis=1)].T
    size = 0.022 * scale * min(1.0, (10 / max(len(x), 1)) ** 0.5)
    corners = np.exp(1j * theta)[:, None] * (TRIANGLE @ [1, 1j]) * size + (x + 1j * y)[:, None]
    return np.stack([corners.real, corners.imag], axis=-1)


def draw_names(
    ax: Axes, drawn: Map, look: Look, scale: float, names: Sequence[object], lines: FloatArray, *others: Map
) -> None:
    """Names beside the robots, where they are farthest from lines and from the points of this and other maps."""
    if len(drawn.poses) > LABELLED:
        return
    edges = [lines]
    points = []
    for one in (drawn, *others):
        corners = _triangles(one, scale)
        edges += [np.stack([corners[:, k - 1], corners[:, k]], axis=1) for k in range(3)]
        points.append(one.landmarks)
    start, end = np.concatenate(edges).transpose(1, 0, 2)
    along = np.linspace(0.0, 1.0, 101)[:, None, None]
    occupied = np.concatenate([(start + along * (end - start)).reshape(-1, 2), *points]) @ [1, 1j]
    occupied = occupied[np.isfinite(occupied)]
    away = (0.04 if len(drawn.poses) <= 10 else 0.03) * scale
    for name, (x, y, heading) in zip(names, drawn.poses, strict=True):
        if np.isfinite(x + y + heading):
            around = heading + np.pi + np.linspace(-2.4, 2.4, 49)  # where the triangle has no tip
            places = x + 1j * y + away * np.exp(1j * around)
            place = places[np.argmax(np.abs(places[:, None] - occupied).min(axis=1).round(6))]
            occupied = np.append(occupied, place + 0.01 * scale * np.array([0, 1, -1]))
            text = ax.text(
                place.real, place.imag, printable(name), color=look.color, fontsize=8, clip_on=True, parse_math=False
            )
            text.set(ha="center", va="center", zorder=look.zorder + 1)
            text.set_path_effects([withStroke(linewidth=2.0, foreground="white")])


def draw_offsets(ax: Axes, start: Map, end: Map, look: Look) -> None:
    """Thin lines between what is the same in two maps."""
    lines = np.stack([np.concatenate([one.poses[:, :2], one.landmarks]) for one in (start, end)], axis=1)
    lines = lines[np.isfinite(lines).all(axis=(1, 2))]
    ax.add_collection(
        LineCollection(list(lines), colors=look.color, linewidths=0.8, linestyles=":", zorder=look.zorder - 0.1)
    )


def sight_lines(
    drawn: Map, sightings: Sightings, which: NDArray[np.bool_] | slice = slice(None), *, oriented: bool = True
) -> FloatArray:
    """Start and end (k, 2, 2) of every bearing as it was measured, from the robot as far as the landmark."""
    poses, points = drawn.poses[sightings.view[which]], drawn.landmarks[sightings.landmark[which]]
    start = poses[:, :2]
    reach = np.hypot(*(points - start).T)
    direction = poses[:, 2] + sightings.bearing[which]
    away = np.column_stack([np.cos(direction), np.sin(direction)])
    if not oriented:  # a line goes both ways: to where the landmark is
        away *= np.where((away * (points - start)).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    end = start + reach[:, None] * away
    lines: FloatArray = np.stack([start, end], axis=1)
    return lines[np.isfinite(lines).all(axis=(1, 2))]


def draw_rays(ax: Axes, lines: FloatArray, label: str) -> Entry:
    """Bearings as thin lines."""
    few = min(1.0, 150 / max(len(lines), 1))
    look = {"linewidths": max(0.7 * few, 0.3), "alpha": max(0.6 * few, 0.1)}
    ax.add_collection(LineCollection(list(lines), colors=RAY, zorder=1.0, **look))
    return Line2D([], [], color=RAY, linewidth=0.9), label


def draw_outliers(ax: Axes, lines: FloatArray) -> Entry:
    """Bearings that are not explained, dashed; above the others, for they are what one looks for."""
    look = {"colors": WRONG, "linewidths": 1.0, "linestyles": (0, (4, 2))}
    ax.add_collection(LineCollection(list(lines), zorder=1.2, **look))
    return Line2D([], [], color=WRONG, linewidth=1.0, linestyle=(0, (4, 2))), "outlier"


def finish(ax: Axes, unit: str) -> None:
    """Equal scales and named axes."""
    ax.set_aspect("equal", adjustable="box")
    ax.set_xlabel(f"x [{unit}]")
    ax.set_ylabel(f"y [{unit}]")
    ax.grid(color="#e6e6e6", linewidth=0.6)
    ax.set_axisbelow(True)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)


def legend(entries: Sequence[Entry]) -> dict[str, Any]:
    """Arguments for a legend with these entries, wherever it goes."""
    handles, labels = zip(*entries, strict=True)
    return {
        "handles": handles,
        "labels": labels,
        "handler_map": {tuple: HandlerTuple(ndivide=None, pad=0.6)},
        "handlelength": 2.4,
        "frameon": False,
    }


def draw_to_file(result: Reconstruction, path: str | os.PathLike[str], truth: MapLike | None = None) -> None:
    """Draw a reconstruction into a file, over the truth where there is one."""
    from matplotlib.figure import Figure

    width = 8.0 if result.covariance_frame is None else 8.5  # the legend says the frame
    figure = Figure(figsize=(width, 5.0), layout="constrained")
    plot(result, figure.add_subplot(), truth)
    save_figure(figure, path)


def save_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure to a file, in one step; the same figure gives the same bytes."""
    suffix = kind(path, FORMATS)
    undated: dict[str, dict[str, str | None]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    with (
        mpl.rc_context({"svg.hashsalt": "bearslam"}),
        warnings.catch_warnings(),
        replacing(path) as file,
    ):
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font", UserWarning)  # a box stands for it
        figure.savefig(file, format=suffix[1:], dpi=200, metadata=undated[suffix])
