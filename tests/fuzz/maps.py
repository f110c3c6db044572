# SPDX-License-Identifier: MIT OR Apache-2.0
"""Checks of reconstructions: what they say of themselves follows from their map and the input."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from . import measure, minimum
from .measure import Request

Fault = tuple[str, str]
"""A kind, and what was found."""
INFINITE = "parallel within their noise"
"""The reason of a landmark at infinity, whose bearings stay in the cost."""
FAR = 1e6
"""Map sizes beyond which nothing can be told of a view or landmark."""
NEAR = 1e3
"""The same, beyond which the map may be on the boundary of its space, where it need not be a minimum."""
LEAST = 0.01
"""Share of the cost that a converged map may still promise to lose."""
TIGHT = 1e-8
"""Largest tolerance with which a refinement ends at a minimum: a slow one has a hundred such steps left."""
LARGEST = 300
"""Sightings of the largest map that is tested for it."""
MINIMA = ("converged", "zero_residual", "no_progress")


def check(request: Request, result: Any, *, refined: bool, solved: bool = False) -> Iterator[Fault]:
    """Faults of a result, its alternatives and its components."""
    table = result.residuals.ndim == 2
    yield from _of_one(request, result, refined, table, result.components, solved)
    for k, other in enumerate(result.alternatives):
        yield from _named(f"alternative {k}", _of_one(request, other, refined, table, other.components))
    for k, other in enumerate(result.components):
        yield from _named(f"component {k}", _of_one(request, other, refined, table, None))
    costs = [other.cost for other in result.alternatives]
    if any(second < first * (1 - 1e-9) for first, second in itertools.pairwise(costs)):
        yield "order", f"alternatives cost {costs}"
    same = [other.cost for other in result.alternatives if not result.undetermined and not other.undetermined]
    if not request.robust and same and min(same) < result.cost * (1 - 1e-6) - 1e-12 and refined:
        yield "order", f"cost {result.cost!r}, that of an alternative {min(same)!r}"
    yield from _apart(result)
    yield from _covariances(result)


def _named(name: str, faults: Iterator[Fault]) -> Iterator[Fault]:
    for kind, text in faults:
        yield kind, f"{name}: {text}"


def _of_one(
    request: Request, result: Any, refined: bool, table: bool, components: Any, solved: bool = False
) -> Iterator[Fault]:
    shapes = (result.poses.shape, result.landmarks.shape)
    if shapes != ((request.views, 3), (request.landmarks, 2)):
        yield "shape", f"{shapes} of {request.views} views and {request.landmarks} landmarks"
        return
    if not np.isfinite(result.poses[:, 0]).any():
        yield "empty", "no view has a pose"
        return
    yield from _values(result, refined)
    yield from _listed(result, components)
    given = result.residuals[request.view, request.landmark] if table else result.residuals
    inliers = result.inliers[request.view, request.landmark] if table else result.inliers
    if table and np.isfinite(result.residuals).sum() != np.isfinite(given).sum():
        yield "residuals", "a residual where nothing was seen"
    at_infinity = _at_infinity(request, result, given, components)
    residual, rounding = measure.residuals(request, result.poses, result.landmarks)
    far = np.isin(request.landmark, at_infinity) & np.isfinite(result.poses[request.view, 0])
    residual[far], rounding[far] = given[far], 1e-9
    yield from _residuals(request, given, residual, rounding)
    yield from _inliers(request, given, inliers)
    yield from _cost(request, result, given, rounding, at_infinity, components)
    yield from _numbers(request, result, given, inliers, at_infinity)
    yield from _frame(request, result)
    if result.converged and request.tolerance <= TIGHT and not len(at_infinity) and len(request.view) < LARGEST:
        yield from _minimum(request, result, given, rounding)
    if solved:
        yield from _sane(request, result, given, inliers)


def _values(result: Any, refined: bool) -> Iterator[Fault]:
    for name, rows in (("poses", result.poses), ("landmarks", result.landmarks)):
        whole = np.isfinite(rows).all(axis=1) | np.isnan(rows).all(axis=1)
        if not whole.all():
            yield "values", f"{name}[{np.argmin(whole)}] is {rows[np.argmin(whole)]}"
    if np.any(np.abs(result.poses[:, 2]) > np.pi):
        yield "values", "a heading beyond pi"
    if not (np.isfinite(result.cost) and result.cost >= 0):
        yield "cost", f"is {result.cost}"
    if result.converged != (result.termination in MINIMA):
        yield "termination", f"converged {result.converged}, {result.termination}"
    if not refined and result.termination != "not_refined":
        yield "termination", f"{result.termination} without a refinement"
    for name in ("sensitivity", "uncertainty"):
        if getattr(result, name) < 0:
            yield name, f"is {getattr(result, name)}"


def _listed(result: Any, components: Any) -> Iterator[Fault]:
    """What is NaN is listed as undetermined or in a component, and nothing is both."""
    for kind, rows in (("view", result.poses), ("landmark", result.landmarks)):
        listed = [one.index for one in result.undetermined if one.kind == kind]
        missing = set(np.flatnonzero(np.isnan(rows[:, 0])).tolist())
        if len(set(listed)) < len(listed):
            yield "undetermined", f"{kind}s {sorted(listed)} repeat"
        if not set(listed) <= missing:
            yield "undetermined", f"{kind}s {sorted(set(listed) - missing)} have values"
        if components is None:
            continue
        other = [getattr(one, f"{'pose' if kind == 'view' else kind}s") for one in components]
        elsewhere = {int(k) for rows in other for k in np.flatnonzero(np.isfinite(rows[:, 0]))}
        if missing - set(listed) - elsewhere:
            yield "undetermined", f"{kind}s {sorted(missing - set(listed) - elsewhere)} are NaN, not listed"
        if set(listed) & elsewhere:
            yield "undetermined", f"{kind}s {sorted(set(listed) & elsewhere)} are listed, and in a component"


def _apart(result: Any) -> Iterator[Fault]:
    maps = [result, *result.components]
    views = [set(np.flatnonzero(np.isfinite(one.poses[:, 0])).tolist()) for one in maps]
    for k in range(1, len(maps)):
        if any(views[k] & other for other in views[:k]):
            yield "components", f"component {k - 1} shares views with another map"


def _at_infinity(request: Request, result: Any, given: Any, components: Any) -> Any:
    """Landmarks whose range is undetermined: listed, or not because a component knows it."""
    listed = [one.index for one in result.undetermined if one.kind == "landmark" and INFINITE in one.reason]
    used = np.unique(request.landmark[np.isfinite(given)])
    elsewhere = [
        k
        for k in used[np.isnan(result.landmarks[used, 0])].tolist()
        if any(np.isfinite(other.landmarks[k, 0]) for other in components or [])
    ]
    return np.array(sorted({*listed, *elsewhere}), dtype=int)


def _residuals(request: Request, given: Any, residual: Any, rounding: Any) -> Iterator[Fault]:
    if not np.array_equal(np.isfinite(given), np.isfinite(residual)):
        where = int(np.argmax(np.isfinite(given) != np.isfinite(residual)))
        yield "residuals", f"of sighting {where}: {given[where]}, expected {residual[where]}"
        return
    limit = np.pi if request.oriented else np.pi / 2
    if np.any(np.abs(given) > limit * (1 + 1e-12)):
        yield "residuals", f"beyond {limit}"
    difference = np.abs(measure.fold(given - residual, request.oriented))
    bad = difference > rounding
    if bad.any():
        k = int(np.argmax(bad))
        yield "residuals", f"of sighting {k}: {given[k]!r}, expected {residual[k]!r} within {rounding[k]:.1e}"


def _inliers(request: Request, given: Any, inliers: Any) -> Iterator[Fault]:
    if np.any(inliers & ~np.isfinite(given)):
        yield "inliers", "an inlier without a residual"
    ratio = np.abs(given) / request.sigma
    bound = 3.0 if request.robust else request.width if request.loss == "truncated" else np.inf
    known = np.isfinite(given)
    wrong = known & (inliers != (ratio <= bound))
    if np.isfinite(bound):
        wrong &= np.abs(ratio - bound) > 1e-6 * bound + 1e-9 / request.sigma
    if wrong.any():
        k = int(np.argmax(wrong))
        yield "inliers", f"sighting {k} at {ratio[k]:.6g} sigma is {'in' if inliers[k] else 'out'}, bound {bound:g}"


def _cost(
    request: Request, result: Any, given: Any, rounding: Any, at_infinity: Any, components: Any
) -> Iterator[Fault]:
    bearings, slack = measure.cost_of_bearings(request, given, rounding)
    priors, loose = measure.cost_of_priors(request, result.poses, result.landmarks)
    expected = bearings + priors
    allowed = slack + loose + 1e-8 * expected + 1e-10
    hidden = any(kind == "landmark" and place[0] in at_infinity for kind, place, _, _ in request.priors)
    if request.robust and components is None:
        return  # a component counts what it leaves out in its own way
    if request.priors and _in_one_place(result.poses[np.isfinite(result.poses[:, 0])]):
        return  # distances are all rounding
    high = np.inf if hidden else result.cost
    if not (result.cost >= expected - allowed and high <= expected + allowed):
        yield "cost", f"{result.cost!r}, expected {expected!r} within {allowed:.1e} ({bearings:.6g} + {priors:.6g})"


def _numbers(request: Request, result: Any, given: Any, inliers: Any, at_infinity: Any) -> Iterator[Fault]:
    known = np.isfinite(given)
    counted = known & inliers if request.robust else known
    rms = float(np.sqrt(np.mean(given[counted] ** 2))) if counted.any() else 0.0
    if counted.any() and not np.isclose(result.rms, rms, rtol=1e-6, atol=1e-9):
        yield "rms", f"{result.rms!r}, expected {rms!r}"
    landmarks = result.landmarks.copy()
    landmarks[at_infinity] = 0.0 if not request.priors else np.nan
    if (request.priors and len(at_infinity)) or _reach(result) > FAR:
        return
    free, numbers = measure.gauge(request, result.poses, landmarks)
    if free is None:
        return
    unknowns = 3 * np.isfinite(result.poses[:, 0]).sum() + 2 * np.isfinite(landmarks[:, 0]).sum()
    # A landmark at infinity, or on a view that sees it, is a direction.
    on_views = _on_views(request, result, counted if request.robust else known)
    if on_views is None:
        return
    refined = result.termination != "not_refined"
    unknowns -= (len(at_infinity) + on_views) if refined else 0
    expected = max(0, int(inliers.sum()) + numbers + free - int(unknowns))
    if result.freedom != expected:
        yield "freedom", f"{result.freedom}, expected {expected}: {inliers.sum()} + {numbers} + {free} - {unknowns}"


def _minimum(request: Request, result: Any, given: Any, rounding: Any) -> Iterator[Fault]:
    """A map that has converged is a minimum, unless a landmark slides onto a view or away."""
    known = np.isfinite(given)
    if not known.any():
        return
    offset = result.landmarks[request.landmark[known]] - result.poses[request.view[known], :2]
    distance = np.hypot(*offset.T)
    tiny = result.cost < 1e-6 or result.rms < 1e-13
    if _reach(result) > NEAR or distance.min() < np.median(distance) / NEAR or tiny:
        return
    # Where most landmarks slide away, they are the size of the map, and the views are in one place.
    given_places = [place[0] for kind, place, _, _ in request.priors if kind == "landmark"]
    sliding = ~np.isin(request.landmark[known], given_places)
    if distance[sliding].max(initial=0.0) > NEAR * measure.extent(result.poses) > 0:
        return
    gain = minimum.gain(request, result, LEAST)
    # Where standard deviations are tiny, rounding costs more than that.
    bearings, priors = (
        measure.cost_of_bearings(request, given, rounding),
        measure.cost_of_priors(request, result.poses, result.landmarks),
    )
    if gain > LEAST and gain * result.cost > bearings[1] + priors[1]:
        lower = minimum.decrease(request, result, LEAST)
        if lower >= LEAST:
            yield "minimum", f"converged ({result.termination}), but steps lower {result.cost!r} by {lower:.1%}"


def _on_views(request: Request, result: Any, counted: Any) -> int | None:
    """How many landmarks are on a view that sees them; None where rounding decides."""
    poses, size = result.poses[np.isfinite(result.poses[:, 0]), :2], 1.0
    if len(poses) > 1 and (poses != poses[0]).any():
        size = float(np.sqrt(np.square(poses[1:] - poses[0]).sum(axis=1).mean()))
    offset = result.landmarks[request.landmark] - result.poses[request.view, :2]
    with np.errstate(invalid="ignore"):
        near = [counted & (np.hypot(*offset.T) < bound * size) for bound in (0.5e-6, 2e-6)]
    low, high = (len(np.unique(request.landmark[one])) for one in near)
    return low if low == high else None


def _reach(result: Any, views: Sequence[int] = (), landmarks: Sequence[int] = ()) -> float:
    """Distance of the farthest from the middle of the map over the median distance, its size, but for these views and
    landmarks."""
    places = np.concatenate([result.poses[:, :2], result.landmarks])
    counted = np.ones(len(places), dtype=bool)
    counted[np.asarray(views, dtype=int)] = False
    counted[len(result.poses) + np.asarray(landmarks, dtype=int)] = False
    known = ~np.isnan(places[:, 0])
    places, counted = places[known], counted[known]
    distance = np.hypot(*(places - np.median(places, axis=0)).T)
    return float(distance[counted].max(initial=0.0) / np.median(distance))


def _sane(request: Request, result: Any, given: Any, inliers: Any) -> Iterator[Fault]:
    """The views of a map are apart, its landmarks within reach and not behind all that see them."""
    known = result.poses[np.isfinite(result.poses[:, 0]), :2]
    if len(known) > 3 and result.rms > 0.1:
        apart = np.hypot(*(known - np.median(known, axis=0)).T)
        if np.median(apart) < 1e-9 * apart.max():
            yield "collapsed", f"most of {len(known)} views are in one place, rms {result.rms:.3g}"
            return
    given_places = [place[0] for kind, place, _, _ in request.priors if kind == "landmark"]
    # Where priors know the position of a view it stays, however far.
    poses = [(place[0], root) for kind, place, _, root in request.priors if kind == "pose"]
    given_views = [view for view, root in poses if root[:, 0].any() and root[:, 1].any()]
    if result.rms > 1e-9 and (reach := _reach(result, given_views, given_places)) > FAR:
        yield "far", f"a view or landmark is {reach:.1e} map sizes away, not listed"
    if request.oriented:
        free = np.setdiff1d(np.flatnonzero(np.isfinite(result.landmarks[:, 0])), given_places)
        for landmark in free:
            own = np.abs(given[(request.landmark == landmark) & inliers])
            if len(own) and own.min() > np.pi / 2:
                yield "behind", f"landmark {landmark} is behind all that see it: residuals {own.round(2).tolist()}"
                break


def _in_one_place(poses: Any) -> bool:
    """Whether several views are so close together that their distances are rounding."""
    return len(poses) > 1 and bool(measure.extent(poses) <= 1e-9 * max(1.0, np.abs(poses[:, :2]).max()))


def _frame(request: Request, result: Any) -> Iterator[Fault]:
    """From bearings alone the first view is at the origin, and the mean square distance of the others is 1."""
    known = result.poses[np.isfinite(result.poses[:, 0])]
    if request.priors or _reach(result) > FAR or _in_one_place(known):
        return  # only a map with a size has a frame
    square = (known[1:, :2] ** 2).sum(axis=1)
    if np.any(known[0] != 0.0):
        yield "frame", f"the first view is at {known[0]}"
    elif len(square) and not np.isclose(np.mean(square), 1.0, rtol=1e-9):
        yield "frame", f"the others are at a mean square distance of {np.mean(square)!r}"
    if not request.oriented and np.any(np.abs(known[:, 2]) > np.pi / 2 * (1 + 1e-12)):
        yield "frame", "a heading beyond pi/2"


def _covariances(result: Any) -> Iterator[Fault]:
    for name, rows in (("pose", result.poses), ("landmark", result.landmarks)):
        blocks = getattr(result, f"{name}_covariance")
        if blocks is None:
            continue
        unknown = np.isnan(rows[:, 0])
        if not np.isnan(blocks[unknown]).all():
            yield "covariance", f"of {name}s that are NaN"
        variances = np.diagonal(blocks, axis1=1, axis2=2)
        # What the frame holds has the variance 0, up to rounding.
        least = 1e-10 * np.max(np.where(np.isfinite(variances), variances, 0), axis=0, initial=0)
        for k in np.flatnonzero(~unknown):
            block, own = blocks[k], variances[k]
            if np.isnan(own).any() or (own < -least).any():
                yield "covariance", f"variances of {name} {k} are {own}"
            elif not np.allclose(block, block.T, rtol=1e-9, atol=0, equal_nan=True):
                yield "covariance", f"of {name} {k} is not symmetric"
            elif np.isfinite(block).all():
                width = np.sqrt(np.maximum(own, least) + 1e-300)
                least_value = np.linalg.eigvalsh(block / np.outer(width, width))[0]
                if least_value < -1e-6:
                    yield "covariance", f"of {name} {k} in its own units has the eigenvalue {least_value}"
