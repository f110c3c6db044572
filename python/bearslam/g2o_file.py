# SPDX-License-Identifier: MIT OR Apache-2.0
"""The format of g2o, for poses and landmarks in the plane.

What g2o has no words for are comments that `parse` understands and g2o passes over: ``# bearslam name 7 front door``,
``# bearslam unknown 7`` for a vertex that nothing is known of, and ``# bearslam sigma ...`` or ``# bearslam covariance
...`` (an upper triangle, row by row) above an edge with information from which it would not come back exactly.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from decimal import Decimal
from functools import partial

import numpy as np

from bearslam.assembly import Assembly, Spread
from bearslam.coerce import FloatArray, quote
from bearslam.errors import InvalidInputError
from bearslam.information import INDEX, covariance, information, informations, is_diagonal, sigma
from bearslam.lines import decode, identifier, numbered, numbers
from bearslam.maps import Map
from bearslam.problem import Offsets, Problem, ProblemLike, Sightings, tabulate
from bearslam.reconstruction import Reconstruction

__all__ = ["TAG", "TAGS", "from_information", "parse", "render"]

TAGS = {
    "VERTEX_SE2": (1, 3),
    "VERTEX_XY": (1, 2),
    "EDGE_SE2": (2, 9),
    "EDGE_BEARING_SE2_XY": (2, 2),
    "EDGE_SE2_XY": (2, 5),
    "EDGE_PRIOR_SE2": (1, 9),
    "EDGE_PRIOR_XY": (1, 5),
}
"""Identifiers and numbers after a tag."""
TAG = re.compile(r"[A-Z][A-Z0-9_:]*")
"""What may be a tag of somebody else's."""
LARGEST = 2**31
"""Beyond the identifiers of g2o."""
AGREEMENT = 1e-9
"""How far the information of an edge may be from what a comment above it says, in parts of the information."""
NOTHING = "no EDGE_BEARING_SE2_XY or EDGE_SE2_XY"


def parse(data: bytes, name: str) -> Problem:
    """The problem in the content of a file of that name."""
    graph = Assembly(name, shared=True)
    exact: tuple[int, str, tuple[float, ...]] | None = None
    for line, text in numbered(decode(data, name)):
        words = text.split()
        if not words:
            continue
        tag = words[0]
        if tag.startswith("#"):
            if words[:2] == ["#", "bearslam"]:
                exact = _comment(graph, line, text.strip(), words[2:], exact)
            continue
        where = graph.where(line)
        if "#" in text:
            words = text[: text.index("#")].split()
        if tag == "FIX":
            if len(words) < 2:
                raise InvalidInputError(f"{where}: expected the number of a vertex after FIX, got nothing")
            graph.fixed += [(line, identifier(word, where)) for word in words[1:]]
        elif tag in TAGS:
            ids, count = TAGS[tag]
            if len(words) != 1 + ids + count:
                raise InvalidInputError(f"{where}: expected {ids + count} numbers after {tag}, got {len(words) - 1}")
            ends = tuple(identifier(word, where) for word in words[1 : 1 + ids])
            values = numbers(words[1 + ids :], where) if text.isascii() else _no_ascii(words, where)
            said = None if exact is None else exact[1:]
            _add(graph, line, tag, ends, values, tuple(words[1 + ids :]), said)
            exact = None
        elif TAG.fullmatch(tag):
            graph.others.append((tag, text.strip()))
        else:
            raise InvalidInputError(f"{where}: expected a tag such as VERTEX_SE2, got {quote(tag)}")
    if exact is not None:
        raise InvalidInputError(f"{graph.where(exact[0])}: there is no edge that this belongs to")
    return graph.problem(NOTHING, "kept but not used", keep=True)


