# SPDX-License-Identifier: MIT OR Apache-2.0
"""The format of g2o, for poses and landmarks in the plane.

What the format lacks is stated in comments at the end of lines, which `parse` reads and g2o and GTSAM ignore:
``# bearslam name front door`` after a vertex, ``# bearslam unknown`` after a vertex without a known place, and
``# bearslam sigma ...`` or ``# bearslam covariance ...`` (an upper triangle, row by row) after an edge whose
information does not restore the noise exactly.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence

import numpy as np

from bearslam.data.checks import FloatArray, quote
from bearslam.data.estimate import Estimate
from bearslam.data.maps import Map
from bearslam.data.normalize import normalize
from bearslam.data.problem import Problem, ProblemLike
from bearslam.data.sightings import Offsets, Sightings
from bearslam.errors import InvalidInputError
from bearslam.io.edge_noise import (
    EdgeNoise,
    diagonal_of,
    from_information,
    full_matrix,
    in_map_axes,
    independent,
    noise_of_rows,
    to_information,
    upper_triangle,
)
from bearslam.io.graph_builder import GraphBuilder
from bearslam.io.information import information, is_diagonal, sigma
from bearslam.io.text import decode, identifier, numbered, numbers

__all__ = ["TAG", "TAGS", "parse", "render"]

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
"""Pattern of tags, including those of other programs."""
LARGEST = 2**31
"""Upper bound of the identifiers of g2o."""
AGREEMENT = 1e-9
"""Largest relative difference between the information of an edge and that of its comment."""
FOREIGN = ("VERTEX2", "VERTEX", "EDGE2", "EDGE", "ODOMETRY", "LANDMARK", "BR")
"""Tags of the text graphs of TORO and GTSAM."""
NOTHING = "no EDGE_BEARING_SE2_XY or EDGE_SE2_XY"


def parse(data: bytes, name: str) -> Problem:
    """The problem in the content of a file; the name is for errors."""
    return _built(data, name).problem(NOTHING, "kept but not used", keep=True)


def vertices(data: bytes, name: str) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Poses and landmarks alone, by name; those without a known place are left out."""
    graph = _built(data, name)
    poses, points = (
        {graph.names.get(key, key): np.array(values) for key, (_, values) in some.items() if key not in graph.unknown}
        for some in (graph.poses, graph.points)
    )
    return poses, points


def _built(data: bytes, name: str) -> GraphBuilder:
    graph = GraphBuilder(name, shared=True)
    for line, text in numbered(decode(data, name)):
        body, mark, comment = text.partition("#")
        words = body.split()
        if not words:
            continue
        tag, where = words[0], graph.where(line)
        if tag == "FIX":
            if len(words) < 2:
                raise InvalidInputError(f"{where}: expected the number of a vertex after FIX, got nothing")
            graph.fixed += [(line, identifier(word, where)) for word in words[1:]]
        elif tag in TAGS:
            ids, count = TAGS[tag]
            if len(words) != 1 + ids + count:
                raise InvalidInputError(f"{where}: expected {ids + count} numbers after {tag}, got {len(words) - 1}")
            ends = tuple(identifier(word, where) for word in words[1 : 1 + ids])
            texts = tuple(words[1 + ids :])
            said = comment.split() if mark else []
            said = said[1:] if said[:1] == ["bearslam"] else []
            if tag.startswith("VERTEX"):
                _vertex(graph, line, ends[0], numbers(texts, where), said, comment.strip())
            else:
                _edge(graph, line, tag, ends, texts, said)
        elif tag in FOREIGN:
            raise InvalidInputError(
                f"{where}: expected tags of g2o, got {tag} of a text graph; read these as format='graph'"
            )
        elif TAG.fullmatch(tag):
            graph.others.append((tag, text.strip()))
        else:
            raise InvalidInputError(f"{where}: expected a tag such as VERTEX_SE2, got {quote(tag)}")
    return graph


def _vertex(
    graph: GraphBuilder, line: int, key: str, values: Sequence[float], said: Sequence[str], comment: str
) -> None:
    if len(values) == 3:
        graph.pose(line, key, tuple(values))
    else:
        graph.point(line, key, tuple(values))
    if not said:
        return
    unknown = said[0] == "unknown"
    rest = said[unknown:]
    if unknown:
        graph.unknown.add(key)
    if rest[:1] == ["name"] and len(rest) > 1:
        graph.names[key] = comment.split(maxsplit=2 + unknown)[2 + unknown]
    elif rest:
        raise InvalidInputError(
            f"{graph.where(line)}: expected unknown or a name in the comment of bearslam, got {quote(' '.join(said))}"
        )


