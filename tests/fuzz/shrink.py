# SPDX-License-Identifier: MIT OR Apache-2.0
"""Smaller inputs that go wrong in the same way: fewer arguments, views, landmarks, motions and priors."""

from __future__ import annotations

import copy
import multiprocessing
import signal
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from . import worker
from .inputs import MAPS, Input

INDEXED = {"odometry": ("start", "end"), "pose_priors": ("view",), "landmark_priors": ("landmark",)}
SPAWN = multiprocessing.get_context("spawn")


class Prober:
    """Says how inputs go wrong, in a process of its own that is started again after it has died."""

    def __init__(self) -> None:
        self.process: Any = None
        self.pipe: Any = None

    def kind_of(self, given: Input) -> str | None:
        """How an input goes wrong; None if it does not."""
        if self.process is None:
            self.pipe, there = SPAWN.Pipe()
            self.process = SPAWN.Process(target=_serve, args=(there,), daemon=True)
            self.process.start()
            there.close()
        self.pipe.send(given)
        try:
            faults = self.pipe.recv()
        except EOFError:
            self.process.join()
            code, self.process = self.process.exitcode, None
            return "hang" if code == -signal.SIGPROF else "abort"
        return faults[0][0] if faults else None

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


def shrink(given: Input, kind_of: Callable[[Input], str | None]) -> Input:
    """The smallest input found that goes wrong in the same way."""
    kind, smaller = kind_of(given), True
    while smaller and kind is not None:
        smaller = False
        for candidate in _candidates(given):
            if kind_of(candidate) == kind:
                given, smaller = candidate, True
                break
    return given


def _candidates(given: Input) -> Iterator[Input]:
    for name in list(given.arguments):
        if name not in ("bearings", "form", "start", "poses", "landmarks", "source", "target"):
            yield _without(given, name)
        value = given.arguments[name]
        if isinstance(value, dict) and name in ("search", "refinement"):
            yield from (_changed(given, name, _less(value, key)) for key in value)
    if given.arguments.get("form", "dense") != "dense":
        yield _changed(given, "form", "dense")
    if given.verb in MAPS:
        shape = np.shape(given.arguments["bearings"])
        if len(shape) == 2:
            yield from (_drop(given, axis, k) for axis in range(2) for k in reversed(range(shape[axis])))
    for name in INDEXED:
        value = given.arguments.get(name)
        if isinstance(value, dict):
            count = len(value[INDEXED[name][0]])
            yield from (
                _changed(given, name, _rows(value, np.arange(count) != k)) for k in reversed(range(count)) if count > 1
            )
    if isinstance(given.arguments.get("sigma"), np.ndarray):
        yield _changed(given, "sigma", float(np.ravel(given.arguments["sigma"])[0]))


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


def _drop(given: Input, axis: int, k: int) -> Input:
    """Without view (axis 0) or landmark (axis 1) k, and what refers to it."""
    arguments = dict(given.arguments)
    for name in ("bearings", "sigma"):
        if np.ndim(arguments.get(name, 0)) == 2:
            arguments[name] = np.delete(arguments[name], k, axis=axis)
    if "start" in arguments:
        parts = list(arguments["start"])
        if len(parts[axis]) > k:
            parts[axis] = np.delete(parts[axis], k, axis=0)
        arguments["start"] = tuple(parts)
    for name, ends in INDEXED.items():
        value = arguments.get(name)
        if not isinstance(value, dict) or (axis == 1) != (name == "landmark_priors"):
            continue
        keep = np.all([np.asarray(value[end]) != k for end in ends], axis=0)
        rows = _rows(value, keep)
        rows |= {end: rows[end] - (rows[end] > k) for end in ends}
        if keep.any():
            arguments[name] = rows
        else:
            del arguments[name]
    made = copy.copy(given)
    made.arguments = arguments
    return made
