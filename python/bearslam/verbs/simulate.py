# SPDX-License-Identifier: MIT OR Apache-2.0
"""Simulation of random scenes with known truth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from bearslam import _core
from bearslam.data.checks import LARGEST, SEED_LIMIT, FloatArray, choice, floats, posed, real, spread, whole
from bearslam.data.priors import Odometry
from bearslam.data.sightings import Sightings
from bearslam.errors import InvalidInputError

__all__ = ["LAYOUTS", "PLACES", "Layout", "Scene", "simulate"]

Layout: TypeAlias = Literal["mixed", "enclosed", "trajectory"]
LAYOUTS = ("mixed", "enclosed", "trajectory")
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
    """

    poses: FloatArray
    landmarks: FloatArray
    bearings: FloatArray

    def __post_init__(self) -> None:
        posed("poses", self.poses, ("m", 3))

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

    Returns
    -------
    Scene
        The truth and the bearings.

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
    """
    views, landmarks = whole("views", views, 1), whole("landmarks", landmarks, 1)
    if views * landmarks > PLACES:
        raise InvalidInputError(f"views: expected at most {PLACES} pairs with landmarks, got {views} x {landmarks}")
    poses, points, bearings = _core.simulate(
        choice("layout", layout, LAYOUTS),
        views,
        landmarks,
        spread("noise", noise),
        whole("seed", seed, 0, SEED_LIMIT),
        real("width", width, 0.0, LARGEST, above=True),
        real("height", height, 0.0, LARGEST, above=True),
        real("sight", sight, 0.0, above=True, infinite=True),
    )
    return Scene(poses, points, bearings)