def from_information(texts: tuple[str, ...], where: str, *, unknown: bool = False) -> Spread:
    """The noise of an edge from the upper triangle of its information; 0 is for what is `unknown`."""
    if is_diagonal([Decimal(text) for text in texts]):
        diagonal = [texts[row[i]] for i, row in enumerate(INDEX[len(texts)])]
        for text in diagonal:
            if not (float(text) > 0 or (unknown and float(text) == 0)):
                raise InvalidInputError(f"{where}: expected information above 0, got {quote(text)}")
        deviations = tuple(math.inf if float(text) == 0 else sigma(text) for text in diagonal)
        return Spread(deviations, partial(_upper, texts))
    upper = covariance(texts)
    if upper is None:
        raise InvalidInputError(f"{where}: expected information that is positive definite, got {' '.join(texts)}")
    return Spread(None, lambda: upper)


def _upper(texts: tuple[str, ...]) -> tuple[float, ...]:
    return covariance(texts) or ()


def _add(
    graph: Assembly,
    line: int,
    tag: str,
    ends: tuple[str, ...],
    values: Sequence[float],
    texts: tuple[str, ...],
    said: tuple[str, tuple[float, ...]] | None,
) -> None:
    where = graph.where(line)
    if tag in ("VERTEX_SE2", "VERTEX_XY", "EDGE_BEARING_SE2_XY"):
        if said is not None:
            raise InvalidInputError(f"{where}: expected the edge that the comment above belongs to, got {tag}")
        if tag == "VERTEX_SE2":
            graph.pose(line, ends[0], tuple(values))
        elif tag == "VERTEX_XY":
            graph.point(line, ends[0], tuple(values))
        elif values[1] > 0:
            graph.bearing(line, (ends[0], ends[1]), values[0], sigma(texts[1]))
        else:
            raise InvalidInputError(f"{where}: expected information above 0, got {quote(texts[1])}")
        return
    size = 2 if tag in ("EDGE_SE2_XY", "EDGE_PRIOR_XY") else 3
    place = tuple(values[:size])
    prior = tag == "EDGE_PRIOR_SE2"
    turn = place[2] if prior else 0.0
    if said is None:
        spread = _turned(from_information(texts[size:], where, unknown=prior), turn, where)
    else:
        spread = _said(*said, turn, values[size:], where)
    if tag == "EDGE_SE2":
        graph.motion(line, (ends[0], ends[1]), place, spread)
    elif tag == "EDGE_SE2_XY":
        graph.offset(line, (ends[0], ends[1]), place, spread)
    elif prior:
        graph.pose_prior(line, ends[0], place, spread)
    else:
        graph.point_prior(line, ends[0], place, spread)


def _no_ascii(words: Sequence[str], where: str) -> list[float]:
    wrong = next((word for word in words if not word.isascii()), words[0])
    raise InvalidInputError(f"{where}: expected a finite number, got {quote(wrong)}")


def _comment(
    graph: Assembly,
    line: int,
    text: str,
    words: Sequence[str],
    exact: tuple[int, str, tuple[float, ...]] | None,
) -> tuple[int, str, tuple[float, ...]] | None:
    """Take in what a comment of bearslam says, and return what it says of the edge below."""
    where = graph.where(line)
    kind = words[0] if words else ""
    if kind == "name":
        if len(words) < 3:
            raise InvalidInputError(f"{where}: expected the number and the name of a vertex, got {quote(text)}")
        key = identifier(words[1], where)
        if key in graph.names:
            raise InvalidInputError(
                f"{where}: vertex {key} is named a second time; the first is on line {graph.names[key][0]}"
            )
        graph.names[key] = line, text.split(maxsplit=4)[4]
    elif kind == "unknown":
        if len(words) != 2:
            raise InvalidInputError(f"{where}: expected the number of a vertex, got {quote(text)}")
        graph.unknown[identifier(words[1], where)] = line
    elif kind in ("sigma", "covariance"):
        if exact is not None:
            raise InvalidInputError(f"{graph.where(exact[0])}: there is no edge that this belongs to")
        known = [word for word in words[1:] if word != "inf" or kind != "sigma"]
        if numbers(known, where) and len(words) - 1 in (3, 6):
            return line, kind, tuple(map(float, words[1:]))
        raise InvalidInputError(f"{where}: expected 3 or 6 numbers, got {len(words) - 1}")
    return exact