def _edge(
    graph: GraphBuilder, line: int, tag: str, ends: tuple[str, ...], texts: tuple[str, ...], said: Sequence[str]
) -> None:
    where = graph.where(line)
    values = numbers(texts, where)
    if tag == "EDGE_BEARING_SE2_XY":
        if not values[1] > 0:
            raise InvalidInputError(f"{where}: expected information above 0, got {quote(texts[1])}")
        graph.bearing(line, (ends[0], ends[1]), values[0], sigma(texts[1]))
        return
    size = 2 if tag in ("EDGE_SE2_XY", "EDGE_PRIOR_XY") else 3
    place = tuple(values[:size])
    prior = tag == "EDGE_PRIOR_SE2"
    turn = place[2] if prior else 0.0
    if said:
        spread = _said(said, turn, values[size:], where)
    else:
        spread = in_map_axes(from_information(texts[size:], where, unknown=prior), turn, where)
    if tag == "EDGE_SE2":
        graph.motion(line, (ends[0], ends[1]), place, spread)
    elif tag == "EDGE_SE2_XY":
        graph.offset(line, (ends[0], ends[1]), place, spread)
    elif prior:
        graph.pose_prior(line, ends[0], place, spread)
    else:
        graph.point_prior(line, ends[0], place, spread)


def _said(said: Sequence[str], turn: float, stated: Sequence[float], where: str) -> EdgeNoise:
    """Noise from a comment, which must agree with the information of the edge."""
    kind, texts = said[0], said[1:]
    size = 3 if len(stated) == 6 else 2
    wanted = {"sigma": size, "covariance": len(stated)}.get(kind)
    if len(texts) != wanted:
        raise InvalidInputError(
            f"{where}: expected sigma and {size} numbers or covariance and {len(stated)} in the comment of bearslam, "
            f"got {quote(' '.join(said))}"
        )
    numbers([text for text in texts if text != "inf" or kind != "sigma"], where)
    noise = tuple(map(float, texts))
    if not all(value > 0 for value in diagonal_of(kind, noise)):
        raise InvalidInputError(f"{where}: expected numbers above 0 in the comment of bearslam, got {min(noise):g}")
    try:
        again, _ = to_information(kind, noise, turn)
    except ArithmeticError as error:
        raise InvalidInputError(f"{where}: {error}") from None
    matrix, other = full_matrix(stated), full_matrix(list(map(float, again)))
    scale = np.sqrt(np.diag(matrix).clip(0))
    scale[:2] = scale[:2].max()
    if not (np.abs(matrix - other) <= AGREEMENT * np.outer(scale, scale)).all():
        raise InvalidInputError(f"{where}: expected the information that the comment of bearslam states, got another")
    if kind == "sigma":
        return independent(noise, lambda: tuple(upper_triangle(np.diag(np.square(noise)))), where)
    if is_diagonal(noise):
        return independent(tuple(map(math.sqrt, diagonal_of(kind, noise))), lambda: noise, where)
    return EdgeNoise(None, lambda: noise)


def render(what: Estimate | ProblemLike) -> str:
    """The content of a file with a problem, or with a map and its measurements."""
    problem = _problem(what)
    seen = problem.sightings
    if seen.sigma is None:
        raise InvalidInputError(
            "sightings: expected standard deviations, since g2o states the information of every edge, got none; give "
            "sigma (on the command line --sigma-deg)"
        )
    _check(problem, seen)
    named, view_keys, landmark_keys = _keys(problem)
    starts = (None, None) if problem.start is None else problem.start
    # GTSAM stops reading at a comment or FIX that comes before a motion.
    lines = list(_vertices("VERTEX_SE2", view_keys, starts[0], problem.view_ids if named else None))
    lines += _vertices("VERTEX_XY", landmark_keys, starts[1], problem.landmark_ids if named else None)
    if (odometry := problem.odometry) is not None:
        motions = zip(odometry.start, odometry.end, odometry.delta.tolist(), noise_of_rows(odometry.sigma), strict=True)
        for start, end, delta, noise in motions:
            lines.append(_line(f"EDGE_SE2 {view_keys[start]} {view_keys[end]}", delta, noise))
    lines += _sightings(seen, problem.offsets, view_keys, landmark_keys)
    if (poses := problem.pose_priors) is not None:
        for i, pose, noise in zip(poses.view, poses.pose.tolist(), noise_of_rows(poses.sigma), strict=True):
            lines.append(_line(f"EDGE_PRIOR_SE2 {view_keys[i]}", pose, noise, pose[2]))
    if (points := problem.landmark_priors) is not None:
        for j, place, noise in zip(points.landmark, points.position.tolist(), noise_of_rows(points.sigma), strict=True):
            lines.append(_line(f"EDGE_PRIOR_XY {landmark_keys[j]}", place, noise))
    lines += [f"FIX {view_keys[i]}" for i in problem.fixed_views]
    lines += [f"FIX {landmark_keys[j]}" for j in problem.fixed_landmarks]
    lines += problem.others
    return "\n".join(lines) + "\n"


