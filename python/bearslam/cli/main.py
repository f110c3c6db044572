# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command `bearslam`."""

from __future__ import annotations

import argparse
import inspect
import io
import math
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from bearslam._core import __version__
from bearslam.cli import convert, diagnose, sweep
from bearslam.cli.console import complain, same, writable
from bearslam.cli.input import INPUT, add_input, read_input
from bearslam.cli.report import describe, errors, excess, listing, percent
from bearslam.errors import BearslamError, InvalidInputError
from bearslam.io.files import RESULTS, TRUTHS, save, save_truth
from bearslam.io.sightings_csv import render
from bearslam.io.truth import load_truth
from bearslam.progress import ProgressLine
from bearslam.reconstruction import FRAMES, outliers
from bearslam.verbs.simulate import LAYOUTS, simulate
from bearslam.verbs.solve import LOSSES, METHODS, solve

__all__ = ["main"]

EXAMPLES = """\
examples:
  bearslam demo
  bearslam simulate mixed 4 9 --noise-deg 2 -o scene.csv
  bearslam solve scene.csv -o map.json --plot map.png
  bearslam simulate enclosed 4 9 | bearslam solve -
  bearslam diagnose scene.csv
  bearslam convert graph.g2o scene.csv --bearings-only
  bearslam sweep mixed --trials 10 -o sweep.csv --plot failures.png
"""

SOLVE = f"""\
Poses and landmarks from a file of bearings.

{INPUT}"""

CHOICES = {"loss": LOSSES, "method": METHODS}
TUNING = {
    "loss": (None, "how much a residual counts"),
    "method": (None, "how to find a start"),
    "triples": ("N", "triples of views whose tensor is estimated"),
    "grown": ("N", "of these, the best conditioned that are grown to maps"),
    "candidates": ("N", "of these, most that are refined"),
    "swept": ("N", "triples whose tensor is varied when there is doubt"),
    "max_iterations": ("N", "steps of one refinement at most"),
    "damping": ("X", "first damping; 0 is Gauss-Newton"),
    "tolerance": ("X", "relative fall of the cost that ends a refinement"),
    "seed": ("N", "of the choice of triples"),
}
"""Options of `solve` that are options of the command as well: placeholder and help."""

