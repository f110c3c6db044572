# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command `bearslam demo`: the paper's two robot experiments, simulated, solved and drawn."""

from __future__ import annotations

import argparse
import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from bearslam.cli.report import columns
from bearslam.data.maps import Errors, compare, pick
from bearslam.errors import DegenerateError
from bearslam.plotting.geometry import aligned_to, extent, sight_lines
from bearslam.plotting.style import ESTIMATE, LINEAR, PAPER, TRUTH
from bearslam.reconstruction import Reconstruction
from bearslam.verbs.simulate import Layout, Scene, simulate
from bearslam.verbs.solve import initialize, solve

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["EXPERIMENTS", "Experiment", "Row", "add", "measure", "run"]

WIDTH, HEIGHT = 7.0, 5.0
ROBOTS, BOXES = 4, 9
MARGIN = 0.7
REPEATS = 25
SCENES = 200
"""Number of scenes of the same kind for the medians."""


@dataclass(frozen=True)
class Experiment:
    """One of the paper's two robot experiments, named after its figure in the paper."""

    name: str
    title: str
    layout: Layout
    noise_deg: float
    seed: int

    def scene(self, seed: int | None = None) -> Scene:
        """The simulated scene, or with another seed another scene of the same kind."""
        noise = math.radians(self.noise_deg)
        seed = self.seed if seed is None else seed
        return simulate(self.layout, ROBOTS, BOXES, noise=noise, seed=seed, width=WIDTH, height=HEIGHT)


# The seeds give scenes whose errors are close to the medians of their kind, in every row of the report, and whose
# figures have no overlaps.
EXPERIMENTS = (
    Experiment("figure_9", "Four robots among nine landmarks", "mixed", 2.23, 1196),
    Experiment("figure_10", "Four robots ringed by nine landmarks", "enclosed", 1.53, 574),
)


@dataclass(frozen=True)
class Row:
    """The result of one method: its map, or why there is none, its errors and its time [s]."""

    name: str
    result: Reconstruction | DegenerateError
    errors: Errors | None
    seconds: float


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    verb = verbs.add_parser(
        "demo",
        help="reproduce the paper's two robot experiments, with pictures",
        description="Simulate, solve and draw the two robot experiments of Dellaert and Stroupe.",
    )
    verb.add_argument(
        "-o", "--output", metavar="DIR", default="demo", help="folder to write the pictures to (default: %(default)s)"
    )
    verb.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> None:
    for paragraph in run(options.output):
        print(paragraph, end="\n\n", flush=True)


def measure(scene: Scene, noise_rad: float, repeats: int = REPEATS) -> list[Row]:
    """The scene solved by three methods: the projective one of the paper, the calibrated one, and with refinement."""
    ways: dict[str, Callable[[], Reconstruction]] = {
        "linear, projective (the paper's)": lambda: initialize(scene.bearings, sigma=noise_rad, method="projective"),
        "linear, calibrated": lambda: initialize(scene.bearings, sigma=noise_rad, method="calibrated"),
        "refined: bearslam.solve": lambda: solve(scene.bearings, sigma=noise_rad),
    }
    return [_timed(name, way, scene, repeats) for name, way in ways.items()]


def run(folder: str | os.PathLike[str]) -> Iterator[str]:
    """Solve both experiments, draw them into a folder, and yield a report paragraph by paragraph."""
    from bearslam.plotting.map import save_figure

    Path(folder).mkdir(parents=True, exist_ok=True)
    yield (
        "From bearings alone to a map, with no odometry and no initial guess: the two robot experiments of\n"
        "Dellaert and Stroupe (ICRA 2002), simulated."
    )
    for experiment in EXPERIMENTS:
        scene = experiment.scene()
        noise = math.radians(experiment.noise_deg)
        rows = measure(scene, noise)
        others = [measure(experiment.scene(seed), noise, 1) for seed in range(SCENES)]
        yield _paragraph(experiment, scene, rows, list(zip(*others, strict=True)))
        figure = picture(experiment, scene, rows)
        paths = [Path(folder, experiment.name + suffix) for suffix in (".png", ".svg")]
        for path in paths:
            save_figure(figure, path)
        yield f"  written: {', '.join(map(str, paths))}"
    yield (
        "Errors: root mean squares after alignment with the truth by a similarity.\n"
        "Backwards: sightings with a residual above 90 deg, of landmarks that the map places behind the robot.\n"
        f"Time: a whole call from Python, the best of {REPEATS}."
    )


