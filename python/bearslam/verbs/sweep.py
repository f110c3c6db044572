# SPDX-License-Identifier: MIT OR Apache-2.0
"""Monte-Carlo sweeps: many random scenes, each refined from several starts and compared with the truth."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from typing import Any

from numpy.typing import ArrayLike

from bearslam.data.checks import SEED_LIMIT, IntArray, quote, whole
from bearslam.errors import ExecutorError, InvalidInputError
from bearslam.montecarlo.checkpoint import Checkpoint
from bearslam.montecarlo.executors import HaltedError, run_here, run_on
from bearslam.montecarlo.grid import Grid, Start, chunk_size, cut
from bearslam.montecarlo.ledger import Ledger
from bearslam.montecarlo.sweep_result import SweepResult
from bearslam.progress import Progress, reporting
from bearslam.verbs.simulate import Layout

__all__ = ["sweep"]

MAX_THREADS = 2**16


def sweep(
    layout: Layout | Sequence[Layout],
    views: ArrayLike,
    landmarks: ArrayLike,
    noise: ArrayLike,
    *,
    trials: int,
    starts: Sequence[Start] = ("random", "projective", "solve"),
    seed: int = 0,
    executor: Executor | None = None,
    progress: bool | Progress = False,
    checkpoint: str | os.PathLike[str] | None = None,
    chunk: int | None = None,
    threads: int = 0,
) -> SweepResult:
    """Measure how often the refinement fails from each start, and how large the errors are, over many random scenes.

    Every combination of layout, views, landmarks and noise is a cell. In each cell `trials` scenes are drawn, each is
    refined from every start, and the maps are judged by their cost and by their errors. All counts are integers: apart
    from times, the same seed gives the same bits, wherever and in however many pieces it is computed.

    Parameters
    ----------
    layout : str or sequence of str
        As for `simulate`. Results have an axis for it only if it is given as a sequence.
    views, landmarks : int or sequence of int
        Numbers of views and landmarks; at least 3 views and 4 landmarks.
    noise : float or sequence of float
        Standard deviations of the bearings [rad].
    trials : int
        Number of scenes per cell.
    starts : sequence of {"random", "projective", "calibrated", "solve"}
        Starts of the refinement. "random": another random scene of the cell. "projective" and "calibrated": the result
        of the method of that name, as in the paper. "solve": everything that `solve` does.
    seed : int
        From 0 to 2^64 - 1. Different seeds give different scenes, and their results can be merged.
    executor : concurrent.futures.Executor, optional
        Executor to run on: a pool of processes, or that of a dask or MPI cluster; by default this process. A chunk that
        fails is retried three times.
    progress : bool or callable
        True shows a bar on a terminal. A function is called as ``progress("scenes", done, total)``; an exception raised
        in it stops the sweep.
    checkpoint : str or path, optional
        File that records finished chunks, even if the process is killed, within half a second. The same sweep called
        again with it does only what is missing; `trials` may have grown.
    chunk : int, optional
        Number of trials per piece of work, which does not affect the result. By default a 2000th of the scenes of the
        sweep, but at least 10 and at most 10 000.
    threads : int
        Number of threads of this process, 0 for one per core. Not with an executor, whose tasks have one thread each.

    Returns
    -------
    SweepResult
        Failures, errors, iterations and times. After Ctrl-C (`KeyboardInterrupt`) those of the trials done so far; see
        `SweepResult.complete`.

    Raises
    ------
    InvalidInputError
        If an argument is out of range, or the checkpoint belongs to another sweep.
    ExecutorError
        If the executor breaks, is shut down, or fails at the same chunk four times. Its `result`, a `SweepResult`, has
        the trials done by then.
    OSError
        If the checkpoint cannot be written.

    See Also
    --------
    simulate, solve : the same for one scene.

    References
    ----------
    Dellaert and Stroupe, ICRA 2002, section 4.2 and figure 11.

    Examples
    --------
    >>> import numpy as np
    >>> from bearslam import sweep
    >>> result = sweep("mixed", views=[4, 6], landmarks=7, noise=np.radians([0.1, 1]), trials=30, seed=1)
    >>> result.complete, result.failure_rate["solve"].shape
    (True, (2, 2, 1))
    >>> result.total("random").failure_rate > 0.3 > 0.1 > result.total("solve").failure_rate
    True
    """
    grid = Grid.of(layout, views, landmarks, noise, starts)
    trials, seed = whole("trials", trials, 1), whole("seed", seed, 0, SEED_LIMIT)
    size = chunk_size(grid.cells * trials) if chunk is None else whole("chunk", chunk, 1)
    threads = whole("threads", threads, 0, MAX_THREADS)
    _check(executor, threads, progress, checkpoint)
    ledger = Ledger(grid)
    try:
        with ExitStack() as stack:
            saved = None if checkpoint is None else stack.enter_context(Checkpoint(checkpoint, grid, seed))
            ranges: dict[int, list[tuple[int, int]]] = {}
            for piece, counts, bins in () if saved is None else saved.chunks():
                ranges.setdefault(piece.cell, []).append((piece.first, piece.end))
                ledger.enter(piece, counts, bins)
            known = max((end for several in ranges.values() for _, end in several), default=0)
            if known > trials:
                raise InvalidInputError(f"trials: expected at least the {known} in the checkpoint, got {trials}")
            pieces = cut(grid, trials, size, ranges)
            total = trials * grid.cells
            scenes = total - sum(piece.end - piece.first for piece in pieces)
            tell = stack.enter_context(reporting(progress, "scenes", scenes, total))

            def done(index: int, counts: IntArray, bins: IntArray) -> None:
                nonlocal scenes
                piece = pieces[index]
                if ledger.enter(piece, counts, bins):
                    if saved is not None:
                        saved.add(piece, counts, bins)
                    scenes += piece.end - piece.first
                    tell(scenes)

            raw = [grid.raw(piece) for piece in pieces]
            if executor is None:
                run_here(raw, grid.start, seed, threads, done)
            else:
                run_on(executor, raw, grid.start, seed, done)
    except KeyboardInterrupt:
        pass  # return what has been done
    except HaltedError as halted:
        message = f"executor: {halted}"
        raise ExecutorError(message, result=SweepResult(grid, trials, (seed,), ledger.tally())) from halted.__cause__
    return SweepResult(grid, trials, (seed,), ledger.tally())


def _check(executor: Any, threads: int, progress: Any, checkpoint: Any) -> None:
    if executor is not None and (isinstance(executor, type) or not callable(getattr(executor, "submit", None))):
        raise InvalidInputError(f"executor: expected None or an executor with a method submit, got {quote(executor)}")
    if executor is not None and threads != 0:
        raise InvalidInputError(f"threads: expected 0 with an executor, whose tasks have one each, got {threads}")
    if not isinstance(progress, bool | None) and not callable(progress):
        raise InvalidInputError(
            f"progress: expected True, False or a function (stage, done, total), got {quote(progress)}"
        )
    if checkpoint is not None and not isinstance(checkpoint, str | os.PathLike):
        raise InvalidInputError(f"checkpoint: expected None or a path, got {quote(checkpoint)}")
