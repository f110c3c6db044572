# SPDX-License-Identifier: MIT OR Apache-2.0
"""Simulation of random scenes with known truth."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bearslam import _core
from bearslam.data.checks import LARGEST, SEED_LIMIT, FloatArray, choice, floats, posed, real, spread, whole
from bearslam.data.priors import Odometry
from bearslam.data.sightings import Sightings
from bearslam.errors import InvalidInputError

__all__ = ["LAYOUTS", "OUTLIERS", "PLACES", "Layout", "Outliers", "Scene", "simulate"]

Layout: TypeAlias = Literal["mixed", "enclosed", "trajectory"]
LAYOUTS = ("mixed", "enclosed", "trajectory")
Outliers: TypeAlias = Literal["uniform", "exchanged", "merged", "mixture"]
OUTLIERS = ("uniform", "exchanged", "merged", "mixture")
PLACES = 2**27
"""Largest number of entries of a table of bearings: 1 GB."""


@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """True poses and landmarks, and the noisy bearings between them.

    Attributes
    ----------
    poses : (m, 3) ndarray
        Position and heading (x, y, theta) of each view [m, rad].
    landmarks : (n, 2) ndarray
        Positions [m].
    bearings : (m, n) ndarray
        Bearing of each landmark from each view, with noise, in (-pi, pi]; NaN where it is out of range [rad].
    outliers : (m, n) ndarray of bool
        Bearings that have been made outliers. None by default.
    """

    poses: FloatArray
    landmarks: FloatArray
    bearings: FloatArray
    outliers: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), dtype=bool))

    def __post_init__(self) -> None:
        posed("poses", self.poses, ("m", 3))
        if not self.outliers.size:
            object.__setattr__(self, "outliers", np.zeros(np.shape(self.bearings), dtype=bool))

    def __repr__(self) -> str:
        seen = int(np.isfinite(self.bearings).sum())
        return f"<Scene: {seen} sightings of {len(self.landmarks)} landmarks from {len(self.poses)} views>"

    @property
    def sightings(self) -> Sightings:
        """The bearings as parallel arrays, view by view."""
        view, landmark = np.nonzero(np.isfinite(self.bearings))
        return Sightings(view, landmark, self.bearings[view, landmark])

    def odometry(self, sigma: ArrayLike, seed: int) -> Odometry:
        """Motions from each view to the next, with Gaussian noise.

        Parameters
        ----------
        sigma : (3,) array_like of float
            Standard deviations of x, y and theta, above 0; that of theta at most pi [m, rad].
        seed : int
            The same seed gives the same noise.

        Raises
        ------
        InvalidInputError
            If a standard deviation is not above 0, too large or most likely in degrees, or the seed is out of range.

        Examples
        --------
        >>> from bearslam import simulate
        >>> simulate("trajectory", 20, 9, noise=0.01, seed=1).odometry([0.02, 0.02, 0.01], seed=2)
        <Odometry: 19 motions between 20 views>
        """
        x, y, theta = floats("sigma", sigma, (3,)).tolist()
        each = (
            real("sigma[0]", x, 0.0, above=True),
            real("sigma[1]", y, 0.0, above=True),
            spread("sigma[2]", theta, above=True),
        )
        delta = _core.odometry(self.poses, each, whole("seed", seed, 0, SEED_LIMIT))
        view = np.arange(len(delta))
        return Odometry(view, view + 1, delta, each)


def simulate(
    layout: Layout,
    views: int,
    landmarks: int,
    *,
    noise: float,
    seed: int,
    width: float = 7.0,
    height: float = 5.0,
    sight: float = math.inf,
    outliers: float = 0.0,
    outlier_kind: Outliers = "uniform",
) -> Scene:
    """Draw a random scene: views and landmarks in an arena, and the bearings between them.

    Parameters
    ----------
    layout : {"mixed", "enclosed", "trajectory"}
        "mixed": views and landmarks anywhere in the arena. "enclosed": landmarks on its border, views inside.
        "trajectory": views along a path among landmarks.
    views, landmarks : int
        Numbers of views and landmarks, at least 1.
    noise : float
        Standard deviation of the bearings, at most pi [rad].
    seed : int
        The same seed gives the same scene on every machine.
    width, height : float
        Size of the arena [m].
    sight : float
        Range of the sensor: landmarks farther away are not seen [m].
    outliers : float
        Share of the bearings that are outliers, 0 to 1.
    outlier_kind : {"uniform", "exchanged", "merged", "mixture"}
        "uniform": random bearings. "exchanged": identities exchanged within views, the bearings of some landmarks of a
        view permuted so that none keeps its own. "merged": two landmarks under one identity; the one with fewer
        sightings is left without any, and its bearings are the outliers of the other. Pairs are merged until the share
        is reached or no pair is left, and at most half of the bearings that are left are outliers. "mixture": a third
        each swapped in pairs within a view, turned by pi, and random.

    Returns
    -------
    Scene
        The truth, the bearings, and which of them are outliers.

    Raises
    ------
    InvalidInputError
        If an argument is out of range.

    References
    ----------
    Dellaert and Stroupe, ICRA 2002, section 4.2, for "mixed" and "enclosed" and the size of the arena.

    Examples
    --------
    >>> from bearslam import simulate
    >>> simulate("mixed", 4, 9, noise=0.04, seed=1)
    <Scene: 36 sightings of 9 landmarks from 4 views>
    >>> scene = simulate("mixed", 8, 15, noise=0.01, seed=1, outliers=0.2, outlier_kind="exchanged")
    >>> scene.outliers.sum()
    np.int64(24)
    """
    views, landmarks = whole("views", views, 1), whole("landmarks", landmarks, 1)
    if views * landmarks > PLACES:
        raise InvalidInputError(f"views: expected at most {PLACES} pairs with landmarks, got {views} x {landmarks}")
    poses, points, bearings, wrong = _core.simulate(
        choice("layout", layout, LAYOUTS),
        views,
        landmarks,
        spread("noise", noise),
        whole("seed", seed, 0, SEED_LIMIT),
        real("width", width, 0.0, LARGEST, above=True),
        real("height", height, 0.0, LARGEST, above=True),
        real("sight", sight, 0.0, above=True, infinite=True),
        real("outliers", outliers, 0.0, 1.0),
        choice("outlier_kind", outlier_kind, OUTLIERS),
    )
    return Scene(poses, points, bearings, wrong)
