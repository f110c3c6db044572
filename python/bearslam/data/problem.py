# SPDX-License-Identifier: MIT OR Apache-2.0
"""What is solved: sightings, whether they come as a table with gaps, as parallel arrays or out of a file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bearslam.data.checks import FloatArray, IntArray, floats, indices, plain, quote
from bearslam.data.maps import Map, MapLike, pick
from bearslam.data.priors import LandmarkPriors, Odometry, PosePriors, keep, noise
from bearslam.errors import InvalidInputError

PAIRS = 2**33
"""Pairs of a view and a landmark, one bit each in the core: 1 GB."""
GAPS = 1000
"""Views or landmarks for each sighting, motion or prior beyond which an index is a slip."""
SIGMA_RANGE = (1e-100, 1e100)
"""Standard deviations whose squares, and theirs in turn, are numbers [rad]."""
FIXED = 1e-6
"""Standard deviation of what a file says is fixed [length, rad]."""

__all__ = ["FIXED", "Offsets", "Problem", "ProblemLike", "Sightings"]


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Sightings:
    """Who saw what, and in which direction: one entry per sighting, in parallel arrays.

    Parameters
    ----------
    view, landmark : (k,) array_like of int
        0-based indices of the view that saw and of the landmark that was seen. A view sees a landmark at most once.
        There are as many views (landmarks) as the largest index says.
    bearing : (k,) array_like of float
        Directions in the frame of the view, counter-clockwise from its heading [rad]. Any finite angle.
    sigma : (k,) array_like of float, or float, optional
        Standard deviations of the bearings, above 0 [rad].

    Raises
    ------
    InvalidInputError
        If lengths differ, there is nothing in them, an index is negative or no integer, or a number is not finite.

    Examples
    --------
    >>> from bearslam import Sightings
    >>> Sightings(view=[0, 0, 1], landmark=[0, 1, 1], bearing=[0.1, -0.4, 2.0])
    <Sightings: 3 of 2 landmarks from 2 views>
    """

    view: IntArray
    landmark: IntArray
    bearing: FloatArray
    sigma: FloatArray | None

    def __init__(
        self, view: ArrayLike, landmark: ArrayLike, bearing: ArrayLike, sigma: ArrayLike | None = None
    ) -> None:
        fields: dict[str, IntArray | FloatArray] = {
            "view": indices("view", view),
            "landmark": indices("landmark", landmark),
            "bearing": floats("bearing", bearing, ("k",)),
        }
        k = len(fields["view"])
        for name, values in fields.items():
            if len(values) != k:
                raise InvalidInputError(f"{name}: expected as many entries as view has, {k}, got {len(values)}")
        if k == 0:
            raise InvalidInputError("view: expected at least one sighting, got none")
        if sigma is not None:
            fields["sigma"] = deviations(sigma, (k,))
        for name, values in fields.items():
            own = values.copy()
            own.flags.writeable = False
            object.__setattr__(self, name, own)
        if sigma is None:
            object.__setattr__(self, "sigma", None)

    def __len__(self) -> int:
        return len(self.view)

    def __repr__(self) -> str:
        return f"<Sightings: {len(self)} of {self.landmark_count} landmarks from {self.view_count} views>"

    @property
    def view_count(self) -> int:
        """Number of views."""
        return int(self.view.max()) + 1

    @property
    def landmark_count(self) -> int:
        """Number of landmarks."""
        return int(self.landmark.max()) + 1


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Offsets:
    """Positions of landmarks relative to views, as range finders give them: bearings that came with a range.

    bearslam uses the bearings only, which are among the sightings. Offsets are kept for the files they came from.

    Parameters
    ----------
    sighting : (k,) array_like of int
        0-based indices of the sightings that they belong to, each at most once.
    position : (k, 2) array_like of float
        Where the landmark is in the frame of the view: x ahead, y to the left [length].
    sigma : (2,), (k, 2) or (k, 2, 2) array_like of float
        Standard deviations of x and y, for all or for each, or covariances, in the frame of the view [length].

    Raises
    ------
    InvalidInputError
        If lengths differ, a number is not finite, a landmark is where the view is, or a standard deviation or
        covariance is not positive (definite).

    Examples
    --------
    >>> from bearslam import Offsets
    >>> offsets = Offsets(sighting=[0], position=[[3, 4]], sigma=[0.1, 0.1])
    >>> offsets.bearing.round(4), offsets.bearing_sigma.round(4)
    (array([0.9273]), array([0.02]))
    """

    sighting: IntArray
    position: FloatArray
    sigma: FloatArray

    def __init__(self, sighting: ArrayLike, position: ArrayLike, sigma: ArrayLike) -> None:
        index = indices("sighting", sighting)
        k = len(index)
        if len(np.unique(index)) != k:
            raise InvalidInputError("sighting: expected every sighting at most once, got one twice")
        places = floats("position", position, (k, 2))
        nowhere = ~places.any(axis=1)
        if nowhere.any():
            where = int(np.argmax(nowhere))
            raise InvalidInputError(f"position[{where}]: expected a landmark apart from the view, got one upon it")
        keep(self, sighting=index, position=places, sigma=noise("sigma", sigma, k, 2))

    def __len__(self) -> int:
        return len(self.sighting)

    def __repr__(self) -> str:
        return f"<Offsets: {len(self)} landmarks>"

    @property
    def bearing(self) -> FloatArray:
        """Direction of each in the frame of the view (k,) [rad]."""
        x, y = self.position.T
        angles: FloatArray = np.arctan2(y, x)
        return angles

    @property
    def bearing_sigma(self) -> FloatArray:
        """Standard deviation of that, to first order (k,) [rad]."""
        x, y = self.position.T
        across = np.stack([-y, x], axis=1) / (x * x + y * y)[:, None]
        spread: FloatArray
        if self.sigma.ndim == 2:
            spread = np.hypot(*(across * self.sigma).T)
        else:
            spread = np.sqrt(np.einsum("ki,kij,kj->k", across, self.sigma, across))
        return spread


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Problem:
    """All that a file says: sightings, names, and what else is known of views and landmarks.

    Parameters
    ----------
    sightings : Sightings
        Who saw what.
    view_ids, landmark_ids : iterable of str
        One name per view and per landmark: distinct, not empty, on one line, without blanks around it. There may be
        more of them than the sightings have: views that see nothing are carried by odometry and priors.
    odometry : Odometry, optional
        Measured motions between views.
    pose_priors : PosePriors, optional
        Poses known beforehand.
    landmark_priors : LandmarkPriors, optional
        Landmarks known beforehand.
    start : map, or (poses, landmarks), optional
        First guess: poses (m, 3) and landmarks (n, 2), NaN where there is none. `refine` starts there; `solve` does not
        look at it.
    fixed_views, fixed_landmarks : iterable of int
        0-based indices of what stays where `start` says, as if it were known to 1e-6 [length, rad].
    offsets : Offsets, optional
        Ranges that came with bearings. They are kept for files, and not used.
    remarks : iterable of str
        What the file says besides that is not in the problem, one line of text each.
    others : iterable of str
        Lines of the file that are not understood, which `save` to the same format writes back as they are.

    Raises
    ------
    InvalidInputError
        If there are fewer names than views or landmarks, a name is none, something belongs to a view, landmark or
        sighting that there is not, or what is fixed has no place in `start`.
    """

    sightings: Sightings
    view_ids: tuple[str, ...]
    landmark_ids: tuple[str, ...]
    odometry: Odometry | None
    pose_priors: PosePriors | None
    landmark_priors: LandmarkPriors | None
    start: Map | None
    fixed_views: tuple[int, ...]
    fixed_landmarks: tuple[int, ...]
    offsets: Offsets | None
    remarks: tuple[str, ...]
    others: tuple[str, ...]

    def __init__(
        self,
        sightings: Sightings,
        view_ids: Iterable[str],
        landmark_ids: Iterable[str],
        *,
        odometry: Odometry | None = None,
        pose_priors: PosePriors | None = None,
        landmark_priors: LandmarkPriors | None = None,
        start: MapLike | None = None,
        fixed_views: Iterable[int] = (),
        fixed_landmarks: Iterable[int] = (),
        offsets: Offsets | None = None,
        remarks: Iterable[str] = (),
        others: Iterable[str] = (),
    ) -> None:
        if not isinstance(sightings, Sightings):
            raise InvalidInputError(f"sightings: expected Sightings, got {type(sightings).__name__}")
        views = _names("view_ids", view_ids, sightings.view_count)
        landmarks = _names("landmark_ids", landmark_ids, sightings.landmark_count)
        m, n, k = len(views), len(landmarks), len(sightings)
        guess = None if start is None else pick("start", start, m, n)
        if odometry is not None:
            _within("odometry: start", odometry.start, m, "views")
            _within("odometry: end", odometry.end, m, "views")
        if pose_priors is not None:
            _within("pose_priors: view", pose_priors.view, m, "views")
        if landmark_priors is not None:
            _within("landmark_priors: landmark", landmark_priors.landmark, n, "landmarks")
        if offsets is not None:
            _within("offsets: sighting", offsets.sighting, k, "sightings")
        held: dict[str, tuple[int, ...]] = {}
        for name, given, count, places in (
            ("fixed_views", fixed_views, m, None if guess is None else guess.poses),
            ("fixed_landmarks", fixed_landmarks, n, None if guess is None else guess.landmarks),
        ):
            index = indices(name, sorted(set(given)))
            _within(name, index, count, name.removeprefix("fixed_"))
            for i in index.tolist():
                if places is None or not np.isfinite(places[i]).all():
                    raise InvalidInputError(f"{name}: expected a place in start for what is fixed, got none for {i}")
            held[name] = tuple(index.tolist())
        fields: dict[str, object] = {
            "sightings": sightings,
            "view_ids": views,
            "landmark_ids": landmarks,
            "odometry": odometry,
            "pose_priors": pose_priors,
            "landmark_priors": landmark_priors,
            "start": guess,
            **held,
            "offsets": offsets,
            "remarks": tuple(remarks),
            "others": tuple(others),
        }
        for name, value in fields.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        seen = self.sightings
        text = f"<Problem: {len(seen)} of {len(self.landmark_ids)} landmarks from {len(self.view_ids)} views"
        for known, what in (
            (self.odometry, "motion"),
            (self.pose_priors, "known pose"),
            (self.landmark_priors, "known landmark"),
        ):
            if known is not None:
                text += f", {len(known)} {what}{'' if len(known) == 1 else 's'}"
        return text + ">"

    def bearings_only(self) -> Problem:
        """The same sightings and names, and nothing else."""
        return Problem(self.sightings, self.view_ids, self.landmark_ids)

    def known_poses(self) -> PosePriors | None:
        """Pose priors, with what is fixed among them."""
        if not self.fixed_views or self.start is None:
            return self.pose_priors
        view = np.array(self.fixed_views)
        pose, sigma = self.start.poses[view], np.full((len(view), 3), FIXED)
        if self.pose_priors is not None:
            given = self.pose_priors
            both = _alike(sigma, given.sigma)
            view, pose = np.concatenate([given.view, view]), np.concatenate([given.pose, pose])
            sigma = np.concatenate([both[1], both[0]])
        return PosePriors(view, pose, sigma)

    def known_landmarks(self) -> LandmarkPriors | None:
        """Landmark priors, with what is fixed among them."""
        if not self.fixed_landmarks or self.start is None:
            return self.landmark_priors
        landmark = np.array(self.fixed_landmarks)
        position, sigma = self.start.landmarks[landmark], np.full((len(landmark), 2), FIXED)
        if self.landmark_priors is not None:
            given = self.landmark_priors
            both = _alike(sigma, given.sigma)
            landmark = np.concatenate([given.landmark, landmark])
            position, sigma = np.concatenate([given.position, position]), np.concatenate([both[1], both[0]])
        return LandmarkPriors(landmark, position, sigma)


Entry = TypeVar("Entry", bound=np.generic)

ProblemLike: TypeAlias = ArrayLike | Sightings | Problem
"""An (m, n) array of bearings with NaN for what was not seen, `Sightings`, or a `Problem`."""


@dataclass(frozen=True, eq=False)
class Table:
    """Any problem in the one form that the core takes, and the way back to the form it came in."""

    views: int
    landmarks: int
    sightings: Sightings
    sigma: FloatArray
    dense: bool
    view_ids: tuple[str, ...] | None = None
    landmark_ids: tuple[str, ...] | None = None

    def restore(self, values: NDArray[Entry], missing: float | bool = np.nan) -> NDArray[Entry]:
        """Values per sighting in the shape of the problem: (m, n), filled up where nothing was seen, or (k,)."""
        if not self.dense:
            return values
        table = np.full((self.views, self.landmarks), missing, dtype=values.dtype)
        table[self.sightings.view, self.sightings.landmark] = values
        return table


def tabulate(problem: ProblemLike, sigma: ArrayLike = 1.0, *, views: int = 0, landmarks: int = 0) -> Table:
    """The sightings of any kind of problem, checked, with a standard deviation each.

    Plain `Sightings` do not say how many views and landmarks there are: there may be `views` and `landmarks` if that is
    more than they see.
    """
    if isinstance(problem, Problem):
        table = tabulate(
            problem.sightings,
            sigma,
            views=max(len(problem.view_ids), views),
            landmarks=max(len(problem.landmark_ids), landmarks),
        )
        if (table.views, table.landmarks) != (len(problem.view_ids), len(problem.landmark_ids)):
            raise InvalidInputError(
                f"problem: expected names for all views and landmarks of odometry and priors, {table.views} and "
                f"{table.landmarks}, got {len(problem.view_ids)} and {len(problem.landmark_ids)}"
            )
        return replace(table, view_ids=problem.view_ids, landmark_ids=problem.landmark_ids)
    if isinstance(problem, Sightings):
        if problem.sigma is None:
            each = deviations(sigma, (len(problem),))
            problem = Sightings(problem.view, problem.landmark, problem.bearing, each)
        elif not np.array_equal(plain("sigma", sigma), 1.0):
            raise InvalidInputError("sigma: the sightings come with standard deviations of their own; give only one")
        else:
            each = problem.sigma
        views, landmarks = max(problem.view_count, views), max(problem.landmark_count, landmarks)
        if views * landmarks > PAIRS:
            raise InvalidInputError(
                f"sightings: expected indices that leave few numbers out, got {len(problem)} sightings of "
                f"{landmarks} landmarks from {views} views"
            )
        return Table(views, landmarks, problem, each, dense=False)
    bearings = floats("bearings", problem, ("m", "n"), missing=True)
    seen = ~np.isnan(bearings)
    if not seen.any():
        raise InvalidInputError(f"bearings: expected at least one sighting, got none in shape {bearings.shape}")
    each = deviations(sigma, bearings.shape, seen)
    view, landmark = np.nonzero(seen)
    views, landmarks = bearings.shape
    return Table(views, landmarks, Sightings(view, landmark, bearings[seen], each), each, dense=True)


def deviations(sigma: ArrayLike, shape: tuple[int, ...], seen: NDArray[np.bool_] | None = None) -> FloatArray:
    """One standard deviation for all sightings or one for each, as one for each."""
    given = plain("sigma", sigma)
    one = given.ndim == 0
    values = floats("sigma", given, () if one else shape, missing=seen is not None and not one)
    values = np.broadcast_to(values, shape)
    if seen is not None:
        values = values[seen]
    low, high = SIGMA_RANGE
    bad = ~((values >= low) & (values <= high))
    if bad.any():
        where = "" if one else f"[{int(np.argmax(bad))}]"
        value = values[bad][0]
        wanted = f"from {low:g} to {high:g}" if value > 0 else "above 0"
        raise InvalidInputError(f"sigma{where}: expected a number {wanted} for every sighting, got {value:g}")
    return np.ascontiguousarray(values)


def _within(name: str, index: IntArray, count: int, what: str) -> None:
    if index.max(initial=-1) >= count:
        raise InvalidInputError(f"{name}: expected indices of the {count} {what}, got {index.max()}")


def _alike(few: FloatArray, given: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Standard deviations (k, n) in the form of others: as they are, or as covariances (k, n, n)."""
    if given.ndim == 2:
        return few, given
    return few[:, :, None] ** 2 * np.eye(few.shape[1]), given


def _names(name: str, values: Iterable[str], least: int) -> tuple[str, ...]:
    names = tuple(values)
    if len(names) < least:
        raise InvalidInputError(f"{name}: expected at least {least} names, got {len(names)}")
    for i, one in enumerate(names):
        if not (type(one) is str and one and one == one.strip()) or "\n" in one or "\r" in one:
            raise InvalidInputError(
                f"{name}[{i}]: expected a name on one line without blanks around it, got {quote(one)}"
            )
    if len(set(names)) != len(names):
        twice = Counter(names).most_common(1)[0][0]
        raise InvalidInputError(f"{name}: expected distinct names, got {quote(twice)} twice")
    return names
