# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command `bearslam sweep`."""

from __future__ import annotations

import argparse
import math
import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any, cast

from bearslam.cli.console import print_error, same_file, writable
from bearslam.cli.report import columns
from bearslam.data.checks import real, whole
from bearslam.errors import ExecutorError, InvalidInputError
from bearslam.montecarlo.files import RESULTS
from bearslam.montecarlo.grid import STARTS
from bearslam.montecarlo.statistics import Total
from bearslam.montecarlo.sweep_result import SweepResult
from bearslam.montecarlo.table import degrees
from bearslam.verbs.simulate import LAYOUTS
from bearslam.verbs.sweep import sweep

__all__ = ["add", "table"]

DESCRIPTION = """\
Run a Monte-Carlo sweep: draw random scenes for every combination of layout, views, landmarks and noise, refine each
from several starts, and count how often the refinement misses the best known minimum. The defaults are those of the
evaluation by Dellaert and Stroupe. Ctrl-C ends the sweep early; the trials done so far are printed and saved.
"""
EXAMPLES = """\
examples:
  bearslam sweep --trials 10 -o sweep.npz --plot failures.png
  bearslam sweep mixed --views 4 8 --landmarks 7 --noise-deg 0.5 --trials 1000 --starts projective solve
  bearslam sweep --trials 100000 --checkpoint sweep.db --workers 8 -o sweep.csv
"""
HEAD = (
    (
        "",
        "scenes",
        "failures",
        "95 % interval",
        "position",
        "[m]",
        "heading",
        "[deg]",
        "rms / bound",
        "",
        "steps",
        "time",
    ),
    ("", "", "[%]", "[%]", "median", "90 %", "median", "90 %", "position", "heading", "mean", "[ms]"),
)


