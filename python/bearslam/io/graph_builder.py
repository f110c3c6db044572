# SPDX-License-Identifier: MIT OR Apache-2.0
"""Assembly of a problem from the vertices and edges of a graph file, in any order of lines."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from bearslam.data.checks import FloatArray, check_turn, quote
from bearslam.data.maps import Map
from bearslam.data.priors import LandmarkPriors, Odometry, PosePriors
from bearslam.data.problem import Problem
from bearslam.data.sightings import SIGMA_RANGE, Offsets, Sightings
from bearslam.errors import InvalidInputError
from bearslam.io.edge_noise import EdgeNoise
from bearslam.io.information import INDEX

__all__ = ["GraphBuilder"]


class _Edge(NamedTuple):
    line: int
    ends: tuple[str, ...]
    values: tuple[float, ...]
    spread: EdgeNoise


class GraphBuilder:
    """Vertices and edges of a file by their identifiers.

    Parameters
    ----------
    name : str
        Name of the file, for errors.
    shared : bool
        Whether poses and landmarks share one set of identifiers.
    """

    def __init__(self, name: str, *, shared: bool) -> None:
        self.name = name
        self.shared = shared
        self.poses: dict[str, tuple[int, tuple[float, ...]]] = {}
        self.points: dict[str, tuple[int, tuple[float, ...]]] = {}
        self.names: dict[str, str] = {}
        self.unknown: set[str] = set()
        self.fixed: list[tuple[int, str]] = []
        self.others: list[tuple[str, str]] = []
        # First use of each: line, and position on the line.
        self._views: dict[str, tuple[int, int]] = {}
        self._landmarks: dict[str, tuple[int, int]] = {}
        self._seen: dict[tuple[str, str], int] = {}
        self._bearings: list[tuple[float, float]] = []
        self._offsets: dict[int, _Edge] = {}
        self._motions: list[_Edge] = []
        self._pose_priors: list[_Edge] = []
        self._point_priors: list[_Edge] = []

    def where(self, line: int) -> str:
        """File and line."""
        return f"{self.name}:{line}"

    def pose(self, line: int, key: str, values: tuple[float, ...]) -> None:
        """A vertex with x, y and theta, which may have turned often where it was integrated."""
        x, y, heading = values
        if abs(heading) > math.tau:
            heading = math.remainder(heading, math.tau)
        self._vertex(self.poses, line, key, (x, y, heading))
        self._view(line, key)

    def point(self, line: int, key: str, values: tuple[float, ...]) -> None:
        """A vertex with x and y."""
        self._vertex(self.points, line, key, values)
        self._landmark(line, key)

    def motion(self, line: int, ends: tuple[str, str], delta: tuple[float, ...], spread: EdgeNoise) -> None:
        """An edge between two poses."""
        if ends[0] == ends[1]:
            raise InvalidInputError(f"{self.where(line)}: expected an edge between two poses, got {ends[0]} twice")
        self._check_heading(line, delta[2])
        self._check_spread(line, spread)
        self._view(line, ends[0])
        self._view(line, ends[1], 1)
        self._motions.append(_Edge(line, ends, delta, spread))

    def bearing(self, line: int, ends: tuple[str, str], bearing: float, sigma: float) -> None:
        """A sighting with a bearing."""
        self._sighting(line, ends)
        low, high = SIGMA_RANGE
        if not low <= sigma <= high:
            raise InvalidInputError(
                f"{self.where(line)}: expected a standard deviation from {low:g} to {high:g}, got {sigma:g}"
            )
        self.check_turn(line, bearing)
        expected = "a bearing with a standard deviation in radians within half a turn"
        check_turn(self.where(line), sigma, expected=expected, turn=math.pi)
        self._bearings.append((bearing, sigma))

    def check_turn(self, line: int, bearing: float) -> None:
        """Refuse a bearing beyond one turn, which is most likely in degrees."""
        check_turn(self.where(line), bearing, expected="a bearing in radians within one turn")

    def _check_heading(self, line: int, heading: float) -> None:
        """Refuse the turn of a motion, or a known heading, beyond one turn."""
        check_turn(self.where(line), heading, expected="a heading in radians within one turn")

    def offset(self, line: int, ends: tuple[str, str], position: tuple[float, ...], spread: EdgeNoise) -> None:
        """A sighting with a position in the frame of the pose."""
        self._sighting(line, ends)
        low, high = SIGMA_RANGE
        distance = math.hypot(*position)
        if not distance:
            raise InvalidInputError(
                f"{self.where(line)}: expected a landmark away from the pose, got one that coincides with it"
            )
        if not low <= distance <= high:
            raise InvalidInputError(
                f"{self.where(line)}: expected a landmark at a distance from {low:g} to {high:g}, got {distance:g}"
            )
        self._offsets[len(self._bearings)] = _Edge(line, ends, position, spread)
        self._bearings.append((np.nan, np.nan))

    def pose_prior(self, line: int, key: str, pose: tuple[float, ...], spread: EdgeNoise) -> None:
        """A prior on a pose."""
        self._check_heading(line, pose[2])
        self._check_spread(line, spread)
        self._view(line, key)
        self._pose_priors.append(_Edge(line, (key,), pose, spread))

    def point_prior(self, line: int, key: str, position: tuple[float, ...], spread: EdgeNoise) -> None:
        """A prior on a landmark."""
        self._landmark(line, key)
        self._point_priors.append(_Edge(line, (key,), position, spread))

    def problem(self, nothing: str, fate: str, *, keep: bool) -> Problem:
        """The assembled problem.

        Parameters
        ----------
        nothing : str
            What the file lacks if there are no sightings, for the error.
        fate : str
            What happens to lines with other tags, for the remarks.
        keep : bool
            Whether the problem keeps these lines.
        """
        views, landmarks = _order(self.poses, self._views), _order(self.points, self._landmarks)
        if self.shared:
            for key in views.keys() & landmarks.keys():
                (first, _), (second, _) = sorted((self._views[key], self._landmarks[key]))
                raise InvalidInputError(
                    f"{self.where(second)}: {key} is both a pose and a landmark; the other use is on line {first}"
                )
        if not self._seen:
            raise InvalidInputError(f"{self.name}: {nothing}: bearslam needs bearings")
        tags = Counter(tag for tag, _ in self.others)
        try:
            return self._build(
                views, landmarks, [f"{count} line{'s' * (count > 1)} {tag} {fate}" for tag, count in tags.items()], keep
            )
        except InvalidInputError as error:
            if str(error).startswith(f"{self.name}:"):
                raise
            raise InvalidInputError(f"{self.name}: {error}") from None

    def _build(self, views: dict[str, int], landmarks: dict[str, int], remarks: list[str], keep: bool) -> Problem:
        offsets = None
        numbers = np.array(self._bearings)
        if self._offsets:
            edges = list(self._offsets.values())
            offsets = Offsets(list(self._offsets), [edge.values for edge in edges], self._stack(edges))
            with np.errstate(over="ignore", invalid="ignore"):
                numbers[offsets.sighting] = np.stack([offsets.bearing, offsets.bearing_sigma], axis=1)
            self._in_range(edges, numbers[offsets.sighting, 1])
        sightings = Sightings(
            [views[key] for key, _ in self._seen], [landmarks[key] for _, key in self._seen], *numbers.T
        )
        odometry = pose_priors = landmark_priors = None
        if self._motions:
            start, end = ([views[edge.ends[side]] for edge in self._motions] for side in (0, 1))
            odometry = Odometry(start, end, [edge.values for edge in self._motions], self._stack(self._motions))
        if self._pose_priors:
            index = [views[edge.ends[0]] for edge in self._pose_priors]
            values = [edge.values for edge in self._pose_priors]
            pose_priors = PosePriors(index, values, self._stack(self._pose_priors))
        if self._point_priors:
            index = [landmarks[edge.ends[0]] for edge in self._point_priors]
            values = [edge.values for edge in self._point_priors]
            landmark_priors = LandmarkPriors(index, values, self._stack(self._point_priors))
        poses = self._places(views, self.poses, 3)
        points = self._places(landmarks, self.points, 2)
        known = bool(np.isfinite(poses).any() or np.isfinite(points).any())
        fixed: tuple[list[int], list[int]] = ([], [])
        for line, key in self.fixed:
            for vertices, order, held in ((self.poses, views, fixed[0]), (self.points, landmarks, fixed[1])):
                if key in vertices and key not in self.unknown:
                    held.append(order[key])
                    break
            else:
                raise InvalidInputError(f"{self.where(line)}: expected a vertex to fix, got {key}, which has no place")
        return Problem(
            sightings,
            [self._name(key) for key in views],
            [self._name(key) for key in landmarks],
            odometry=odometry,
            pose_priors=pose_priors,
            landmark_priors=landmark_priors,
            start=Map(poses, points) if known else None,
            fixed_views=fixed[0],
            fixed_landmarks=fixed[1],
            offsets=offsets,
            remarks=remarks,
            others=[line for _, line in self.others] if keep else (),
        )

    def _name(self, key: str) -> str:
        return self.names.get(key, key)

    def _places(self, order: Iterable[str], vertices: dict[str, tuple[int, tuple[float, ...]]], n: int) -> FloatArray:
        nowhere = (0, (np.nan,) * n)
        rows = [nowhere if key in self.unknown else vertices.get(key, nowhere) for key in order]
        return np.array([values for _, values in rows], dtype=np.float64).reshape(-1, n)

    def _vertex(
        self, vertices: dict[str, tuple[int, tuple[float, ...]]], line: int, key: str, values: tuple[float, ...]
    ) -> None:
        if key in vertices:
            raise InvalidInputError(
                f"{self.where(line)}: vertex {key} appears a second time; the first is on line {vertices[key][0]}"
            )
        vertices[key] = line, values

    def _view(self, line: int, key: str, place: int = 0) -> None:
        self._views[key] = min((line, place), self._views.get(key, (line, place)))

    def _landmark(self, line: int, key: str) -> None:
        self._landmarks[key] = min((line, 0), self._landmarks.get(key, (line, 0)))

    def _sighting(self, line: int, ends: tuple[str, str]) -> None:
        first = self._seen.setdefault(ends, line)
        if first != line:
            view, landmark = ends
            raise InvalidInputError(
                f"{self.where(line)}: pose {quote(view)} sees landmark {quote(landmark)} a second time; "
                f"the first is on line {first}"
            )
        self._view(line, ends[0])
        self._landmark(line, ends[1])

    def _in_range(self, edges: list[_Edge], sigma: FloatArray) -> None:
        low, high = SIGMA_RANGE
        for edge, value in zip(edges, sigma.tolist(), strict=True):
            if not low <= value <= high:
                raise InvalidInputError(
                    f"{self.where(edge.line)}: expected a bearing with a standard deviation from {low:g} to {high:g}, "
                    f"got {value:g}"
                )

    def _check_spread(self, line: int, spread: EdgeNoise) -> None:
        """Refuse a standard deviation of a heading beyond half a turn, unless it is infinite."""
        deviation = math.sqrt(spread.upper()[-1]) if spread.sigma is None else spread.sigma[2]
        if not math.isinf(deviation):
            expected = "a heading with a standard deviation in radians within half a turn"
            check_turn(self.where(line), deviation, expected=expected, turn=math.pi)

    def _stack(self, edges: list[_Edge]) -> FloatArray:
        """Standard deviations (k, n) of edges without correlations, covariances (k, n, n) of others."""
        deviations = [edge.spread.sigma for edge in edges]
        if None not in deviations:
            return np.array(deviations)
        rows = []
        for edge in edges:
            if edge.spread.sigma is not None and np.inf in edge.spread.sigma:
                raise InvalidInputError(
                    f"{self.where(edge.line)}: a coordinate without information cannot be combined with correlated "
                    "priors"
                )
            upper = edge.spread.upper()
            rows.append([[upper[i] for i in row] for row in INDEX[len(upper)]])
        matrices = np.array(rows)
        diagonal = np.eye(matrices.shape[1], dtype=bool)
        if not matrices[:, ~diagonal].any():  # correlations that underflow
            spread: FloatArray = np.sqrt(matrices[:, diagonal])
            return spread
        least = np.linalg.eigvalsh(matrices)[:, 0]
        if not (least > 0).all():
            line = edges[int(np.argmin(least > 0))].line
            raise InvalidInputError(
                f"{self.where(line)}: expected a positive definite matrix, got one that is nearly singular"
            )
        return matrices


def _order(vertices: Iterable[str], used: dict[str, tuple[int, int]]) -> dict[str, int]:
    """Indices by identifier: in the order of vertices, then in the order of first use for those without one."""
    return {key: index for index, key in enumerate(dict.fromkeys([*vertices, *sorted(used, key=used.__getitem__)]))}
