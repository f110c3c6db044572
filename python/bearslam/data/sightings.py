# SPDX-License-Identifier: MIT OR Apache-2.0
"""Sightings: which view saw which landmark, at which bearing and, where a range came with it, at which offset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bearslam.data.checks import FloatArray, IntArray, angles, check_half_turn, floats, indices, plain
from bearslam.data.priors import noise, set_read_only
from bearslam.errors import InvalidInputError

__all__ = ["SIGMA_RANGE", "Offsets", "Sightings", "deviations"]

SIGMA_RANGE = (1e-100, 1e100)
"""Standard deviations whose fourth powers a double can hold [rad]."""


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Sightings:
    """Which view saw which landmark, and at which bearing: one entry per sighting, in parallel arrays.

    Parameters
    ----------
    view, landmark : (k,) array_like of int
        0-based indices of the view and of the landmark it saw. A view sees a landmark at most once. The largest index
        tells how many views (landmarks) there are.
    bearing : (k,) array_like of float
        Directions in the frame of the view, counter-clockwise from its heading, within one turn [rad].
    sigma : (k,) array_like of float, or float, optional
        Standard deviations of the bearings, above 0 and at most pi [rad].

    Raises
    ------
    InvalidInputError
        If lengths differ, there are no sightings, an index is negative or not an integer, a number is not finite, or an
        angle is most likely in degrees.

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
            "bearing": angles("bearing", bearing, ("k",)),
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
    """Positions of landmarks relative to views: bearings that were measured together with a range.

    Only their bearings are used, which are among the sightings. Offsets are kept so that files can be written back.

    Parameters
    ----------
    sighting : (k,) array_like of int
        0-based indices of the sightings they belong to, each at most once.
    position : (k, 2) array_like of float
        Position of the landmark in the frame of the view: x ahead, y to the left [length].
    sigma : (2,), (k, 2) or (k, 2, 2) array_like of float
        Standard deviations of x and y, for all or for each, or covariances, in the frame of the view [length].

    Raises
    ------
    InvalidInputError
        If lengths differ, a number is not finite, a landmark coincides with the view, or a standard deviation or
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
            raise InvalidInputError(
                f"position[{where}]: expected a landmark away from the view, got one that coincides with it"
            )
        set_read_only(self, sighting=index, position=places, sigma=noise("sigma", sigma, k, 2))

    def __len__(self) -> int:
        return len(self.sighting)

    def __repr__(self) -> str:
        return f"<Offsets: {len(self)} landmarks>"

    @property
    def bearing(self) -> FloatArray:
        """Bearing of each landmark in the frame of the view (k,) [rad]."""
        x, y = self.position.T
        angles: FloatArray = np.arctan2(y, x)
        return angles

    @property
    def bearing_sigma(self) -> FloatArray:
        """Standard deviation of each bearing, to first order but at most pi (k,) [rad]."""
        x, y = self.position.T
        across = np.stack([-y, x], axis=1) / (x * x + y * y)[:, None]
        spread: FloatArray
        if self.sigma.ndim == 2:
            spread = np.hypot(*(across * self.sigma).T)
        else:
            spread = np.sqrt(np.einsum("ki,kij,kj->k", across, self.sigma, across))
        return np.minimum(spread, np.pi)


def deviations(sigma: ArrayLike, shape: tuple[int, ...], seen: NDArray[np.bool_] | None = None) -> FloatArray:
    """Standard deviations, one per sighting, from a single one or one for each."""
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
    if one:
        check_half_turn("sigma", given)
    else:
        check_half_turn("sigma", values)
    return np.ascontiguousarray(values)