def add(verbs: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    verb = verbs.add_parser(
        "sweep",
        help="measure how often refinements fail, over many random scenes",
        description=DESCRIPTION,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verb.add_argument(
        "layouts",
        nargs="*",
        default=["mixed", "enclosed"],
        type=_one_of(LAYOUTS),
        metavar="LAYOUT",
        help=f"layouts of the scenes: {', '.join(LAYOUTS)} (default: mixed enclosed)",
    )
    several = (
        ("--views", int, "N", [4, 6, 8, 10, 12], "numbers of views"),
        ("--landmarks", int, "N", [7, 9, 11, 13, 15], "numbers of landmarks"),
        ("--noise-deg", float, "DEG", [0.1, 0.5, 1.0], "standard deviations of a bearing"),
        (
            "--starts",
            _one_of(STARTS),
            "START",
            ["random", "projective", "solve"],
            f"starts of the refinement: {', '.join(STARTS)}",
        ),
    )
    for name, kind, metavar, default, text in several:
        shown = " ".join(f"{value}" for value in default)
        verb.add_argument(
            name, nargs="+", type=kind, metavar=metavar, default=default, help=f"{text} (default: {shown})"
        )
    verb.add_argument(
        "--trials", type=int, default=50, metavar="N", help="number of scenes per combination (default: %(default)s)"
    )
    verb.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the scenes (default: %(default)s)")
    verb.add_argument(
        "-o", "--output", metavar="OUT", help="file to write the result to: .npz, which can be read again, or .csv"
    )
    verb.add_argument("--plot", metavar="OUT", help="file to draw the failures to: .png, .svg or .pdf")
    verb.add_argument(
        "--plot-errors", metavar="OUT", help="file to draw the errors against noise to: .png, .svg or .pdf"
    )
    verb.add_argument(
        "--checkpoint", metavar="FILE", help="file that records finished trials; the same command resumes from it"
    )
    verb.add_argument(
        "--chunk", type=int, metavar="N", help="number of trials per piece of work (default: depends on the sweep)"
    )
    verb.add_argument("--threads", type=int, metavar="N", default=0, help="number of threads (default: one per core)")
    verb.add_argument(
        "--workers", type=int, metavar="N", default=0, help="number of processes to use instead of threads"
    )
    verb.set_defaults(run=_run)


def table(result: SweepResult) -> str:
    """A row for every layout, noise and start, over all views and landmarks."""
    rows: list[Sequence[str]] = list(HEAD)
    for layout in result.layout:
        for noise in result.grid.noise:
            for start in result.start:
                label = f"{layout:<8} {degrees(noise):>6.4g} deg  {start}"
                rows.append((label, *_cells(result.total(start, layout=layout, noise=noise))))
    return columns(rows)


def _run(options: argparse.Namespace) -> int:
    pictures = _check(options)
    code = 0
    try:
        with _pool(options.workers) as executor:
            result = sweep(
                options.layouts,
                options.views,
                options.landmarks,
                [math.radians(real("--noise-deg", noise, 0.0, 180.0)) for noise in options.noise_deg],
                trials=options.trials,
                starts=options.starts,
                seed=options.seed,
                executor=executor,
                progress=True,
                checkpoint=options.checkpoint,
                chunk=options.chunk,
                threads=options.threads,
            )
    except ExecutorError as error:
        result = cast("SweepResult", error.result)
        code = print_error(f"error: {error}")
    done, total = int(result.done.sum()), result.trials * result.grid.cells
    if code == 0 and not result.complete:
        code = print_error(f"interrupted after {done} of {total} scenes", 130)
    if done == 0:
        return code
    if options.output is not None:
        result.save(options.output)
    for path, kind in pictures:
        from bearslam.plotting.map import save_figure

        save_figure(result.plot(kind), path)
    print(f"{done} of {total} scenes, {_counts(result.grid.views)} views, {_counts(result.grid.landmarks)} landmarks")
    print("", table(result), sep="\n")
    return code


def _check(options: argparse.Namespace) -> list[tuple[str, Any]]:
    """Check the options before the work; return the pictures to draw."""
    whole("--workers", options.workers, 0, 1024)
    if options.workers and options.threads:
        raise InvalidInputError("--workers: each worker has one thread; give either --workers or --threads")
    writable(options.output, RESULTS)
    named = (("failures", options.plot), ("errors", options.plot_errors))
    pictures = [(path, kind) for kind, path in named if path is not None]
    if pictures:
        from bearslam.plotting.map import FORMATS

        for path, _ in pictures:
            writable(path, FORMATS)
    paths = [path for path in (options.output, options.checkpoint, *dict(pictures)) if path is not None]
    for index, path in enumerate(paths):
        if any(same_file(path, other) for other in paths[:index]) or len(dict(pictures)) < len(pictures):
            raise InvalidInputError(f"{path}: two outputs would overwrite each other")
    return pictures


@contextmanager
def _pool(workers: int) -> Iterator[Executor | None]:
    """Processes that run a sweep and end with the block, at once after an interruption."""
    if workers == 0:
        yield None
        return
    before = set(multiprocessing.active_children())
    # Ctrl-C reaches every process of the group. The workers inherit that it is ignored and leave it to this process.
    ignore = (signal.SIGINT, signal.SIG_IGN)
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), signal.signal, ignore)
    handler = signal.signal(*ignore)
    try:
        for _ in range(workers):
            pool.submit(int)
    finally:
        signal.signal(signal.SIGINT, handler)
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - before:
            process.terminate()


def _cells(total: Total) -> tuple[str, ...]:
    low, high = total.failure_interval()
    return (
        str(total.trials),
        _number(100 * total.failure_rate),
        f"{_number(100 * low)} to {_number(100 * high)}" if total.trials else "-",
        _number(total.position_median),
        _number(total.position_p90),
        _number(math.degrees(total.heading_median)),
        _number(math.degrees(total.heading_p90)),
        _number(total.position_ratio),
        _number(total.heading_ratio),
        _number(total.mean_iterations),
        _number(1e3 * total.mean_seconds),
    )


def _number(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def _counts(values: Sequence[int]) -> str:
    return ", ".join(map(str, values))


def _one_of(known: Sequence[str]) -> Callable[[str], str]:
    """A type of argument: `choices` would refuse the default of a list."""

    def one(text: str) -> str:
        if text not in known:
            raise argparse.ArgumentTypeError(f"expected {', '.join(known)}, got {text!r}")
        return text

    return one