def _turned(spread: Spread, turn: float, where: str) -> Spread:
    """Noise along the axes of a known pose as noise along the axes of the map."""
    deviations = spread.sigma
    if turn == 0 or (deviations is not None and deviations[0] == deviations[1]):
        return spread
    if deviations is not None and math.inf in deviations[:2]:
        raise InvalidInputError(
            f"{where}: expected information on both x and y or on neither, as the pose is turned: bearslam has "
            "standard deviations along the axes of the map"
        )
    if deviations is not None and math.isinf(deviations[2]):
        raise InvalidInputError(
            f"{where}: expected the same information on x and y, as the pose is turned and nothing is known of its "
            "heading: bearslam has standard deviations along the axes of the map"
        )
    local = _matrix(spread.upper())
    axes = _axes(turn)
    upper = tuple(_triangle(axes @ local @ axes.T))
    return Spread(None, lambda: upper)


def _said(kind: str, noise: tuple[float, ...], turn: float, stated: Sequence[float], where: str) -> Spread:
    """Noise from a comment, if it is that of the edge."""
    size = 3 if len(stated) == 6 else 2
    wanted = size if kind == "sigma" else len(stated)
    if len(noise) != wanted or not all(value > 0 for value in _diagonal(kind, noise)):
        raise InvalidInputError(f"{where}: expected an edge that the comment above belongs to, got another")
    try:
        texts, _ = _stated(kind, noise, turn)
    except ArithmeticError:
        raise InvalidInputError(f"{where}: expected a positive definite covariance in the comment above") from None
    matrix, other = _matrix(stated), _matrix(list(map(float, texts)))
    scale = np.sqrt(np.diag(matrix).clip(0))
    scale[:2] = scale[:2].max()
    if not (np.abs(matrix - other) <= AGREEMENT * np.outer(scale, scale)).all():
        raise InvalidInputError(f"{where}: expected the information that the comment above says, got other")
    if kind == "sigma":
        return Spread(noise, lambda: tuple(_triangle(np.diag(np.square(noise)))))
    deviations = tuple(map(math.sqrt, _diagonal(kind, noise))) if is_diagonal(noise) else None
    return Spread(deviations, lambda: noise)


def _stated(kind: str, noise: tuple[float, ...], turn: float) -> tuple[tuple[str, ...], bool]:
    """The information of noise along the axes of a pose that is turned, and whether it comes back from that."""
    if kind == "sigma":
        diagonal = ["0" if math.isinf(value) else information(value) for value in noise]
        texts = tuple(diagonal[i] if i == j else "0" for i in range(len(noise)) for j in range(i, len(noise)))
        if turn == 0 or noise[0] == noise[1]:
            return texts, True
    else:
        texts, exact = informations(noise)
        if turn == 0:
            return texts, exact
    axes = _axes(turn)
    local = axes.T @ _matrix(list(map(float, texts))) @ axes
    return tuple(map(repr, _triangle(local))), False