def _problem(what: Estimate | ProblemLike) -> Problem:
    if isinstance(what, Problem):
        return what
    if isinstance(what, Estimate):
        if not what.oriented:
            raise InvalidInputError(
                "path: expected bearings that are rays, as in g2o, got lines, known modulo half a turn; save "
                "the map as .json or .csv"
            )
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
    table = normalize(what)
    weighted = isinstance(what, Sightings) and what.sigma is not None
    seen = table.sightings
    return Problem(
        seen if weighted else Sightings(seen.view, seen.landmark, seen.bearing),
        map(str, range(table.views)),
        map(str, range(table.views, table.views + table.landmarks)),
    )


def _check(problem: Problem, seen: Sightings) -> None:
    """Refuse what reading the file would not restore."""
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
        known = tag in (*TAGS, "FIX", *FOREIGN) or not TAG.fullmatch(tag)
        if known or line != line.strip() or "\n" in line or "\r" in line:
            raise InvalidInputError(
                f"others: expected lines with tags that bearslam does not use, as load keeps them, got {quote(line)}"
            )


def _keys(problem: Problem) -> tuple[bool, Sequence[str], Sequence[str]]:
    """Whether vertices need names in comments, and their identifiers: the names if they are valid, else numbers."""
    names = (*problem.view_ids, *problem.landmark_ids)
    if len(set(names)) == len(names) and all(map(_is_key, names)):
        return False, problem.view_ids, problem.landmark_ids
    keys = list(map(str, range(len(names))))
    return True, keys[: len(problem.view_ids)], keys[len(problem.view_ids) :]


def _is_key(name: str) -> bool:
    return name.isascii() and name.isdecimal() and len(name) <= 10 and name == str(int(name)) and int(name) < LARGEST


def _vertices(tag: str, keys: Sequence[str], places: FloatArray | None, names: Sequence[str] | None) -> Iterator[str]:
    nowhere = " ".join("0" * TAGS[tag][1])
    for i, key in enumerate(keys):
        unknown = places is None or math.isnan(places[i, 0])
        place = nowhere if places is None or unknown else _join(places[i].tolist())
        comment = ["unknown"] * unknown + ([] if names is None else [f"name {names[i]}"])
        yield f"{tag} {key} {place}" + (f"  # bearslam {' '.join(comment)}" if comment else "")


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
            zip(index.tolist(), zip(offsets.position.tolist(), noise_of_rows(offsets.sigma), strict=True), strict=True)
        )
    arrays = (seen.view.tolist(), seen.landmark.tolist(), seen.bearing.tolist(), seen.sigma.tolist())
    for k, (i, j, bearing, deviation) in enumerate(zip(*arrays, strict=True)):
        ends = f"{view_keys[i]} {landmark_keys[j]}"
        if k in ranged:
            lines.append(_line(f"EDGE_SE2_XY {ends}", *ranged[k]))
        else:
            lines.append(f"EDGE_BEARING_SE2_XY {ends} {bearing!r} {information(deviation)}")
    return lines


def _line(start: str, values: Sequence[float], noise: tuple[str, tuple[float, ...]], turn: float = 0.0) -> str:
    try:
        texts, exact = to_information(*noise, turn)
    except ArithmeticError as error:
        raise InvalidInputError(f"{start}: {error}") from None
    line = f"{start} {_join(values)} {' '.join(texts)}"
    return line if exact else f"{line}  # bearslam {noise[0]} {_join(noise[1])}"


def _join(values: Sequence[float]) -> str:
    return " ".join(map(repr, values))
