# SPDX-License-Identifier: MIT OR Apache-2.0
"""The text graphs of TORO and GTSAM, which are read only.

``VERTEX2`` is a pose, ``EDGE2`` and ``ODOMETRY`` are motions, ``LANDMARK`` is a landmark in the frame of a pose, ``BR``
a bearing with a range. The last six numbers of a motion are its information in TORO and its covariance in GTSAM, each
in one of two orders. The file does not say which; `noise` does:

========  ===========  =========================
noise     numbers are  in the order
========  ===========  =========================
"toro"    information  xx xy yy tt xt yt
"g2o"     information  xx xy xt yy yt tt
"graph"   covariance   xx xy yy tt xt yt
"cov"     covariance   xx xy xt yy yt tt
"auto"    covariance   inferred from the zeros
========  ===========  =========================

"auto" is the rule of GTSAM's ``load2D``. Whatever `noise` is, the last three numbers of ``LANDMARK`` are the covariance
xx xy yy, and the last two of ``BR`` the standard deviations of bearing and range. Landmarks have identifiers of their
own: landmark 5 is not pose 5.
"""

from __future__ import annotations

import math
from typing import Literal, TypeAlias, get_args

from bearslam.data.checks import choice, quote
from bearslam.data.problem import Problem
from bearslam.errors import InvalidInputError
from bearslam.io import g2o
from bearslam.io.edge_noise import from_covariance, from_information
from bearslam.io.g2o import TAG
from bearslam.io.graph_builder import GraphBuilder
from bearslam.io.text import decode, identifier, numbered, numbers

__all__ = ["NOISES", "TAGS", "NoiseFormat", "parse"]

NoiseFormat: TypeAlias = Literal["auto", "toro", "graph", "cov", "g2o"]
"""Meaning of the last six numbers of a motion."""
NOISES: tuple[NoiseFormat, ...] = get_args(NoiseFormat)

POSES = ("VERTEX2", "VERTEX", "VERTEX_SE2")
MOTIONS = ("EDGE2", "EDGE", "ODOMETRY", "EDGE_SE2")
TAGS = {
    **dict.fromkeys(POSES, (1, 3)),
    "VERTEX_XY": (1, 2),
    **dict.fromkeys(MOTIONS, (2, 9)),
    "LANDMARK": (2, 5),
    "BR": (2, 4),
}
"""Identifiers and numbers after a tag. GTSAM reads all of them, TORO those that end in 2."""
FROM_TORO = (0, 1, 4, 2, 5, 3)
"""Indices of the entries of an upper triangle, row by row, among the numbers of TORO."""


def parse(data: bytes, name: str, noise: NoiseFormat = "auto") -> Problem:
    """The problem in the content of a file; the name is for errors."""
    choice("noise", noise, NOISES)
    graph = GraphBuilder(name, shared=False)
    motions: list[tuple[int, tuple[str, str], tuple[float, ...], tuple[str, ...]]] = []
    for line, text in numbered(decode(data, name)):
        words = text[: text.index("#")].split() if "#" in text else text.split()
        if not words:
            continue
        tag, where = words[0], graph.where(line)
        if tag in TAGS:
            ids, count = TAGS[tag]
            if len(words) != 1 + ids + count:
                raise InvalidInputError(f"{where}: expected {ids + count} numbers after {tag}, got {len(words) - 1}")
            ends = tuple(identifier(word, where) for word in words[1 : 1 + ids])
            values = tuple(numbers(words[1 + ids :], where))
            if tag in POSES:
                graph.pose(line, ends[0], values)
            elif tag == "VERTEX_XY":
                graph.point(line, ends[0], values)
            elif tag in MOTIONS:
                motions.append((line, (ends[0], ends[1]), values[:3], tuple(words[6:])))
            else:
                if tag == "BR":
                    graph.check_turn(line, values[0])
                place, upper = (values[:2], values[2:]) if tag == "LANDMARK" else _polar(values, where)
                graph.offset(line, (ends[0], ends[1]), place, from_covariance(upper, where))
        elif tag in g2o.TAGS or tag == "FIX":
            raise InvalidInputError(
                f"{where}: expected tags of a text graph, got {tag} of g2o; read these as format='g2o'"
            )
        elif TAG.fullmatch(tag):
            graph.others.append((tag, text.strip()))
        else:
            raise InvalidInputError(f"{where}: expected a tag such as ODOMETRY, got {quote(tag)}")
    layout = noise
    for line, ends, delta, texts in motions:
        where = graph.where(line)
        if noise == "auto":
            guess = _guess(texts, where)
            if layout not in ("auto", guess):
                raise InvalidInputError(
                    f"{where}: the zeros look like those of noise={guess!r}, on line {motions[0][0]} like those of "
                    f"noise={layout!r}; state which it is"
                )
            layout = guess
        ordered = texts if layout in ("g2o", "cov") else tuple(texts[i] for i in FROM_TORO)
        if layout in ("graph", "cov"):
            spread = from_covariance(tuple(map(float, ordered)), where)
        else:
            spread = from_information(ordered, where)
        graph.motion(line, ends, delta, spread)
    return graph.problem("no LANDMARK or BR", "not read", keep=False)


def _guess(texts: tuple[str, ...], where: str) -> NoiseFormat:
    """The order of the numbers of a covariance, by the rule of GTSAM."""
    filled = [float(text) != 0 for text in texts]
    if filled == [True, False, True, True, False, False]:
        return "graph"
    if filled == [True, False, False, True, False, True]:
        return "cov"
    raise InvalidInputError(
        f"{where}: the numbers {' '.join(texts)} are ambiguous; state their meaning by noise: 'toro' (information "
        "xx xy yy tt xt yt), 'g2o' (information xx xy xt yy yt tt), 'graph' or 'cov' (covariances in these orders)"
    )


def _polar(values: tuple[float, ...], where: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Position, and upper triangle of its covariance, from a bearing with a range."""
    bearing, distance, across, along = values
    for what, value in (("range", distance), ("standard deviation", across), ("standard deviation", along)):
        if not value > 0:
            raise InvalidInputError(f"{where}: expected a {what} above 0, got {value:g}")
    cosine, sine = math.cos(bearing), math.sin(bearing)
    u, v = along * along, (distance * across) * (distance * across)
    upper = (u * cosine**2 + v * sine**2, (u - v) * cosine * sine, u * sine**2 + v * cosine**2)
    if not all(map(math.isfinite, upper)):
        raise InvalidInputError(
            f"{where}: expected a range and standard deviations that doubles can hold, got {distance:g}, {across:g} "
            f"and {along:g}"
        )
    return (distance * cosine, distance * sine), upper
