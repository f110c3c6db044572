# SPDX-License-Identifier: MIT OR Apache-2.0
"""Pictures of maps. Needs matplotlib, which the rest of the package does without."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from bearslam.atomic import replacing
from bearslam.coerce import FloatArray
from bearslam.errors import InvalidInputError
from bearslam.maps import Map, MapLike, pick, register

try:
    import matplotlib as mpl
    from matplotlib.artist import Artist
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.legend_handler import HandlerTuple
    from matplotlib.lines import Line2D
except ImportError as error:  # pragma: no cover
    raise ImportError('pictures need matplotlib: pip install "bearslam[plot]"') from error

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bearslam.problem import Sightings
    from bearslam.reconstruction import Reconstruction

__all__ = ["ESTIMATE", "FORMATS", "LINEAR", "TRUTH", "Entry", "Look", "draw_map", "draw_rays", "finish", "plot"]

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
        from matplotlib import pyplot

        _, ax = pyplot.subplots(layout="constrained")
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
            np.stack([turned.real, turned.imag], axis=-1),
            facecolors=face,
            edgecolors=look.color,
            linewidths=1.1,
            joinstyle="round",
            zorder=look.zorder,
        )
    )
    style = {
        "color": look.color,
        "markerfacecolor": face,
        "markeredgecolor": look.color,
        "markeredgewidth": 1.1,
        "linestyle": "none",
    }
    ax.plot(*drawn.landmarks.T, marker=look.marker, markersize=look.size, zorder=look.zorder, **style)
    if names is not None and len(drawn.poses) <= LABELLED:
        for name, (px, py, heading) in zip(names, drawn.poses, strict=True):
            if np.isfinite(px + py + heading):
                away = 0.045 * scale * np.exp(1j * (heading + np.pi))
                ax.text(
                    px + away.real, py + away.imag, str(name), color=look.color, fontsize=8, ha="center", va="center"
                )
    ax.autoscale_view()
    robot = Line2D([], [], marker=(3, 0, -90), markersize=9, **style)
    landmark = Line2D([], [], marker=look.marker, markersize=look.size, **style)
    return (robot, landmark), label


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
    ax.add_collection(LineCollection(lines, colors=RAY, linewidths=width, alpha=0.7, zorder=1.0))
    return Line2D([], [], color=RAY, linewidth=0.9), label


def finish(ax: Axes, unit: str, entries: Sequence[Entry]) -> None:
    """Equal scales, named axes and a legend beside the map."""
    ax.set_aspect("equal", adjustable="datalim" if ax.get_autoscale_on() else "box")
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


def check_name(path: str | os.PathLike[str]) -> str:
    """The kind of picture that a file name stands for."""
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise InvalidInputError(f"expected the name of a picture in {', '.join(FORMATS)}, got {os.fspath(path)!r}")
    return suffix


def save_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure to a file, in one step; the same figure gives the same bytes."""
    kind = check_name(path)[1:]
    dates = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
    with mpl.rc_context({"svg.hashsalt": "bearslam"}), replacing(path) as file:
        figure.savefig(file, format=kind, dpi=200, metadata=dates[kind])
