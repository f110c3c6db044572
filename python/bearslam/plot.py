# SPDX-License-Identifier: MIT OR Apache-2.0
"""Pictures of maps. Needs matplotlib, which the rest of the package does without."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from bearslam.atomic import replacing
from bearslam.files import kind
from bearslam.maps import Map, MapLike, pick, register

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

    from bearslam.problem import Sightings
    from bearslam.reconstruction import Reconstruction

__all__ = [
    "ESTIMATE",
    "FORMATS",
    "LINEAR",
    "TRUTH",
    "Entry",
    "Look",
    "draw_map",
    "draw_offsets",
    "draw_rays",
    "draw_to_file",
    "extent",
    "finish",
    "laid_over",
    "plot",
    "save_figure",
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
LINEAR = Look("#d55e00", "D", 5.0, filled=False, zorder=3.2)
ESTIMATE = Look("#0072b2", "o", 4.0, filled=True, zorder=3.4)
RAY = "#56b4e9"
TRIANGLE = np.array([[1.0, 0.0], [-0.7, 0.6], [-0.7, -0.6]])
LABELLED = 40
"""Robots that are labelled; more labels than that hide the map."""


def plot(result: Reconstruction, ax: Axes | None = None, truth: MapLike | None = None) -> Axes:
    """Draw a reconstruction; see `Reconstruction.plot`."""
    if ax is None:
        import matplotlib.pyplot as plt

        _, ax = plt.subplots(layout="constrained")
    shown = Map(result.poses, result.landmarks)
    if truth is None:
        scale = extent(shown)
        entries = []
    else:
        target = pick("truth", truth, len(shown.poses), len(shown.landmarks))
        shown = laid_over(shown, target)
        scale = extent(target)
        entries = [draw_map(ax, target, TRUTH, "truth", scale)]
    entries.append(draw_map(ax, shown, ESTIMATE, "estimate", scale, result.view_ids or range(len(shown.poses))))
    entries.append(draw_rays(ax, shown, result.sightings, "bearing"))
    finish(ax, "map units" if truth is None else "m", entries)
    return ax


def laid_over(source: Map, target: Map) -> Map:
    """A map moved into the frame of another, by the similarity that fits best."""
    similarity = register(source, target)
    return Map(similarity.apply_poses(source.poses), similarity.apply(source.landmarks))


def extent(of: Map) -> float:
    """Length of the diagonal of the box around a map."""
    points = np.concatenate([of.poses[:, :2], of.landmarks])
    points = points[np.isfinite(points).all(axis=1)]
    return float(np.hypot(*np.ptp(points, axis=0))) if len(points) else 1.0


def draw_map(
    ax: Axes, drawn: Map, look: Look, label: str, scale: float, names: Sequence[object] | None = None
) -> Entry:
    """Robots as triangles that point where they head, landmarks as markers; what is undetermined is left out."""
    poses = drawn.poses[np.isfinite(drawn.poses).all(axis=1)]
    x, y, theta = poses.T
    turned = np.exp(1j * theta)[:, None] * (TRIANGLE @ [1, 1j]) * 0.022 * scale + (x + 1j * y)[:, None]
    face = look.color if look.filled else "none"
    ax.add_collection(
        PolyCollection(
            list(np.stack([turned.real, turned.imag], axis=-1)),
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
    if names is not None and len(drawn.poses) <= LABELLED:
        for name, (px, py, heading) in zip(names, drawn.poses, strict=True):
            if np.isfinite(px + py + heading):
                away = 0.045 * scale * np.exp(1j * (heading + np.pi))
                text = ax.text(px + away.real, py + away.imag, str(name), color=look.color, fontsize=8)
                text.set(ha="center", va="center", zorder=look.zorder + 1)
                text.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
    ax.autoscale_view()
    return (symbol(">", 8.0), symbol(look.marker, look.size)), label


def draw_offsets(ax: Axes, start: Map, end: Map, look: Look) -> None:
    """Thin lines between what is the same in two maps."""
    lines = np.stack([np.concatenate([one.poses[:, :2], one.landmarks]) for one in (start, end)], axis=1)
    lines = lines[np.isfinite(lines).all(axis=(1, 2))]
    ax.add_collection(
        LineCollection(list(lines), colors=look.color, linewidths=0.8, linestyles=":", zorder=look.zorder - 0.1)
    )


def draw_rays(ax: Axes, drawn: Map, sightings: Sightings, label: str) -> Entry:
    """Every bearing as it was measured, from the robot as far as the landmark."""
    poses, points = drawn.poses[sightings.view], drawn.landmarks[sightings.landmark]
    start = poses[:, :2]
    reach = np.hypot(*(points - start).T)
    direction = poses[:, 2] + sightings.bearing
    end = start + reach[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
    lines = np.stack([start, end], axis=1)
    lines = lines[np.isfinite(lines).all(axis=(1, 2))]
    width = 0.7 if len(lines) <= 300 else 0.3
    ax.add_collection(LineCollection(list(lines), colors=RAY, linewidths=width, alpha=0.6, zorder=1.0))
    return Line2D([], [], color=RAY, linewidth=0.9), label


def finish(ax: Axes, unit: str, entries: Sequence[Entry]) -> None:
    """Equal scales, named axes and a legend beside the map."""
    ax.set_aspect("equal", adjustable="box")
    ax.set_xlabel(f"x [{unit}]")
    ax.set_ylabel(f"y [{unit}]")
    ax.grid(color="#e6e6e6", linewidth=0.6)
    ax.set_axisbelow(True)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    handles, labels = zip(*entries, strict=True)
    ax.legend(
        handles,
        labels,
        handler_map={tuple: HandlerTuple(ndivide=None, pad=0.6)},
        handlelength=2.4,
        loc="upper left",
        bbox_to_anchor=(1.01, 1.0),
        borderaxespad=0.0,
        frameon=False,
    )


def draw_to_file(result: Reconstruction, path: str | os.PathLike[str]) -> None:
    """Draw a reconstruction into a file."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    plot(result, figure.add_subplot())
    save_figure(figure, path)


def save_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure to a file, in one step; the same figure gives the same bytes."""
    suffix = kind(path, FORMATS)
    undated: dict[str, dict[str, str | None]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    with mpl.rc_context({"svg.hashsalt": "bearslam"}), replacing(path) as file:
        figure.savefig(file, format=suffix[1:], dpi=200, metadata=undated[suffix])
