# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command `bearslam solve`."""

from __future__ import annotations

import argparse
import inspect
from dataclasses import fields
from typing import Any

from bearslam.cli.console import print_error, same_file, writable
from bearslam.cli.input import INPUT, add_input, read_input
from bearslam.cli.report import describe, errors, listing
from bearslam.cli.warnings import warnings
from bearslam.data.maps import is_mirrored
from bearslam.data.options import FRAMES, LOSSES, METHODS, RefineOptions, SearchOptions
from bearslam.errors import InvalidInputError
from bearslam.io.endings import RESULTS
from bearslam.io.truth import load_truth
from bearslam.progress import ProgressLine
from bearslam.verbs.solve import solve

__all__ = ["add"]

DESCRIPTION = f"""\
Estimate poses and landmarks from a file of bearings.

{INPUT}"""
EXAMPLES = """\
examples:
  bearslam solve bearings.csv
  bearslam solve bearings.csv --sigma-deg 0.5 -o map.json --plot map.png
  bearslam solve graph.g2o -o refined.g2o
"""

CHOICES = {"loss": LOSSES, "method": METHODS}
WORDS = {
    "loss": (None, "robust loss applied to the residuals"),
    "method": (None, "method that finds the initial map"),
    "seed": ("N", "seed of the random choice of triples"),
}
"""Options of `solve` that are options of the command as well: placeholder and help."""
FIELDS = {
    "triples": ("N", "number of view triples whose trifocal tensor is estimated"),
    "grown": ("N", "number of these, best conditioned first, that are grown to whole maps"),
    "candidates": ("N", "largest number of maps that are refined"),
    "swept": ("N", "number of triples whose tensor is varied when the candidates leave doubt"),
    "max_iterations": ("N", "largest number of iterations of one refinement"),
    "damping": ("X", "initial damping of Levenberg-Marquardt; 0 is Gauss-Newton"),
    "tolerance": ("X", "relative decrease of the cost below which a refinement has converged"),
    "loss_scale": ("X", "width of the loss [standard deviations]"),
}
"""The same for the fields of `SearchOptions` and `RefineOptions`."""


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    verb = verbs.add_parser(
        "solve",
        help="estimate poses and landmarks from a file of bearings",
        description=DESCRIPTION,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_input(verb)
    verb.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        help="file to write the map to: .json keeps everything, .csv the poses and landmarks, .g2o these and the "
        "measurements, .tum the trajectory",
    )
    verb.add_argument("--robot", metavar="NAME", help="robot whose trajectory goes to .tum, if there are several")
    verb.add_argument(
        "--truth", metavar="PATH", help="ground truth to compare and draw the map with: .json, .csv, .g2o or a folder"
    )
    verb.add_argument("--plot", metavar="OUT", help="file to draw the map to: .png, .svg or .pdf")
    verb.add_argument(
        "--view", nargs="?", const="", metavar="OUT.rrd", help="open the map in the Rerun viewer, or write a recording"
    )
    verb.add_argument(
        "--robust", action="store_true", help="tolerate outliers: mismatched landmarks, flipped or random bearings"
    )
    verb.add_argument(
        "--verify",
        action="store_true",
        help="bound the trifocal tensor of three views in all maps of lower cost, and search there cell by cell",
    )
    verb.add_argument("--unoriented", action="store_true", help="take bearings as lines, known modulo 180 degrees")
    verb.add_argument(
        "--covariance",
        nargs="?",
        const=True,
        default=False,
        choices=FRAMES,
        metavar="FRAME",
        help="compute covariances in the frame first_view, free_network or priors (default: the one that applies)",
    )
    defaults = inspect.signature(solve).parameters
    for name, (metavar, text) in WORDS.items():
        _add(verb, name, metavar, text, defaults[name].default)
    for options in (SearchOptions, RefineOptions):
        for field in fields(options):
            _add(verb, field.name, *FIELDS[field.name], field.default)
    verb.set_defaults(run=_run)


def _add(verb: argparse.ArgumentParser, name: str, metavar: str | None, text: str, default: object) -> None:
    """Add an option of `solve`, or of its options."""
    verb.add_argument(
        f"--{name.replace('_', '-')}",
        choices=CHOICES.get(name),
        type=float if default is None else type(default),
        metavar=metavar,
        default=default,
        help=text if default is None else f"{text} (default: %(default)s)",
    )


def _run(options: argparse.Namespace) -> None:
    writable(options.output, RESULTS)
    if options.plot is not None:
        from bearslam.plotting.map import FORMATS, draw_to_file

        writable(options.plot, FORMATS)
    if options.view is not None:
        from bearslam.plotting.viewer import FORMATS as RECORDINGS

        writable(options.view or None, RECORDINGS)
    if options.output is not None and same_file(options.output, options.file):
        raise InvalidInputError(f"{options.output}: the map would overwrite the bearings it is made from")
    problem = read_input(options)
    truth = None if options.truth is None else load_truth(options.truth, problem)
    needing = "--robust" if options.robust else None if options.loss == "squared" else f"--loss {options.loss}"
    if needing and problem.sightings.sigma is None:
        raise InvalidInputError(
            f"{needing}: needs the standard deviation of the bearings: --sigma-deg, or a column sigma"
        )
    with ProgressLine() as progress:
        result = solve(
            problem,
            oriented=not options.unoriented,
            robust=options.robust,
            verify=options.verify,
            covariance=options.covariance,
            progress=progress,
            search=SearchOptions(**{field.name: getattr(options, field.name) for field in fields(SearchOptions)}),
            refinement=RefineOptions(**{field.name: getattr(options, field.name) for field in fields(RefineOptions)}),
            **{name: getattr(options, name) for name in WORDS},
        )
    if options.output is not None:
        result.save(options.output, robot=options.robot)
    if options.plot is not None:
        draw_to_file(result, options.plot, truth)
    if options.view is not None:
        result.view(options.view or None, truth)
    print(describe(result))
    if truth is not None:
        print(errors(result, truth))
        if is_mirrored(result, truth):
            print_error(
                "warning: the mirror image of the map fits the truth: change the signs of the bearings, which count "
                "counter-clockwise"
            )
    if options.output is None:
        print("", listing(result), sep="\n")
    for warning in warnings(result, robust=options.robust):
        print_error(f"warning: {warning}")