LARGE = 3.0
"""Residuals so many times their standard deviations are not those of a map that is right."""
MANY = 1 / 3
"""Share of outliers above which a robust map is no longer to be trusted."""
DOUBTFUL = 0.2
"""Uncertainty of a map, as a share of its size, above which it is no longer to be trusted."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.exit(2, f"bearslam: error: {message} (try {self.prog} --help)\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code: 0, 1 after an error, 2 for wrong usage."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names may have letters that a terminal has not
    options = _parser().parse_args(arguments)
    try:
        code: int | None = options.run(options)
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        # Whoever reads has read enough. Python would complain once more when it closes the stream.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        return complain("interrupted", 130)
    except OSError as error:
        where = "" if error.filename is None else f"{error.filename}: "
        return complain(f"error: {where}{error.strerror or error}")
    except MemoryError:
        return complain("error: not enough memory")
    except (BearslamError, ImportError) as error:
        return complain(f"error: {error}")
    return code or 0


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="bearslam",
        description="Planar structure and motion from bearings alone.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"bearslam {__version__}")
    verbs = parser.add_subparsers(metavar="COMMAND", required=True, title="commands")
    _add_solve(verbs)
    _add_simulate(verbs)
    diagnose.add(verbs)
    convert.add(verbs)
    sweep.add(verbs)
    _add_demo(verbs)
    return parser


def _add_solve(verbs: argparse._SubParsersAction[_Parser]) -> None:
    verb = verbs.add_parser(
        "solve",
        help="poses and landmarks from a file of bearings",
        description=SOLVE,
        epilog="example:\n  bearslam solve bearings.csv -o map.json --plot map.png\n",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_input(verb)
    verb.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        help="write the map: all of it to .json, points to .csv, to go on with to .g2o, a trajectory to .tum",
    )
    verb.add_argument("--robot", metavar="NAME", help="whose trajectory to write to .tum, if there are several robots")
    verb.add_argument(
        "--truth", metavar="PATH", help="print and draw errors against a map: .json, .csv, .g2o or a folder"
    )
    verb.add_argument("--plot", metavar="OUT", help="draw the map: .png, .svg or .pdf")
    verb.add_argument(
        "--view", nargs="?", const="", metavar="OUT.rrd", help="open the map in the viewer of Rerun, or write it for it"
    )
    verb.add_argument("--robust", action="store_true", help="expect wrong bearings: wrong landmarks, half turns, any")
    verb.add_argument("--unoriented", action="store_true", help="bearings are lines, known modulo half a turn")
    verb.add_argument(
        "--covariance",
        nargs="?",
        const=True,
        default=False,
        choices=FRAMES,
        metavar="FRAME",
        help="compute covariances: first_view, free_network or priors (default: what fits)",
    )
    verb.add_argument("--loss-scale", type=float, metavar="X", help="width of the loss in standard deviations")
    defaults = inspect.signature(solve).parameters
    for name, (metavar, text) in TUNING.items():
        default = defaults[name].default
        verb.add_argument(
            f"--{name.replace('_', '-')}",
            choices=CHOICES.get(name),
            type=type(default),
            metavar=metavar,
            default=default,
            help=f"{text} (default: %(default)s)",
        )
    verb.set_defaults(run=_solve)


def _add_simulate(verbs: argparse._SubParsersAction[_Parser]) -> None:
    verb = verbs.add_parser(
        "simulate",
        help="bearings with known truth",
        description="Bearings of a scene drawn at random, as CSV.",
        epilog="example:\n  bearslam simulate mixed 4 9 --noise-deg 2 -o scene.csv --truth truth.json\n",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verb.add_argument("layout", choices=LAYOUTS, help="where views and landmarks are")
    verb.add_argument("views", type=int, help="how many views")
    verb.add_argument("landmarks", type=int, help="how many landmarks")
    verb.add_argument("--noise-deg", type=float, default=1.0, metavar="DEG", help="of bearings (default: %(default)s)")
    verb.add_argument("--seed", type=int, default=0, metavar="N", help="of the draw (default: %(default)s)")
    verb.add_argument("--width", type=float, default=7.0, metavar="M", help="of the arena (default: %(default)s)")
    verb.add_argument("--height", type=float, default=5.0, metavar="M", help="of the arena (default: %(default)s)")
    verb.add_argument("--sight", type=float, default=math.inf, metavar="M", help="how far views see (default: all)")
    verb.add_argument("-o", "--output", metavar="OUT.csv", help="where to (default: standard output)")
    verb.add_argument("--truth", metavar="OUT", help="write the true poses and landmarks: .json or .csv")
    verb.set_defaults(run=_simulate)


def _add_demo(verbs: argparse._SubParsersAction[_Parser]) -> None:
    verb = verbs.add_parser(
        "demo",
        help="the paper's two robot experiments, with pictures",
        description="Simulate the two robot experiments of Dellaert and Stroupe, solve and draw them.",
    )
    verb.add_argument("-o", "--output", metavar="DIR", default="demo", help="folder (default: %(default)s)")
    verb.set_defaults(run=_demo)


def _solve(options: argparse.Namespace) -> None:
    writable(options.output, RESULTS)
    if options.plot is not None:
        from bearslam.plotting.map import FORMATS, draw_to_file

        writable(options.plot, FORMATS)
    if options.view is not None:
        from bearslam.plotting.viewer import FORMATS as RECORDINGS

        writable(options.view or None, RECORDINGS)
    if options.output is not None and same(options.output, options.file):
        raise InvalidInputError(f"{options.output}: the map would replace the bearings that it is made from")
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
            loss_scale=options.loss_scale,
            oriented=not options.unoriented,
            robust=options.robust,
            covariance=options.covariance,
            progress=progress,
            **{name: getattr(options, name) for name in TUNING},
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
    if options.output is None:
        print("", listing(result), sep="\n")
    if not result.converged:
        complain(f"warning: not converged ({result.termination.replace('_', ' ')})")
    large = excess(result)
    if large > LARGE:
        complain(
            f"warning: residuals are {large:.3g} times as large as their standard deviations: wrong bearings"
            f"{'' if options.robust else ' (try --robust)'}, wrong odometry, a wrong minimum, or too small a sigma"
        )
    wrong = outliers(result).mean()
    if options.robust and wrong > MANY:
        complain(f"warning: {percent(wrong)} of the bearings are outliers; --robust bears a third")
    if result.uncertainty > DOUBTFUL:
        complain(
            "warning: the bearings hardly determine this map: for residuals as large as these it is uncertain by "
            f"{percent(result.uncertainty)} of its size; add sightings, of other landmarks or from other places"
        )


def _simulate(options: argparse.Namespace) -> None:
    writable(options.output, (".csv",))
    writable(options.truth, TRUTHS)
    if options.output is not None and options.truth is not None and same(options.output, options.truth):
        raise InvalidInputError(f"{options.truth}: bearings and truth would replace each other")
    scene = simulate(
        options.layout,
        options.views,
        options.landmarks,
        noise=math.radians(options.noise_deg),
        seed=options.seed,
        width=options.width,
        height=options.height,
        sight=options.sight,
    )
    if options.truth is not None:
        save_truth(scene, options.truth)
    if options.output is None:
        sys.stdout.write(render(scene.bearings))
    else:
        save(scene.bearings, options.output)


def _demo(options: argparse.Namespace) -> None:
    from bearslam.cli.demo import run

    for paragraph in run(options.output):
        print(paragraph, end="\n\n", flush=True)
