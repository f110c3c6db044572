# SPDX-License-Identifier: MIT OR Apache-2.0
"""Smaller inputs that go wrong in the same way: fewer arguments, views, landmarks, motions and priors."""

from __future__ import annotations

import copy
import multiprocessing
import signal
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from . import worker
from .inputs import MAPS, Input
from .maps import Fault

INDEXED = {"odometry": ("start", "end"), "pose_priors": ("view",), "landmark_priors": ("landmark",)}
SPAWN = multiprocessing.get_context("spawn")


class Prober:
    """Says how inputs go wrong, in a process of its own that is started again after it has died."""

    def __init__(self) -> None:
        self.process: Any = None
        self.pipe: Any = None

    def kind_of(self, given: Input) -> str | None:
        """How an input goes wrong; None if it does not."""
        faults = self.faults(given)
        return faults[0][0] if faults else None

    def faults(self, given: Input) -> list[Fault]:
        """What is wrong with the answer to an input."""
        if self.process is None:
            self.pipe, there = SPAWN.Pipe()
            self.process = SPAWN.Process(target=_serve, args=(there,), daemon=True)
            self.process.start()
            there.close()
        self.pipe.send(given)
        try:
            faults: list[Fault] = self.pipe.recv()
        except EOFError:
            self.process.join()
            code, self.process = self.process.exitcode, None
            return [("hang" if code == -signal.SIGPROF else "abort", f"the process ended with {code}")]
        return faults

    def close(self) -> None:
        """End the process."""
        if self.process is not None:
            self.pipe.close()
            self.process.join()


def _serve(pipe: Any) -> None:
    worker.limit()
    while True:
        try:
            given = pipe.recv()
        except EOFError:
            return
        pipe.send(worker.run(given).faults)


def shrink(given: Input, kind_of: Callable[[Input], str | None], seconds: float = 120.0) -> Input:
    """The smallest input found within a time that goes wrong in the same way."""
    end = time.monotonic() + seconds
    kind, smaller = kind_of(given), True
    while smaller and kind is not None:
        smaller = False
        for candidates in (_views_and_landmarks, _arguments, _entries):
            found: Input | None = given
            while found is not None and time.monotonic() < end:
                given, found = found, None
                for candidate in candidates(given):
                    if time.monotonic() > end:
                        break
                    if kind_of(candidate) == kind:
                        found, smaller = candidate, True
                        break
    return given


def _views_and_landmarks(given: Input) -> Iterator[Input]:
    """Fewer views and landmarks."""
    shape = np.shape(given.arguments.get("bearings", 0))
    if given.verb in MAPS and len(shape) == 2:
        for axis in range(2):
            yield from (_drop(given, axis, gone) for gone in _pieces(shape[axis]))


def _arguments(given: Input) -> Iterator[Input]:
    """Fewer arguments and options."""
    for name, value in given.arguments.items():
        if name not in ("bearings", "form", "start", "poses", "landmarks", "source", "target"):
            yield _without(given, name)
        if isinstance(value, dict) and name in ("search", "refinement"):
            yield from (_changed(given, name, _less(value, key)) for key in value)
    if given.arguments.get("form", "dense") != "dense":
        yield _changed(given, "form", "dense")
    if isinstance(given.arguments.get("sigma"), np.ndarray):
        yield _changed(given, "sigma", float(np.ravel(given.arguments["sigma"])[0]))


def _entries(given: Input) -> Iterator[Input]:
    """Fewer motions and priors."""
    for name in INDEXED:
        value = given.arguments.get(name)
        if isinstance(value, dict):
            count = len(value[INDEXED[name][0]])
            for gone in _pieces(count):
                yield _changed(given, name, _rows(value, ~np.isin(np.arange(count), gone)))


def _less(value: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: one for name, one in value.items() if name != key}


def _changed(given: Input, name: str, value: Any) -> Input:
    made = copy.copy(given)
    made.arguments = {**given.arguments, name: value}
    return made


def _without(given: Input, name: str) -> Input:
    made = copy.copy(given)
    made.arguments = _less(given.arguments, name)
    return made


def _rows(value: dict[str, Any], keep: Any) -> dict[str, Any]:
    """Some entries of odometry or priors."""
    count = len(keep)
    return {
        name: one[keep]
        if np.ndim(one) >= 1 and len(one) == count and not (name == "sigma" and np.ndim(one) == 1)
        else one
        for name, one in value.items()
    }


def _pieces(count: int) -> Iterator[Any]:
    """Parts of a list to try without: halves, quarters, and in the end single entries."""
    size = count // 2
    while size >= 1:
        yield from (np.arange(first, min(first + size, count)) for first in range(0, count, size))
        size //= 2


def _drop(given: Input, axis: int, gone: Any) -> Input:
    """Without some views (axis 0) or landmarks (axis 1), and what refers to them."""
    arguments = dict(given.arguments)
    for name in ("bearings", "sigma"):
        if np.ndim(arguments.get(name, 0)) == 2:
            arguments[name] = np.delete(arguments[name], gone, axis=axis)
    if "start" in arguments:
        parts = list(arguments["start"])
        parts[axis] = np.delete(parts[axis], gone[gone < len(parts[axis])], axis=0)
        arguments["start"] = tuple(parts)
    for name, ends in INDEXED.items():
        value = arguments.get(name)
        if not isinstance(value, dict) or (axis == 1) != (name == "landmark_priors"):
            continue
        keep = np.all([~np.isin(value[end], gone) for end in ends], axis=0)
        rows = _rows(value, keep)
        rows |= {end: rows[end] - np.searchsorted(gone, rows[end]) for end in ends}
        if keep.any():
            arguments[name] = rows
        else:
            del arguments[name]
    made = copy.copy(given)
    made.arguments = arguments
    return made