def render(what: Reconstruction | ProblemLike) -> str:
    """The content of a file that holds a problem, or a map with all that it was made from."""
    problem = _problem(what)
    seen = problem.sightings
    if seen.sigma is None:
        raise InvalidInputError(
            "sightings: expected standard deviations, for g2o states the information of every edge, got none; give "
            "sigma (on the command line --sigma-deg)"
        )
    _check(problem, seen)
    view_keys, landmark_keys, comments = _keys(problem)
    lines = ["# views are VERTEX_SE2, landmarks VERTEX_XY", *comments]
    lines += _vertices("VERTEX_SE2", view_keys, None if problem.start is None else problem.start.poses)
    lines += _vertices("VERTEX_XY", landmark_keys, None if problem.start is None else problem.start.landmarks)
    lines += [f"FIX {view_keys[i]}" for i in problem.fixed_views]
    lines += [f"FIX {landmark_keys[j]}" for j in problem.fixed_landmarks]
    lines += problem.others
    if (pose_priors := problem.pose_priors) is not None:
        for i, pose, noise in zip(pose_priors.view, pose_priors.pose.tolist(), _noises(pose_priors.sigma), strict=True):
            lines += _edge(f"EDGE_PRIOR_SE2 {view_keys[i]}", pose, noise, pose[2])
    if (points := problem.landmark_priors) is not None:
        for j, place, noise in zip(points.landmark, points.position.tolist(), _noises(points.sigma), strict=True):
            lines += _edge(f"EDGE_PRIOR_XY {landmark_keys[j]}", place, noise)
    if (odometry := problem.odometry) is not None:
        motions = zip(odometry.start, odometry.end, odometry.delta.tolist(), _noises(odometry.sigma), strict=True)
        for start, end, delta, noise in motions:
            lines += _edge(f"EDGE_SE2 {view_keys[start]} {view_keys[end]}", delta, noise)
    lines += _sightings(seen, problem.offsets, view_keys, landmark_keys)
    return "\n".join(lines) + "\n"


def _problem(what: Reconstruction | ProblemLike) -> Problem:
    if isinstance(what, Problem):
        return what
    if isinstance(what, Reconstruction):
        m, n = len(what.poses), len(what.landmarks)
        views, landmarks = what.view_ids, what.landmark_ids
        known = np.isfinite(what.poses).any() or np.isfinite(what.landmarks).any()
        return Problem(
            what.sightings,
            list(map(str, range(m))) if views is None else views,
            list(map(str, range(m, m + n))) if landmarks is None else landmarks,
            odometry=what.odometry,
            pose_priors=what.pose_priors,
            landmark_priors=what.landmark_priors,
            start=Map(what.poses, what.landmarks) if known else None,
        )
    table = tabulate(what)
    weighted = isinstance(what, Sightings) and what.sigma is not None
    seen = table.sightings
    return Problem(
        seen if weighted else Sightings(seen.view, seen.landmark, seen.bearing),
        map(str, range(table.views)),
        map(str, range(table.views, table.views + table.landmarks)),
    )


def _check(problem: Problem, seen: Sightings) -> None:
    """Refuse what would not come back."""
    if problem.start is not None:
        for name, rows in zip(("poses", "landmarks"), problem.start, strict=True):
            missing = np.isnan(rows)
            partly = missing.any(axis=1) & ~missing.all(axis=1)
            if partly.any():
                raise InvalidInputError(
                    f"start: {name}[{int(np.argmax(partly))}]: expected all or none of the coordinates for a g2o file"
                )
    pairs, counts = np.unique(np.stack([seen.view, seen.landmark]), axis=1, return_counts=True)
    if (counts > 1).any():
        view, landmark = pairs[:, int(np.argmax(counts > 1))]
        raise InvalidInputError(f"sightings: view {view} sees landmark {landmark} more than once")
    for line in problem.others:
        tag = line.split(maxsplit=1)[0] if line.strip() else ""
        known = tag in TAGS or tag == "FIX" or not TAG.fullmatch(tag)
        if known or line != line.strip() or "\n" in line or "\r" in line:
            raise InvalidInputError(
                f"others: expected lines with tags that bearslam does not use, as load keeps them, got {quote(line)}"
            )


def _keys(problem: Problem) -> tuple[Sequence[str], Sequence[str], list[str]]:
    """Identifiers of the views and landmarks: their names where these are such, otherwise numbers and comments."""
    names = (*problem.view_ids, *problem.landmark_ids)
    if len(set(names)) == len(names) and all(map(_is_key, names)):
        return problem.view_ids, problem.landmark_ids, []
    keys = list(map(str, range(len(names))))
    comments = [f"# bearslam name {key} {name}" for key, name in zip(keys, names, strict=True)]
    return keys[: len(problem.view_ids)], keys[len(problem.view_ids) :], comments


