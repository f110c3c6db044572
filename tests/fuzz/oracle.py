# SPDX-License-Identifier: MIT OR Apache-2.0
"""What is wrong with an answer: a check for each verb, and one for errors."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from . import closed_forms, maps, measure
from .inputs import Input
from .maps import Fault

KNOWN = ("odometry", "pose_priors", "landmark_priors")


def check(given: Input, answer: Any) -> list[Fault]:
    """The faults of what a verb returned."""
    with np.errstate(all="ignore"):
        return list(_check(given, answer))


def _check(given: Input, answer: Any) -> Iterator[Fault]:
    arguments = given.arguments
    match given.verb:
        case "solve" | "refine" | "initialize":
            request = measure.Request.of(arguments, joint=given.verb != "initialize")
            solved = given.verb == "solve"
            yield from maps.check(request, answer, refined=given.verb != "initialize", solved=solved)
            wanted = arguments.get("covariance", False)
            if (answer.pose_covariance is None) == bool(wanted):
                yield "covariance", f"asked for {wanted}, got {answer.covariance_frame}"
        case "diagnose":
            yield from _diagnosis(measure.Request.of(arguments, joint=True), answer)
        case "files":
            yield from _files(*answer)
        case "sweep" | "simulate":
            return
        case verb:
            yield from getattr(closed_forms, verb)(arguments, answer)


def check_error(given: Input, error: BaseException) -> list[Fault]:
    """The faults of an error: one that speaks of what the input does not have."""
    text = str(error)
    if not text.strip():
        return [("error", "without a message")]
    if given.wild:
        return []
    arguments = given.arguments
    faults = []
    for word, names in {
        "odometry": KNOWN[:1],
        "motion": KNOWN[:1],
        "prior": KNOWN[1:],
        "start": ("start",),
        "loss": ("loss", "refinement"),
        "robust": ("robust",),
    }.items():
        named = re.match(rf"(\w+_)?{word}s?\b", text) or re.search(rf"\bof the {word}\b", text)
        if named and not any(name in arguments for name in names):
            faults.append(("error", f"speaks of {word}, which was not given: {text}"))
    table = arguments.get("bearings")
    if isinstance(table, np.ndarray) and table.ndim == 2 and given.verb in ("solve", "refine", "initialize"):
        for kind, count in zip(("view", "landmark"), table.shape, strict=True):
            faults += [
                ("error", f"names {kind} {number} of {count}: {text}")
                for number in re.findall(rf"\b{kind} (\d+)\b", text)
                if int(number) >= count
            ]
    return faults


def _diagnosis(request: measure.Request, answer: Any) -> Iterator[Fault]:
    counted = (answer.views, answer.landmarks, answer.sightings)
    if counted != (request.views, request.landmarks, len(request.view)):
        yield "diagnosis", f"{counted} of {(request.views, request.landmarks, len(request.view))}"
    errors = [finding for finding in answer.findings if finding.severity == "error"]
    if answer.determined == bool(errors):
        yield "diagnosis", f"determined {answer.determined} with {len(errors)} errors"
    if answer.determined and answer.extra > 0:
        yield "diagnosis", f"determined with {answer.extra} extra directions"
    order = [("error", "warning", "note").index(finding.severity) for finding in answer.findings]
    if order != sorted(order):
        yield "diagnosis", "findings are not in order"
    for finding in answer.findings:
        if not (finding.message and set(finding.views) <= set(range(request.views))):
            yield "diagnosis", f"{finding}"
        if not set(finding.landmarks) <= set(range(request.landmarks)):
            yield "diagnosis", f"{finding}"
    values = answer.singular_values
    if np.any(~(values >= 0)) or np.any(np.diff(values) < 0):
        yield "diagnosis", f"singular values {values}"
    for direction in answer.null_directions:
        shares = [mover.share for mover in direction.movers]
        if not (direction.deviation >= 0 and (not direction.free or direction.deviation == np.inf)):
            yield "diagnosis", f"a direction with free {direction.free}, deviation {direction.deviation}"
        if not (np.isfinite(shares).all() and sum(shares) <= 1 + 1e-9 and sorted(shares, reverse=True) == shares):
            yield "diagnosis", f"movers with the shares {shares}"
    if answer.condition < 1 or answer.noise < 0 or answer.mirror_margin < 0:
        yield "diagnosis", f"condition {answer.condition}, noise {answer.noise}, margin {answer.mirror_margin}"
    for component in answer.components:
        views, landmarks = np.isin(request.view, component.views), np.isin(request.landmark, component.landmarks)
        if component.sightings != (views & landmarks).sum():
            yield "diagnosis", f"{component.sightings} sightings in a component of {(views & landmarks).sum()}"
    if not str(answer).strip():
        yield "diagnosis", "an empty report"


def _files(made: Any, read: Any) -> Iterator[Fault]:
    """A problem comes back from a file bit by bit."""
    names = ("view_ids", "landmark_ids", "fixed_views", "fixed_landmarks")
    yield from (("files", name) for name in names if getattr(made, name) != getattr(read, name))
    for name in ("sightings", "odometry", "pose_priors", "landmark_priors", "start"):
        one, other = getattr(made, name), getattr(read, name)
        if one is None or other is None:
            if one is not other:
                yield "files", f"{name}: {one} came back as {other}"
            continue
        fields = one._fields if isinstance(one, tuple) else list(vars(one))
        for part in fields:
            mine, yours = getattr(one, part), getattr(other, part)
            if part == "sigma" and np.ndim(mine) == 3 != np.ndim(yours):
                # Covariances without correlation come back as standard deviations.
                yours = yours[:, :, None] ** 2 * np.eye(yours.shape[1])
                if np.allclose(mine, yours, rtol=1e-12, atol=0):
                    continue
            if part == "sigma" and np.ndim(mine) == np.ndim(yours) == 3:
                # Covariances that are symmetric but for rounding come back symmetric.
                mine = (mine + mine.swapaxes(1, 2)) / 2
            if part == "bearing":
                # An angle of many turns may come back without them, and rounded.
                turns = np.abs(np.exp(1j * mine) - np.exp(1j * yours))
                if np.all(turns <= 1e-15 + 1e-15 * np.abs(mine)):
                    continue
            if not np.array_equal(_plain(mine), _plain(yours), equal_nan=True):
                yield "files", f"{name}.{part}: {mine} came back as {yours}"


def _plain(value: Any) -> Any:
    return np.zeros(0) if value is None else np.asarray(value)
