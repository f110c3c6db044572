# SPDX-License-Identifier: MIT OR Apache-2.0
"""Running the chunks of a sweep, in this process or on an executor."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import TypeAlias
from uuid import uuid4

from bearslam import _core
from bearslam.data.checks import IntArray
from bearslam.errors import InvalidInputError
from bearslam.montecarlo.grid import RawChunk

__all__ = ["Done", "HaltedError", "run_chunk", "run_here", "run_on"]

Done: TypeAlias = Callable[[int, IntArray, IntArray], None]
"""Called with the index of a chunk, its counts and its bins; calling it twice for the same chunk does no harm."""
Outcome: TypeAlias = tuple[IntArray, IntArray]

WINDOW = 2048
"""Chunks submitted at a time: more than an executor has workers, and few enough to be cancelled quickly."""
RETRIES = 3
"""Number of times that a failed chunk is submitted again, since workers may die."""
PATIENCE = 0.3
"""Time spent cancelling chunks before an interrupted sweep returns [s]."""
POLL_INTERVAL = 0.1
"""Time between two checks for an interruption, since waiting for results cannot be interrupted [s]."""


class HaltedError(Exception):
    """An executor accepts no more chunks."""


def run_here(chunks: Sequence[RawChunk], starts: Sequence[str], seed: int, threads: int, done: Done) -> None:
    """Run all chunks in this process, on a number of threads, 0 for one per core."""
    _core.sweep(chunks, starts, seed, threads, done)


def run_chunk(chunk: RawChunk, starts: Sequence[str], seed: int, label: object = None) -> Outcome:
    """Run one chunk on one core: the task of an executor.

    The label distinguishes tasks for schedulers that identify them by their arguments.
    """
    outcomes: list[Outcome] = []
    _core.sweep([chunk], starts, seed, 1, lambda index, counts, bins: outcomes.append((counts, bins)))
    return outcomes[0]


def run_on(executor: Executor, chunks: Sequence[RawChunk], starts: Sequence[str], seed: int, done: Done) -> None:
    """Run all chunks as tasks of an executor.

    Raises
    ------
    HaltedError
        If the executor accepts no more tasks, or a chunk has failed too often. Finished chunks are handed over first,
        as they are before a `KeyboardInterrupt` is raised.
    """
    label = uuid4().hex
    todo = deque(range(len(chunks)))
    failures: Counter[int] = Counter()
    running: dict[Future[Outcome], int] = {}
    ready: SimpleQueue[Future[Outcome]] = SimpleQueue()
    try:
        while todo or running:
            while todo and len(running) < WINDOW:
                index = todo[0]
                future = _submit(executor, chunks[index], tuple(starts), seed, (label, index, failures[index]))
                running[future] = index
                todo.popleft()
                future.add_done_callback(ready.put)
            try:
                future = ready.get(timeout=POLL_INTERVAL)
            except Empty:
                continue
            index = running[future]
            error = _failure(future)
            if error is None:
                done(index, *future.result())
            elif isinstance(error, InvalidInputError | KeyboardInterrupt):
                raise error
            else:
                failures[index] += 1
                _give_up(error, failures[index], chunks[index])
                todo.appendleft(index)
            del running[future]
    except (HaltedError, KeyboardInterrupt):
        for future, index in running.items():
            if future.done() and _failure(future) is None:
                done(index, *future.result())
        raise
    finally:
        _cancel(iter(running))


def _submit(
    executor: Executor, chunk: RawChunk, starts: tuple[str, ...], seed: int, label: tuple[str, int, int]
) -> Future[Outcome]:
    try:
        return executor.submit(run_chunk, chunk, starts, seed, label)
    except Exception as error:
        # Executors raise a RuntimeError when they are shut down or broken, and whatever their connection raises.
        raise HaltedError(f"the executor takes no more chunks: {_told(error)}") from error


def _cancel(futures: Iterator[Future[Outcome]], patience: float = PATIENCE) -> None:
    """Cancel what has not begun; if that takes long, as over a network, the rest in the background."""
    end = time.monotonic() + patience
    for future in futures:
        with suppress(Exception):  # the result is no longer needed
            future.cancel()
        if time.monotonic() > end:
            threading.Thread(target=_cancel, args=(futures, math.inf), name="bearslam-cancel", daemon=True).start()
            return


def _failure(future: Future[Outcome]) -> BaseException | None:
    """Why a chunk has failed; None if it has not."""
    try:
        error = future.exception()
    except Exception as cancelled:  # noqa: BLE001 - a future cancelled elsewhere, of any library
        return cancelled
    return error


def _give_up(error: BaseException, failures: int, chunk: RawChunk) -> None:
    """Raise an error if retrying is pointless."""
    if isinstance(error, BrokenExecutor):
        raise HaltedError(f"the executor is broken: {_told(error)}") from error
    if failures > RETRIES:
        raise HaltedError(f"the executor failed {failures} times at the same chunk, {chunk}: {_told(error)}") from error


def _told(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
