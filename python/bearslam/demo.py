# SPDX-License-Identifier: MIT OR Apache-2.0
"""The paper's two robot experiments, simulated: from bearings to a picture."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from bearslam.errors import DegenerateError
from bearslam.maps import Errors, compare
from bearslam.reconstruction import Reconstruction
from bearslam.report import columns
from bearslam.simulate import Layout, Scene, simulate
from bearslam.solve import initialize, solve

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["EXPERIMENTS", "Experiment", "Row", "measure", "run"]

WIDTH, HEIGHT = 7.0, 5.0
REPEATS = 25


@dataclass(frozen=True)
class Experiment:
    """One of the paper's two robot experiments, and the figure that shows it there."""

    name: str
    title: str
    layout: Layout
    noise_deg: float
    seed: int

    def scene(self) -> Scene:
        """The four robots and nine landmarks, and what the robots see."""
        noise = math.radians(self.noise_deg)
        return simulate(self.layout, 4, 9, noise=noise, seed=self.seed, width=WIDTH, height=HEIGHT)


EXPERIMENTS = (
    Experiment("figure_9", "Four robots among nine landmarks", "mixed", 2.23, 3),
    Experiment("figure_10", "Four robots ringed by nine landmarks", "enclosed", 1.53, 1),
)


@dataclass(frozen=True)
class Row:
    """One way to solve a scene: its map, or why there is none, its errors and its time [s]."""

    name: str
    result: Reconstruction | DegenerateError
    errors: Errors | None
    seconds: float


def measure(scene: Scene, noise_rad: float) -> list[Row]:
    """The scene solved in three ways: linearly as in the paper, linearly as here, and with the refinement."""
    ways: dict[str, Callable[[], Reconstruction]] = {
        "linear, projective tensor": lambda: initialize(scene.bearings, sigma=noise_rad, method="projective"),
        "linear, calibrated tensor": lambda: initialize(scene.bearings, sigma=noise_rad, method="calibrated"),
        "solve: search and refine": lambda: solve(scene.bearings, sigma=noise_rad),
    }
    return [_timed(name, way, scene) for name, way in ways.items()]


def run(folder: str | os.PathLike[str]) -> Iterator[str]:
    """Solve both experiments and draw them into a folder, telling what happens paragraph by paragraph."""
    from bearslam.plot import save_figure

    yield "From bearings alone to a map: the two robot experiments of Dellaert and Stroupe (ICRA 2002), simulated."
    Path(folder).mkdir(parents=True, exist_ok=True)
    for experiment in EXPERIMENTS:
        scene = experiment.scene()
        rows = measure(scene, math.radians(experiment.noise_deg))
        yield _paragraph(experiment, scene, rows)
        figure = picture(experiment, scene, rows)
        paths = [Path(folder, experiment.name + suffix) for suffix in (".png", ".svg")]
        for path in paths:
            save_figure(figure, path)
        yield f"  written: {', '.join(map(str, paths))}"
    yield (
        "Errors are root mean squares after the similarity that fits all points best; "
        f"times are medians of {REPEATS} runs."
    )


def picture(experiment: Experiment, scene: Scene, rows: list[Row]) -> Figure:
    """Truth, linear estimate, refined estimate and bearings in one map."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    from bearslam.maps import pick
    from bearslam.plot import ESTIMATE, LINEAR, TRUTH, draw_map, draw_offsets, draw_rays, extent, finish, laid_over

    figure = Figure(figsize=(8.0, 4.6), layout="constrained")
    ax = figure.add_subplot()
    ax.add_patch(Rectangle((0, 0), WIDTH, HEIGHT, fill=False, edgecolor="#bfbfbf", linewidth=1.0, zorder=0.5))
    truth = pick("truth", scene)
    scale = extent(truth)
    entries = [draw_map(ax, truth, TRUTH, "truth", scale)]
    linear, refined = rows[0], rows[-1]
    if isinstance(linear.result, Reconstruction):
        drawn = laid_over(pick("linear", linear.result), truth)
        entries.append(draw_map(ax, drawn, LINEAR, "linear estimate", scale))
        draw_offsets(ax, truth, drawn, LINEAR)
    if isinstance(refined.result, Reconstruction):
        drawn = laid_over(pick("refined", refined.result), truth)
        entries.append(draw_map(ax, drawn, ESTIMATE, "refined estimate", scale, "1234"))
        entries.append(draw_rays(ax, drawn, refined.result.sightings, "measured bearing"))
    ax.set_title(f"{experiment.title}, bearings with {experiment.noise_deg:g}° noise", loc="left", fontsize=11)
    finish(ax, "m", entries)
    return figure


def _timed(name: str, way: Callable[[], Reconstruction], scene: Scene) -> Row:
    seconds = []
    result: Reconstruction | DegenerateError
    for _ in range(REPEATS):
        start = time.perf_counter()
        try:
            result = way()
        except DegenerateError as error:
            result = error
        seconds.append(time.perf_counter() - start)
    errors = compare(result, scene) if isinstance(result, Reconstruction) else None
    return Row(name, result, errors, median(seconds))


def _paragraph(experiment: Experiment, scene: Scene, rows: list[Row]) -> str:
    head = ("", "residual rms", "robots", "landmarks", "headings", "time")
    units = ("", "[deg]", "[m]", "[m]", "[deg]", "[ms]")
    lines = [head, units]
    notes = []
    for row in rows:
        milliseconds = f"{1e3 * row.seconds:.3f}"
        if isinstance(row.result, Reconstruction) and row.errors is not None:
            lines.append(
                (
                    row.name,
                    f"{math.degrees(row.result.rms):.2f}",
                    f"{row.errors.position:.3f}",
                    f"{row.errors.landmark:.3f}",
                    f"{math.degrees(row.errors.heading):.2f}",
                    milliseconds,
                )
            )
        else:
            lines.append((row.name, "-", "-", "-", "-", milliseconds))
            notes.append(f"{row.name}: {row.result}")
    title = (
        f"{experiment.title}: {scene.bearings.size} bearings with {experiment.noise_deg:g} deg noise "
        f"in an arena of {WIDTH:g} x {HEIGHT:g} m"
    )
    table = columns(lines)
    return "\n".join([title, *(f"  {line}" for line in [*table.splitlines(), *notes])])