def _is_key(name: str) -> bool:
    return name.isascii() and name.isdecimal() and len(name) <= 10 and name == str(int(name)) and int(name) < LARGEST


def _vertices(tag: str, keys: Sequence[str], places: FloatArray | None) -> Iterator[str]:
    nowhere = " 0" * TAGS[tag][1]
    for i, key in enumerate(keys):
        if places is None or math.isnan(places[i, 0]):
            yield f"# bearslam unknown {key}"
            yield f"{tag} {key}{nowhere}"
        else:
            yield f"{tag} {key} {_join(places[i].tolist())}"


def _sightings(
    seen: Sightings, offsets: Offsets | None, view_keys: Sequence[str], landmark_keys: Sequence[str]
) -> list[str]:
    assert seen.sigma is not None
    lines = []
    ranged: dict[int, tuple[list[float], tuple[str, tuple[float, ...]]]] = {}
    if offsets is not None:
        index = offsets.sighting
        for name, ours, theirs in (
            ("bearing", seen.bearing[index], offsets.bearing),
            ("sigma", seen.sigma[index], offsets.bearing_sigma),
        ):
            if (ours != theirs).any():
                k = int(np.argmax(ours != theirs))
                raise InvalidInputError(
                    f"offsets: expected the {name} of sighting {index[k]} to be that of its offset, {theirs[k]:.17g}, "
                    f"as g2o states both in one, got {ours[k]:.17g}; leave the offsets out"
                )
        ranged = dict(
            zip(index.tolist(), zip(offsets.position.tolist(), _noises(offsets.sigma), strict=True), strict=True)
        )
    arrays = (seen.view.tolist(), seen.landmark.tolist(), seen.bearing.tolist(), seen.sigma.tolist())
    for k, (i, j, bearing, deviation) in enumerate(zip(*arrays, strict=True)):
        ends = f"{view_keys[i]} {landmark_keys[j]}"
        if k in ranged:
            lines += _edge(f"EDGE_SE2_XY {ends}", *ranged[k])
        else:
            lines.append(f"EDGE_BEARING_SE2_XY {ends} {bearing!r} {information(deviation)}")
    return lines


def _edge(start: str, values: Sequence[float], noise: tuple[str, tuple[float, ...]], turn: float = 0.0) -> list[str]:
    try:
        texts, exact = _stated(*noise, turn)
    except ArithmeticError as error:
        raise InvalidInputError(f"{start}: {error}") from None
    line = f"{start} {_join(values)} {' '.join(texts)}"
    return [line] if exact else [f"# bearslam {noise[0]} {_join(noise[1])}", line]


def _noises(deviations: FloatArray) -> list[tuple[str, tuple[float, ...]]]:
    """Standard deviations as they are, and so covariances without correlations; others as upper triangles."""
    if deviations.ndim == 3:
        size = deviations.shape[1]
        if deviations[:, ~np.eye(size, dtype=bool)].any():
            symmetric = (deviations + deviations.transpose(0, 2, 1)) / 2
            rows, columns = np.triu_indices(size)
            return [("covariance", tuple(row)) for row in symmetric[:, rows, columns].tolist()]
        deviations = np.sqrt(np.diagonal(deviations, axis1=1, axis2=2))
    return [("sigma", tuple(row)) for row in deviations.tolist()]


def _axes(turn: float) -> FloatArray:
    cosine, sine = math.cos(turn), math.sin(turn)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _matrix(upper: Sequence[float]) -> FloatArray:
    return np.array([[upper[i] for i in row] for row in INDEX[len(upper)]])


def _triangle(matrix: FloatArray) -> list[float]:
    values: list[float] = matrix[np.triu_indices(len(matrix))].tolist()
    return values


def _diagonal(kind: str, noise: Sequence[float]) -> Sequence[float]:
    return noise if kind == "sigma" else [noise[row[i]] for i, row in enumerate(INDEX[len(noise)])]


def _join(values: Sequence[float]) -> str:
    return " ".join(map(repr, values))
