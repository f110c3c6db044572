# SPDX-License-Identifier: MIT OR Apache-2.0
"""A problem: sightings, the names of views and landmarks, odometry and priors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from bearslam.data.checks import FloatArray, IntArray, indices, quote
from bearslam.data.maps import Map, MapLike, pick
from bearslam.data.priors import LandmarkPriors, Odometry, PosePriors
from bearslam.data.sightings import Offsets, Sightings
from bearslam.errors import InvalidInputError

__all__ = ["FIXED", "Problem", "ProblemLike"]

FIXED = 1e-6
"""Standard deviation of views and landmarks that a file declares fixed [length, rad]."""


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Problem:
    """Everything a file says: sightings, names, odometry, priors and a first guess.

    Parameters
    ----------
    sightings : Sightings
        Which view saw which landmark, and at which bearing.
    view_ids, landmark_ids : iterable of str
        One name per view and per landmark: distinct, not empty, on one line, without surrounding blanks. There may be
        more names than the sightings use: views without sightings can be placed by odometry and priors.
    odometry : Odometry, optional
        Measured motions between views.
    pose_priors : PosePriors, optional
        Priors on poses.
    landmark_priors : LandmarkPriors, optional
        Priors on landmarks.
    start : map, or (poses, landmarks), optional
        First guess: poses (m, 3) and landmarks (n, 2), NaN where there is none. `refine` starts from it; `solve`
        ignores it.
    fixed_views, fixed_landmarks : iterable of int
        0-based indices of views and landmarks held at `start`, with a standard deviation of 1e-6 [length, rad].
    offsets : Offsets, optional
        Ranges measured together with bearings. They are kept for files and not used.
    remarks : iterable of str
        Notes on what was left out on reading the file, one line of text each.
    others : iterable of str
        Lines of the file with tags that are not used; `save` to the same format writes them back unchanged.

    Raises
    ------
    InvalidInputError
        If there are fewer names than views or landmarks, a name is not valid, an index is out of range, or a fixed view
        or landmark has no place in `start`.
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
        """The same sightings and names, without odometry, priors and anything else."""
        return Problem(self.sightings, self.view_ids, self.landmark_ids)

    def known_poses(self) -> PosePriors | None:
        """Pose priors, fixed views included."""
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
        """Landmark priors, fixed landmarks included."""
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


ProblemLike: TypeAlias = ArrayLike | Sightings | Problem
"""An (m, n) array of bearings with NaN where a view does not see a landmark, `Sightings`, or a `Problem`."""


def _within(name: str, index: IntArray, count: int, what: str) -> None:
    if index.max(initial=-1) >= count:
        raise InvalidInputError(f"{name}: expected indices of the {count} {what}, got {index.max()}")


def _alike(few: FloatArray, given: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Standard deviations (k, n) in the form of others: unchanged, or as covariances (k, n, n)."""
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
