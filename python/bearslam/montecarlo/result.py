# SPDX-License-Identifier: MIT OR Apache-2.0
"""The result of a sweep as data: counts with names on every axis, and the statistics that follow from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from bearslam import _core
from bearslam.data.checks import FloatArray, IntArray, choice, quote, whole
from bearslam.errors import InvalidInputError
from bearslam.montecarlo.grid import AXES, Grid, Start
from bearslam.montecarlo.statistics import Statistics, Total, confident
from bearslam.montecarlo.tally import COUNTS, Tally
from bearslam.verbs.simulate import Layout, Scene, simulate

__all__ = ["Result"]


@dataclass(frozen=True, eq=False, repr=False)
class Result(Statistics[Mapping[str, FloatArray], Mapping[str, IntArray]]):
    """Failures, errors, iterations and time of every start in every cell of a sweep.

    A cell is one combination of layout, noise, views and landmarks. A statistic is a dict from start to an array of
    shape (noise, views, landmarks), or (layout, noise, views, landmarks) if the layouts of the sweep were given as a
    sequence. It is NaN in cells without trials.

    Attributes
    ----------
    grid : Grid
        The cells and the starts.
    trials : int
        Number of trials per cell that were requested.
    seeds : tuple of int
        The seed; several after `merge`.
    tally : Tally
        Integer counts and histograms, from which everything else is computed.
    """

    grid: Grid
    trials: int
    seeds: tuple[int, ...]
    tally: Tally

    def __repr__(self) -> str:
        counts = [
            f"{len(values)} {word if len(values) == 1 else plural}"
            for word, plural, values in (
                ("layout", "layouts", self.layout),
                ("noise", "noises", self.noise),
                ("views", "views", self.views),
                ("landmarks", "landmarks", self.landmarks),
                ("start", "starts", self.start),
            )
        ]
        done, total = int(self.done.sum()), self.trials * self.grid.cells
        return f"<{type(self).__name__}: {', '.join(counts)}; {done} of {total} scenes>"

    @property
    def layout(self) -> tuple[Layout, ...]:
        """The layouts."""
        return self.grid.layout

    @property
    def noise(self) -> FloatArray:
        """The standard deviations of the bearings [rad]."""
        return np.array(self.grid.noise)

    @property
    def views(self) -> IntArray:
        """The numbers of views."""
        return np.array(self.grid.views)

    @property
    def landmarks(self) -> IntArray:
        """The numbers of landmarks."""
        return np.array(self.grid.landmarks)

    @property
    def start(self) -> tuple[Start, ...]:
        """The starts that were compared."""
        return self.grid.start

    @property
    def done(self) -> IntArray:
        """Number of trials done in every cell, each from all starts."""
        counts = self.tally.counts[:: len(self.start), COUNTS.index("trials")]
        return counts.copy().reshape(self.grid.shape[1:] if self.grid.single else self.grid.shape)

    @property
    def complete(self) -> bool:
        """Whether all requested trials were done; False after an interruption."""
        return bool((self.done == self.trials).all())

    def failure_interval(self, confidence: float = 0.95) -> Mapping[str, FloatArray]:
        """Confidence interval of the failure rate (Wilson score interval).

        Parameters
        ----------
        confidence : float
            Above 0 and below 1.

        Returns
        -------
        dict of str to (..., 2) ndarray
            The lower and the upper end, for every start.

        Raises
        ------
        InvalidInputError
            If the confidence is out of range.

        References
        ----------
        Wilson, Journal of the American Statistical Association 22, 1927.
        """
        return self._reals(self.tally.failure_interval(confident(confidence)))

    def total(
        self,
        start: Start,
        *,
        layout: Layout | None = None,
        noise: float | None = None,
        views: int | None = None,
        landmarks: int | None = None,
    ) -> Total:
        """Statistics over all cells together, or over those with a given layout, noise, views or landmarks.

        Parameters
        ----------
        start : str
            One of the starts of the sweep.
        layout, noise, views, landmarks
            Selected cells: a value of the sweep, or None for all.

        Returns
        -------
        Total
            The same statistics, as numbers instead of arrays.

        Raises
        ------
        InvalidInputError
            If the sweep has no such start or value.
        """
        of = self.start.index(choice("start", start, self.start))
        chosen = np.ones(self.grid.shape, dtype=bool)
        for axis, (name, value) in enumerate(zip(AXES, (layout, noise, views, landmarks), strict=True)):
            if value is not None:
                mask = np.zeros(self.grid.shape[axis], dtype=bool)
                mask[self._index(name, value)] = True
                chosen &= mask.reshape([-1 if other == axis else 1 for other in range(4)])
        to = np.full((self.grid.cells, len(self.start)), -1)
        to[chosen.ravel(), of] = 0
        return Total(self.tally.regrouped(to.ravel(), 1))

    def scene(
        self, trial: int, *, layout: Layout, noise: float, views: int, landmarks: int, seed: int | None = None
    ) -> Scene:
        """Draw the scene of a trial again, to examine it.

        Parameters
        ----------
        trial : int
            Number of the trial, from 0.
        layout, noise, views, landmarks
            Values of the sweep that select the cell.
        seed : int, optional
            One of the `seeds`; by default the first.

        Returns
        -------
        Scene
            The scene of the trial.

        Raises
        ------
        InvalidInputError
            If the sweep has no such cell or seed.
        """
        own = self.seeds[0] if seed is None else seed
        if own not in self.seeds:
            raise InvalidInputError(f"seed: expected one of the sweep, {quote(self.seeds)}, got {quote(seed)}")
        cell = (
            self.grid.layout[self._index("layout", layout)],
            self.grid.views[self._index("views", views)],
            self.grid.landmarks[self._index("landmarks", landmarks)],
        )
        exact = self.grid.noise[self._index("noise", noise)]
        drawn = _core.scene_seed(*cell, exact, own, whole("trial", trial, 0))
        return simulate(*cell, noise=exact, seed=drawn)

    def merge(self, other: Result) -> Self:
        """Merge with another sweep of the same cells and starts and different seeds.

        Parameters
        ----------
        other : SweepResult
            A sweep with another seed, and so with other scenes.

        Returns
        -------
        SweepResult
            The trials of both.

        Raises
        ------
        InvalidInputError
            If the cells or starts differ, or both have a seed in common: the same scenes would count twice.
        """
        if not isinstance(other, Result):
            raise InvalidInputError(f"other: expected the result of a sweep, got {quote(other)}")
        difference = self.grid.difference(other.grid)
        if difference is not None:
            raise InvalidInputError(f"other: expected a sweep of the same kinds of scenes, got {difference}")
        common = set(self.seeds) & set(other.seeds)
        if common:
            raise InvalidInputError(f"other: expected a sweep with another seed, got {min(common)} again")
        together = self.tally.plus([(0, other.tally.counts, other.tally.bins())])
        return type(self)(self.grid, self.trials + other.trials, self.seeds + other.seeds, together)

    def identical(self, other: Result, *, times: bool = False) -> bool:
        """Whether another sweep has the same cells, starts, trials, seeds and results, bit by bit.

        Parameters
        ----------
        other : SweepResult
            The sweep to compare with.
        times : bool
            Whether to compare the times as well, which are equal in copies only.

        Returns
        -------
        bool
            True if they are the same.
        """
        counted = slice(None) if times else slice(0, COUNTS.index("nanoseconds"))
        return (
            (self.grid, self.trials, self.seeds) == (other.grid, other.trials, other.seeds)
            and np.array_equal(self.tally.counts[:, counted], other.tally.counts[:, counted])
            and np.array_equal(self.tally.keys, other.tally.keys)
            and np.array_equal(self.tally.sizes, other.tally.sizes)
        )

    def _index(self, name: str, value: object) -> int:
        """Index of a value along an axis; a noise need not match to the last bit."""
        known = getattr(self.grid, name)
        for index, one in enumerate(known):
            if one == value or (
                name == "noise" and isinstance(value, float | np.floating) and abs(one - value) <= 1e-9 * one
            ):
                return index
        raise InvalidInputError(f"{name}: expected one of the sweep, {quote(known)}, got {quote(value)}")

    def _shaped(self, values: FloatArray | IntArray) -> dict[str, Any]:
        shape = self.grid.shape[1:] if self.grid.single else self.grid.shape
        by_start = values.reshape(self.grid.cells, len(self.start), *values.shape[1:])
        return {
            start: by_start[:, index].copy().reshape(*shape, *values.shape[1:])
            for index, start in enumerate(self.start)
        }

    def _reals(self, values: FloatArray) -> Mapping[str, FloatArray]:
        return self._shaped(values)

    def _wholes(self, values: IntArray) -> Mapping[str, IntArray]:
        return self._shaped(values)
