# SPDX-License-Identifier: MIT OR Apache-2.0
"""Figures of sweeps: failure rates and errors. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, cast

import numpy as np

from bearslam.data.checks import FloatArray, choice
from bearslam.errors import InvalidInputError
from bearslam.montecarlo.grid import Start
from bearslam.montecarlo.result import Result
from bearslam.montecarlo.table import degrees
from bearslam.plotting.style import ESTIMATE, LINEAR, PAPER, TRUTH

try:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator
except ImportError:
    raise ImportError('pictures need matplotlib: pip install "bearslam[plot]"') from None

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_errors", "draw_failures"]


@dataclass(frozen=True)
class Stroke:
    """Style and label of a start."""

    color: str
    marker: str
    line: Literal["-", "--", "-.", ":"]
    width: float
    name: str


# The colours of `bearslam.plotting.style`. Markers and lines tell the starts apart without them, and widths where they
# coincide.
STROKES = {
    "random": Stroke("#e69f00", "s", "-.", 1.6, "random start"),
    "projective": Stroke(PAPER.color, "D", "--", 2.6, "projective start"),
    "calibrated": Stroke(LINEAR.color, "^", ":", 2.2, "calibrated start"),
    "solve": Stroke(ESTIMATE.color, "o", "-", 1.3, "solve"),
}
BOUND = TRUTH.color
PLAIN = "#808080"
DARK = 0.54
"""Share of failures above which numbers are white."""
ERRORS = {
    "position": ("position error [m]", 1.0),
    "heading": ("heading error [deg]", 180 / np.pi),
}
"""Label of each quantity, and factor from the unit of the sweep to that of the label."""


def draw_failures(result: Result, *, starts: Sequence[Start] | None = None) -> Figure:
    """Heat maps of the failures in percent, as in figure 11 of Dellaert and Stroupe.

    Parameters
    ----------
    result : SweepResult
        What to draw.
    starts : sequence of str, optional
        The columns; by default all starts of the sweep.

    Returns
    -------
    matplotlib.figure.Figure
        A row for each layout and noise. White is 0 %, black 100 %, hatched is not done.

    Raises
    ------
    InvalidInputError
        If the sweep has no such start.
    """
    chosen = _starts(result, starts)
    layouts, noises, views, landmarks = result.grid.shape
    rates = {start: rate.reshape(result.grid.shape) for start, rate in result.failure_rate.items()}
    rows = [(i, k) for i in range(layouts) for k in range(noises)]
    # Numbers must fit into their cells, and labels beside their maps.
    width, height = max(0.36 * landmarks, 1.3), max(0.25 * views, 0.8)
    size = max(len(chosen) * (width + 0.15) + 1.7, 4.0), len(rows) * (height + 0.25) + 0.9
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(len(rows), len(chosen), sharex=True, sharey=True, squeeze=False)
    image = None
    for (i, k), line in zip(rows, axes, strict=True):
        for start, ax in zip(chosen, line, strict=True):
            rate = rates[start][i, k]
            image = ax.imshow(rate, cmap="gray_r", vmin=0.0, vmax=1.0, origin="lower", aspect="auto")
            _numbers(ax, rate)
        noise = degrees(result.grid.noise[k])
        line[0].set_ylabel(f"{result.layout[i]}, {noise:.4g}°\nviews")
    for start, ax in zip(chosen, axes[0], strict=True):
        ax.set_title(STROKES[start].name, fontsize=10)
    axes[0, 0].set_xticks(range(landmarks), [str(count) for count in result.grid.landmarks])
    axes[0, 0].set_yticks(range(views), [str(count) for count in result.grid.views])
    for ax in axes[-1]:
        ax.set_xlabel("landmarks")
    for ax in axes.flat:
        ax.tick_params(length=0, labelsize=8)
        ax.xaxis.label.set_fontsize(9)
        ax.yaxis.label.set_fontsize(9)
        for spine in ax.spines.values():
            spine.set_linewidth(0.6)
    if image is not None:
        bar = figure.colorbar(image, ax=axes, shrink=min(1.0, 3.0 / (len(rows) * (height + 0.25))), pad=0.02)
        bar.set_label("failures", fontsize=9)
        bar.set_ticks([0, 0.25, 0.5, 0.75, 1.0], labels=["0 %", "25 %", "50 %", "75 %", "100 %"], fontsize=8)
        bar.outline.set_linewidth(0.6)
    figure.suptitle(f"Failures in percent of {_scenes(result)}", fontsize=11)
    return figure


def draw_errors(
    result: Result,
    *,
    quantity: Literal["position", "heading"] = "heading",
    starts: Sequence[Start] | None = None,
    views: int | None = None,
    landmarks: int | None = None,
) -> Figure:
    """Median and 90th percentile of the errors against noise, and below their ratio to the Cramer-Rao bound.

    Parameters
    ----------
    result : SweepResult
        What to draw; noise 0 is left out.
    quantity : {"position", "heading"}
        Which error.
    starts : sequence of str, optional
        By default all starts of the sweep.
    views, landmarks : int, optional
        Numbers of views and landmarks to select; by default all of the sweep together.

    Returns
    -------
    matplotlib.figure.Figure
        A column for each layout.

    Raises
    ------
    InvalidInputError
        If the sweep has no such start, views or landmarks, or no noise.
    """
    label, unit = ERRORS[choice("quantity", quantity, ("position", "heading"))]
    chosen = _starts(result, starts)
    noises = sorted(noise for noise in result.grid.noise if noise > 0)
    if not noises:
        raise InvalidInputError("result: expected a sweep with noise, got one without")
    columns, entries = len(result.layout), max(len(chosen), 3)
    figure = Figure(figsize=(max(3.1 * columns + 0.9, 1.45 * entries + 0.3), 5.4), layout="constrained")
    axes = figure.subplots(2, columns, sharex=True, sharey="row", squeeze=False, height_ratios=[3, 2])
    x = [degrees(noise) for noise in noises]
    for layout, (upper, lower) in zip(result.layout, axes.T, strict=True):
        upper.set_title(layout, fontsize=10)
        for start in chosen:
            totals = [
                result.total(start, layout=layout, noise=noise, views=views, landmarks=landmarks) for noise in noises
            ]
            upper.add_line(_line(STROKES[start], x, [unit * total.quantile(quantity, 0.5) for total in totals]))
            upper.add_line(_thin(STROKES[start], x, [unit * total.quantile(quantity, 0.9) for total in totals]))
            ratios = [total.heading_ratio if quantity == "heading" else total.position_ratio for total in totals]
            lower.add_line(_line(STROKES[start], x, ratios))
        lower.axhline(1.0, color=BOUND, linewidth=1.0, zorder=1.5)
        lower.set_xlabel("noise [deg]", fontsize=9)
        lower.set_xscale("log")
        for ax in (upper, lower):
            ax.autoscale_view()
    for line in axes:
        _logarithmic(line)
    for ax in axes.flat:
        ax.xaxis.set_major_locator(FixedLocator(_apart(x)))
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))
        ax.xaxis.set_minor_locator(NullLocator())
    axes[0, 0].set_ylabel(label, fontsize=9)
    axes[1, 0].set_ylabel("rms error / bound", fontsize=9)
    styles = [
        (Line2D([], [], color=PLAIN, linewidth=1.6), "median"),
        (_thin(Stroke(PLAIN, "o", "-", 0.8, "")), "90th percentile"),
        (Line2D([], [], color=BOUND, linewidth=1.0), "Cramér-Rao bound"),
    ]
    strokes = [(_line(STROKES[start]), STROKES[start].name) for start in chosen]
    nothing = (Line2D([], [], linestyle="none"), "")
    # Legends are filled column by column: the starts above, the styles below.
    above, below = ([*some, *[nothing] * (entries - len(some))] for some in (strokes, styles))
    handles, labels = zip(*(entry for pair in zip(above, below, strict=True) for entry in pair), strict=True)
    figure.legend(
        handles, labels, loc="outside lower center", ncols=entries, frameon=False, fontsize=8, handlelength=3.2
    )
    which = ", ".join(
        _range(name, (count,) if count is not None else known)
        for name, count, known in (
            ("views", views, result.grid.views),
            ("landmarks", landmarks, result.grid.landmarks),
        )
    )
    figure.suptitle(f"Errors with {which}\n{_scenes(result)}", fontsize=11)
    return figure


def _line(stroke: Stroke, x: Sequence[float] = (), y: Sequence[float] = ()) -> Line2D:
    return Line2D(
        x,
        y,
        color=stroke.color,
        linestyle=stroke.line,
        linewidth=stroke.width,
        marker=stroke.marker,
        markersize=3.2 + 1.4 * stroke.width,
    )


def _thin(stroke: Stroke, x: Sequence[float] = (), y: Sequence[float] = ()) -> Line2D:
    line = _line(stroke, x, y)
    line.set(linewidth=0.8, markersize=3.6, markerfacecolor="white", markeredgewidth=0.8)
    return line


def _apart(x: Sequence[float]) -> list[float]:
    """Those of ascending values whose tick labels do not overlap on a logarithmic axis."""
    least = (x[-1] / x[0]) ** (1 / 12)
    kept = [x[0]]
    for value in x[1:]:
        if value >= least * kept[-1]:
            kept.append(value)
    return kept


def _logarithmic(line: Iterable[Axes]) -> None:
    """A shared logarithmic y axis over at least a decade, with plain numbers."""
    axes = list(line)
    drawn = [np.asarray(one.get_ydata(), dtype=float) for ax in axes for one in ax.get_lines()]
    values = np.concatenate(drawn)
    values = values[np.isfinite(values) & (values > 0)]
    low, high = (values.min() / 1.5, values.max() * 1.5) if len(values) else (0.1, 10.0)
    wider = max(1.0, np.sqrt(10 * low / high))
    low, high = low / wider, high * wider
    for ax in axes:
        ax.set_yscale("log")
        ax.set_ylim(low, high)
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 100 * low else (1.0,)))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_formatter(FuncFormatter(lambda value, _: ""))
        ax.grid(color="#e6e6e6", linewidth=0.6)
        ax.set_axisbelow(True)
        ax.tick_params(labelsize=8)
        for side in ("top", "right"):
            ax.spines[side].set_visible(False)


def _starts(result: Result, starts: Sequence[Start] | None) -> tuple[Start, ...]:
    if starts is None:
        return result.start
    chosen: tuple[str, ...] = (starts,) if isinstance(starts, str) else tuple(starts)
    if not chosen:
        raise InvalidInputError("starts: expected at least one, got none")
    return tuple(cast("Start", choice("starts", start, result.start)) for start in chosen)


def _numbers(ax: Axes, rate: FloatArray) -> None:
    """The failures of each cell in percent."""
    for (view, landmark), share in np.ndenumerate(rate):
        if np.isnan(share):
            ax.fill(
                landmark + np.array([-0.5, 0.5, 0.5, -0.5]),
                view + np.array([-0.5, -0.5, 0.5, 0.5]),
                facecolor="white",
                edgecolor="#b0b0b0",
                hatch="////",
                linewidth=0.0,
            )
        else:
            color = "white" if share > DARK else "black"
            ax.text(landmark, view, _percent(share), color=color, ha="center", va="center", fontsize=7.5)


def _percent(share: float) -> str:
    """Whole percents, but never 0 or 100 for a share in between."""
    percents = 100 * share
    if 0 < percents < 0.5:
        return "<1"
    if 99.5 <= percents < 100:
        return ">99"
    return f"{percents:.0f}"


def _scenes(result: Result) -> str:
    """Number of scenes per cell, in words."""
    scenes = f"{result.trials:,} scene{'s' if result.trials != 1 else ''} per cell".replace(",", "\u2009")
    return scenes if result.complete else f"{scenes} (not all done)"


def _range(name: str, values: Sequence[int]) -> str:
    return f"{values[0]} {name}" if len(values) == 1 else f"{min(values)} to {max(values)} {name}"
