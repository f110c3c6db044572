# SPDX-License-Identifier: MIT OR Apache-2.0
"""Inputs handed to bearslam, and results made comparable bit for bit."""

from __future__ import annotations

import dataclasses
import hashlib
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import bearslam
from bearslam.montecarlo.tally import COUNTS

from .inputs import Input

MAKERS = {
    "odometry": bearslam.Odometry,
    "pose_priors": bearslam.PosePriors,
    "landmark_priors": bearslam.LandmarkPriors,
    "search": bearslam.SearchOptions,
    "refinement": bearslam.RefineOptions,
}
OF_PROBLEM = ("odometry", "pose_priors", "landmark_priors", "start")


def call(given: Input, threads: int) -> Any:
    """What bearslam answers."""
    arguments = dict(given.arguments)
    match given.verb:
        case "solve" | "initialize" | "refine" | "diagnose":
            return _of_table(given.verb, arguments)
        case "files":
            return _files(arguments)
        case "tensor":
            tensor = bearslam.trifocal_tensor(arguments.pop("bearings"), **arguments)
            return tensor, bearslam.epipoles(tensor)
        case "sweep":
            tally = bearslam.sweep(**arguments, threads=threads).tally
            times = COUNTS.index("nanoseconds")
            return np.delete(tally.counts, times, axis=1), tally.keys, tally.sizes
        case verb:
            return getattr(bearslam, verb)(**arguments)


def problem(arguments: dict[str, Any]) -> Any:
    """The problem in the form that the input names; what the form cannot hold stays among the arguments."""
    form, bearings = arguments.pop("form"), arguments.pop("bearings")
    table = bearings
    if form == "dense" or not isinstance(table, np.ndarray) or table.ndim != 2:
        return bearings
    view, landmark = np.nonzero(~np.isnan(table))
    sigma = arguments.get("sigma")
    own = None
    if form == "problem" or isinstance(sigma, np.ndarray):
        sigma = arguments.pop("sigma", None)
        own = sigma
        if isinstance(sigma, np.ndarray) and sigma.shape == table.shape:
            own = sigma[view, landmark]
        elif isinstance(sigma, float):
            own = np.full(len(view), sigma)
    sightings = bearslam.Sightings(view, landmark, table[view, landmark], own)
    if form == "sightings":
        return sightings
    held = {name: arguments.pop(name) for name in OF_PROBLEM if name in arguments}
    names = [[f"{kind}{k}" for k in range(count)] for kind, count in zip("vl", table.shape, strict=True)]
    return bearslam.Problem(sightings, *names, **held)


def _of_table(verb: str, arguments: dict[str, Any]) -> Any:
    for name, maker in MAKERS.items():
        if name in arguments and isinstance(arguments[name], dict):
            arguments[name] = maker(**arguments[name])
    made = problem(arguments)
    if verb == "initialize":
        arguments = {name: value for name, value in arguments.items() if name not in OF_PROBLEM}
    if verb == "diagnose" and "start" in arguments:
        arguments["reconstruction"] = arguments.pop("start")
    return getattr(bearslam, verb)(made, **arguments)


def _files(arguments: dict[str, Any]) -> Any:
    """A problem, and what comes back after it was written to a g2o file."""
    for name, maker in MAKERS.items():
        if name in arguments and isinstance(arguments[name], dict):
            arguments[name] = maker(**arguments[name])
    made = problem(arguments)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.g2o")
        bearslam.save(made, path)
        return made, bearslam.load(path)


def digest(value: Any) -> str:
    """A digest of all numbers and texts of a result or an error."""
    state = hashlib.blake2b(digest_size=12)
    _feed(state.update, value)
    return state.hexdigest()


def _feed(update: Any, value: Any) -> None:
    if isinstance(value, np.ndarray):
        update(f"{value.dtype}{value.shape}".encode())
        update(np.ascontiguousarray(value).tobytes())
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        for one in dataclasses.fields(value):
            update(one.name.encode())
            _feed(update, getattr(value, one.name))
    elif isinstance(value, tuple | list):
        update(f"{len(value)}[".encode())
        for one in value:
            _feed(update, one)
    elif isinstance(value, dict):
        _feed(update, list(value.items()))
    elif isinstance(value, BaseException):
        update(f"{type(value).__name__}: {value}".encode())
        _feed(update, getattr(value, "diagnosis", None))
    elif isinstance(value, float):
        update(np.float64(value).tobytes())
    else:
        update(repr(value).encode())
