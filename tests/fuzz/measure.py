# SPDX-License-Identifier: MIT OR Apache-2.0
"""Residuals, cost and freedom of a map by numpy, from the definitions in docs/theory.md, each with its rounding."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .scenes import wrap

EPS = 2.0**-52
WIDTHS = {"huber": 1.345, "cauchy": 2.385, "truncated": 3.0}
"""Default widths of the losses [standard deviations]."""


@dataclass
class Request:
    """What the oracle knows of an input: one entry per sighting, odometry and priors with covariances."""

    views: int
    landmarks: int
    view: Any
    landmark: Any
    bearing: Any
    sigma: Any
    oriented: bool
    loss: str
    width: float
    robust: bool
    tolerance: float
    priors: list[tuple[str, tuple[int, ...], Any, Any]] = field(default_factory=list)

    @classmethod
    def of(cls, arguments: dict[str, Any], *, joint: bool) -> Request:
        """From the arguments of a call that was not refused, with or without odometry and priors."""
        table = np.asarray(arguments["bearings"], dtype=float)
        view, landmark = np.nonzero(~np.isnan(table))
        given = arguments.get("sigma")
        sigma = np.asarray(1.0 if given is None else given, dtype=float)
        # A list of sightings may have one for each of them.
        listed = arguments.get("form", "dense") != "dense" and sigma.shape == view.shape
        sigma = sigma if listed else np.broadcast_to(sigma, table.shape)[view, landmark]
        loss = arguments.get("loss", "squared")
        refinement = arguments.get("refinement") or {}
        width = refinement.get("loss_scale")
        made = cls(
            *table.shape,
            view,
            landmark,
            table[view, landmark],
            sigma,
            arguments.get("oriented", True),
            loss,
            WIDTHS.get(loss, np.inf) if width is None else width,
            arguments.get("robust", False),
            refinement.get("tolerance", 1e-10),
        )
        if joint:
            made._take_priors(arguments)
        if arguments.get("form") == "sightings":
            # These do not say how many views and landmarks there are beyond those seen.
            made.views, made.landmarks = int(view.max()) + 1, int(landmark.max()) + 1
        known = [(kind == "landmark", k + 1) for kind, place, _, _ in made.priors for k in place]
        made.views = max([made.views, *(count for landmark, count in known if not landmark)])
        made.landmarks = max([made.landmarks, *(count for landmark, count in known if landmark)])
        return made

    def _take_priors(self, arguments: dict[str, Any]) -> None:
        kinds = {
            "odometry": ("motion", ("start", "end"), "delta"),
            "pose_priors": ("pose", ("view",), "pose"),
            "landmark_priors": ("landmark", ("landmark",), "position"),
        }
        for name, (kind, ends, value) in kinds.items():
            given = arguments.get(name)
            if given is None:
                continue
            numbers = np.asarray(given[value], dtype=float)
            for k in range(len(numbers)):
                place = tuple(int(given[end][k]) for end in ends)
                self.priors.append((kind, place, numbers[k], _root(given["sigma"], k, numbers.shape[1])))


def _root(sigma: Any, k: int, n: int) -> Any:
    """A root W of the information, W^T W = C^-1; rows of zeros for what is unknown."""
    given = np.asarray(sigma, dtype=float)
    if given.ndim == 3:
        factor = np.linalg.cholesky(given[k])
        return np.linalg.inv(factor)
    each = given if given.ndim < 2 else given[k]
    return np.diag(1 / np.broadcast_to(each, n))


def residuals(request: Request, poses: Any, landmarks: Any) -> tuple[Any, Any]:
    """Predicted minus measured bearing of each sighting, NaN where an end is NaN, and its rounding."""
    pose, point = poses[request.view], landmarks[request.landmark]
    offset = point - pose[:, :2]
    distance = np.hypot(offset[:, 0], offset[:, 1])
    residual = fold(turn(offset, pose[:, 2], request.bearing), request.oriented)
    # The map was found in another frame, whose origin may be anywhere within the extent of the views.
    size = np.abs(pose[:, :2]).sum(axis=1) + np.abs(point).sum(axis=1) + extent(poses)
    # A landmark exactly on its view has no bearing; one nearly there has one of any accuracy.
    with np.errstate(divide="ignore", invalid="ignore"):
        rounding = 1e-9 + 256 * EPS * (size / distance + np.abs(request.bearing))
    rounding[distance == 0] = np.pi
    return residual, rounding


def extent(poses: Any) -> float:
    """Longer side of the box around the views."""
    known = poses[np.isfinite(poses[:, 0]), :2]
    return float(np.ptp(known, axis=0).max()) if len(known) else 0.0


def turn(offset: Any, heading: Any, bearing: Any) -> Any:
    """Direction of an offset minus a heading and a bearing, however large these are."""
    return np.angle(
        np.exp(1j * (np.arctan2(offset[..., 1], offset[..., 0]))) * np.exp(-1j * heading) * np.exp(-1j * bearing)
    )


def fold(angle: Any, oriented: bool) -> Any:
    """An angle as a residual: of rays in (-pi, pi], of lines in (-pi/2, pi/2]."""
    return wrap(angle) if oriented else wrap(2 * angle) / 2


def loss(request: Request, square: Any) -> Any:
    """What squares of residuals over sigma add to twice the cost."""
    if request.robust:
        return np.minimum(square, 9.0)
    c = request.width
    match request.loss:
        case "huber":
            return np.where(square <= c * c, square, (2 * np.sqrt(square) - c) * c)
        case "cauchy":
            return c * c * np.log1p(square / (c * c))
        case "truncated":
            return np.minimum(square, c * c)
    return square


def cost_of_bearings(request: Request, residual: Any, rounding: Any) -> tuple[float, float]:
    """Half the sum of the losses of the residuals that there are, and its rounding."""
    known = np.isfinite(residual)
    r, d = np.abs(residual[known]) / request.sigma[known], rounding[known] / request.sigma[known]
    values = loss(request, r * r)
    # No loss rises faster than the square.
    slack = np.minimum((r + d) ** 2 - r * r, 9.0 if request.robust else np.inf)
    missing = 4.5 * (~known).sum() if request.robust else 0.0
    return float(values.sum() / 2 + missing), float(slack.sum() / 2)


def cost_of_priors(request: Request, poses: Any, landmarks: Any) -> tuple[float, float]:
    """Half the sum of squares of odometry and priors between what is determined, and its rounding."""
    total = slack = 0.0
    for kind, place, value, root in request.priors:
        error, rounding = _error(kind, place, value, poses, landmarks)
        if not np.isfinite(error).all():
            continue
        used = root != 0
        square = _square(root, error)
        each = (np.abs(root) * np.where(used, rounding, 0.0)).sum(axis=1)
        total += square / 2
        slack += float((2 * np.abs(_whitened(root, error)) + each) @ each) / 2
        # A half turn is one to the left or to the right, which with a correlation are not the same.
        if len(error) == 3 and np.pi - abs(error[2]) <= rounding[2]:
            other = error - [0.0, 0.0, np.copysign(2 * np.pi, error[2])]
            slack += abs(_square(root, other) - square) / 2
    return total, slack


def _whitened(root: Any, error: Any) -> Any:
    used = root != 0
    return np.where(used, root * np.where(used, error, 0.0), 0.0).sum(axis=1)


def _square(root: Any, error: Any) -> float:
    white = _whitened(root, error)
    return float(white @ white)


def _error(kind: str, place: tuple[int, ...], value: Any, poses: Any, landmarks: Any) -> tuple[Any, Any]:
    """The residual of odometry or a prior, (T25), and its rounding."""
    if kind == "landmark":
        point = landmarks[place[0]]
        return point - value, 64 * EPS * (np.abs(point) + np.abs(value)).sum() * np.ones(2)
    if kind == "pose":
        pose = poses[place[0]]
        error = pose - value
        error[2] = wrap(error[2])
        length = 64 * EPS * (np.abs(pose[:2]) + np.abs(value[:2])).sum()
        return error, np.array([length, length, 1e-14 + EPS * abs(value[2])])
    first, last = poses[place[0]], poses[place[1]]
    turn = -(first[2] + value[2])
    c, s = np.cos(turn), np.sin(turn)
    x, y = last[:2] - first[:2]
    back, forth = np.cos(value[2]), np.sin(value[2])
    there = np.array([back * value[0] + forth * value[1], back * value[1] - forth * value[0]])
    error = np.array([c * x - s * y, s * x + c * y, 0.0])
    error[:2] -= there
    error[2] = wrap(last[2] - first[2] - value[2])
    length = 64 * EPS * (np.abs(first[:2]) + np.abs(last[:2]) + np.abs(value[:2])).sum() * (1 + abs(value[2]))
    return error, np.array([length, length, 1e-14 + EPS * abs(value[2])])


def gauge(request: Request, poses: Any, landmarks: Any) -> tuple[int | None, int]:
    """Directions of the gauge that odometry and priors leave free, None if rounding decides, and their numbers."""
    if not request.priors:
        return 4, 0
    places = np.concatenate([poses[:, :2], landmarks])
    places = places[np.isfinite(places).all(axis=1)]
    middle = places.mean(axis=0)
    size = np.sqrt(((places - middle) ** 2).sum(axis=1).mean()) or 1.0
    rows, numbers = [], 0
    for kind, place, _, root in request.priors:
        ends = [landmarks[place[0]]] if kind == "landmark" else [poses[k] for k in place]
        if not all(np.isfinite(end).all() for end in ends):
            continue
        numbers += int((root != 0).any(axis=1).sum())
        rows += [root @ one for one in _along_gauge(kind, ends, middle, size)]
    if not rows:
        return 4, numbers
    changes = np.concatenate(rows)
    # Relative to the terms that cancel: those of the same root on a step of the size of the map, by which headings turn
    # by one over that size.
    unit = np.array([1, 1, 1 / size])
    scale = np.concatenate([np.abs(root) @ unit[: root.shape[1]] for root in _roots(request, poses, landmarks)])
    with np.errstate(all="ignore"):
        relative = changes / np.where(scale > 0, scale, 1.0)[:, None]
        relative = relative[np.isfinite(relative).all(axis=1)]
        norms = np.linalg.norm(relative, axis=1)
        # What changes less than rounding does not change.
        dependent = relative[norms > 1e-13]
        values = np.linalg.svd(dependent, compute_uv=False) if len(dependent) else np.zeros(0)
    if len(values) == 0 or values[0] == 0:
        return 4, numbers
    clear = (values > 1e-4 * values[0]) | (values < 1e-13 * values[0])
    clear_rows = (norms > 1e-6) | (norms < 1e-13)
    if not (clear.all() and clear_rows.all()):
        return None, numbers
    return 4 - int((values > 1e-4 * values[0]).sum()), numbers


def _roots(request: Request, poses: Any, landmarks: Any) -> list[Any]:
    """The roots of the information of what lies between determined ends."""
    found = []
    for kind, place, _, root in request.priors:
        ends = [landmarks[place[0]]] if kind == "landmark" else [poses[k] for k in place]
        if all(np.isfinite(end).all() for end in ends):
            found.append(root)
    return found


def _along_gauge(kind: str, ends: list[Any], middle: Any, size: float) -> list[Any]:
    """Change of the residual of a prior along the two translations, the rotation and the scaling, (n, 4)."""
    if kind == "motion":
        first, last = ends
        distance = np.hypot(*(last[:2] - first[:2])) / size
        # A rotation and a translation change nothing; a scaling changes the length, along and across alike.
        return [np.array([[0, 0, 0, distance], [0, 0, 0, distance], [0, 0, 0, 0]])]
    x, y = (ends[0][:2] - middle) / size
    rows = [[1, 0, -y, x], [0, 1, x, y]]
    if kind == "pose":
        rows.append([0, 0, 1 / size, 0])
    return [np.array(rows, dtype=float)]