def picture(experiment: Experiment, scene: Scene, rows: Sequence[Row]) -> Figure:
    """The linear estimates and the truth on the left, the refined one with the bearings on the right."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    from bearslam.plotting.legend import legend
    from bearslam.plotting.map import draw_map, draw_names, draw_offsets, finish
    from bearslam.plotting.rays import draw_rays

    figure = Figure(figsize=(10.0, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    truth = pick("truth", scene)
    scale = extent(truth)
    for ax in (left, right):
        ax.add_patch(Rectangle((0, 0), WIDTH, HEIGHT, fill=False, edgecolor="#bfbfbf", linewidth=1.0, zorder=0.5))
        truth_entry = draw_map(ax, truth, TRUTH, "truth", scale)
        finish(ax, "m")
    entries = [truth_entry]
    *linear, refined = rows
    for row, style in zip(linear, (PAPER, LINEAR), strict=True):
        if isinstance(row.result, Reconstruction):
            drawn = aligned_to(pick("linear", row.result), truth)
            entries.append(draw_map(left, drawn, style, row.name, scale))
            draw_offsets(left, truth, drawn, style)
    if isinstance(refined.result, Reconstruction):
        drawn = aligned_to(pick("refined", refined.result), truth)
        lines = sight_lines(drawn, refined.result.sightings)
        entries.append(draw_map(right, drawn, ESTIMATE, "refined", scale))
        entries.append(draw_rays(right, lines, "measured bearing"))
        draw_offsets(right, truth, drawn, ESTIMATE)
        draw_names(right, drawn, ESTIMATE, scale, range(1, ROBOTS + 1), lines, truth)
    left.set_title("(a) linear estimates", loc="left", fontsize=10)
    right.set_title("(b) refined estimate", loc="left", fontsize=10)
    right.set_ylabel("")
    left.set_xlim(-MARGIN, WIDTH + MARGIN)
    left.set_ylim(-MARGIN, HEIGHT + MARGIN)
    figure.legend(**legend(entries), loc="outside lower center", ncols=len(entries), fontsize=9)
    figure.suptitle(f"{experiment.title}, bearings with {experiment.noise_deg:g}° noise", fontsize=11)
    return figure


def _timed(name: str, way: Callable[[], Reconstruction], scene: Scene, repeats: int) -> Row:
    seconds = math.inf
    result: Reconstruction | DegenerateError
    for _ in range(repeats):
        start = time.perf_counter()
        try:
            result = way()
        except DegenerateError as error:
            result = error
        seconds = min(seconds, time.perf_counter() - start)
    errors = compare(result, scene) if isinstance(result, Reconstruction) else None
    return Row(name, result, errors, seconds)


def _paragraph(experiment: Experiment, scene: Scene, rows: Sequence[Row], others: Sequence[Sequence[Row]]) -> str:
    lines: list[Sequence[str]] = [
        ("", "residual rms", "backwards", "robots", "landmarks", "headings", "time"),
        ("", "[deg]", "", "[m]", "[m]", "[deg]", "[us]"),
    ]
    notes = []
    for row in rows:
        lines.append((row.name, *_cells([row])))
        if isinstance(row.result, DegenerateError):
            notes.append(f"{row.name}: {row.result}")
    lines.append((f"median of {SCENES} such scenes:", *[""] * 6))
    for several in others:
        lines.append((several[0].name, *_cells(several)))
        failed = sum(row.errors is None for row in several)
        if failed:
            notes.append(f"{several[0].name}: no map of {failed} of the {SCENES} scenes (degenerate)")
    sightings = scene.bearings.size
    unknowns = 3 * ROBOTS + 2 * BOXES - 4
    expected = experiment.noise_deg * math.sqrt(1 - unknowns / sightings)
    title = (
        f"{experiment.title}, in an arena of {WIDTH:g} x {HEIGHT:g} m: {sightings} bearings with "
        f"{experiment.noise_deg:g} deg noise\n"
        f"  for {unknowns} unknowns: the expected residual rms of the best fit is {expected:.2f} deg"
    )
    table = columns(lines)
    return "\n".join([title, *(f"  {line}".rstrip() for line in [*table.splitlines(), *notes])])


def _cells(rows: Sequence[Row]) -> tuple[str, ...]:
    """Medians over rows, without those that have no map."""
    numbers = [
        (
            math.degrees(row.result.rms),
            np.count_nonzero(np.abs(row.result.residuals) > math.pi / 2),
            row.errors.position,
            row.errors.landmark,
            math.degrees(row.errors.heading),
        )
        for row in rows
        if isinstance(row.result, Reconstruction) and row.errors is not None
    ]
    microseconds = f"{1e6 * median(row.seconds for row in rows):.0f}"
    if not numbers:
        return *["-"] * 5, microseconds
    rms, backwards, robots, landmarks, headings = np.median(np.array(numbers, dtype=float), axis=0)
    return f"{rms:.2f}", f"{backwards:.0f}", f"{robots:.3f}", f"{landmarks:.3f}", f"{headings:.2f}", microseconds
