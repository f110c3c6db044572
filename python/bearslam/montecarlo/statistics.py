# SPDX-License-Identifier: MIT OR Apache-2.0
"""Statistics of trials: of each cell, or of many cells together."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Generic, TypeVar

from bearslam.data.checks import FloatArray, IntArray, choice, quote, real
from bearslam.errors import InvalidInputError
from bearslam.montecarlo.tally import (
    FAILURES,
    INCOMPLETE,
    ITERATIONS,
    NANOSECONDS,
    QUANTITIES,
    WITHOUT_MAP,
    Quantity,
    Tally,
)

__all__ = ["Statistics", "Total", "confident"]

Reals = TypeVar("Reals", covariant=True)
Wholes = TypeVar("Wholes", covariant=True)


class Statistics(ABC, Generic[Reals, Wholes]):
    """Statistics that follow from a tally; NaN without trials."""

    tally: Tally

    @abstractmethod
    def _reals(self, values: FloatArray) -> Reals:
        """Values of all groups in the shape of the result."""

    @abstractmethod
    def _wholes(self, values: IntArray) -> Wholes:
        """The same for integers."""

    @property
    def failures(self) -> Wholes:
        """Number of trials that missed the lowest known cost of their scene.

        The lowest cost is that over all starts of the sweep and a refinement from the truth. A trial has failed if it
        found no map, or one whose cost is higher by a share of more than 1e-5.
        """
        return self._wholes(self.tally.counts[:, FAILURES])

    @property
    def failure_rate(self) -> Reals:
        """Failures over trials."""
        return self._reals(self.tally.share(FAILURES))

    @property
    def without_map(self) -> Wholes:
        """Number of trials without any map; they count as failures and have no errors."""
        return self._wholes(self.tally.counts[:, WITHOUT_MAP])

    @property
    def incomplete(self) -> Wholes:
        """Number of trials whose map leaves a view or landmark undetermined, even if only its range."""
        return self._wholes(self.tally.counts[:, INCOMPLETE])

    @property
    def mean_iterations(self) -> Reals:
        """Linear systems solved per trial, in the refinement of the best map."""
        return self._reals(self.tally.share(ITERATIONS))

    @property
    def mean_seconds(self) -> Reals:
        """Time per trial, start and refinement, on one core; it varies from run to run [s]."""
        return self._reals(self.tally.share(NANOSECONDS) * 1e-9)

    def quantile(self, quantity: Quantity, q: float) -> Reals:
        """The value below which a share `q` of the trials lies, to half a percent.

        Parameters
        ----------
        quantity : {"position", "heading", "position_ratio", "heading_ratio"}
            Root-mean-square error of the positions of views and landmarks [m] or of the headings [rad], after alignment
            of all positions; or their ratios to the Cramer-Rao bounds. Failures are included.
        q : float
            From 0 to 1.

        Raises
        ------
        InvalidInputError
            If there is no such quantity, or `q` is out of range.
        """
        index = QUANTITIES.index(choice("quantity", quantity, QUANTITIES))
        return self._reals(self.tally.quantile(index, real("q", q, 0.0, 1.0)))

    @property
    def position_median(self) -> Reals:
        """Median of the position errors [m]."""
        return self.quantile("position", 0.5)

    @property
    def position_p90(self) -> Reals:
        """90th percentile of the position errors [m]."""
        return self.quantile("position", 0.9)

    @property
    def heading_median(self) -> Reals:
        """Median of the heading errors [rad]."""
        return self.quantile("heading", 0.5)

    @property
    def heading_p90(self) -> Reals:
        """90th percentile of the heading errors [rad]."""
        return self.quantile("heading", 0.9)

    @property
    def position_ratio(self) -> Reals:
        """Root mean square of the position errors over their Cramer-Rao bounds: near 1 is optimal.

        NaN without noise, and where the bearings determine no map.
        """
        return self._reals(self.tally.root_mean_square(QUANTITIES.index("position_ratio")))

    @property
    def heading_ratio(self) -> Reals:
        """Root mean square of the heading errors over their Cramer-Rao bounds."""
        return self._reals(self.tally.root_mean_square(QUANTITIES.index("heading_ratio")))


class Total(Statistics[float, int]):
    """Statistics of the trials of many cells together, from one start; see `SweepResult.total`."""

    def __init__(self, tally: Tally) -> None:
        self.tally = tally

    def __repr__(self) -> str:
        return f"<Total: {self.failures} failures in {self.trials} trials>"

    @property
    def trials(self) -> int:
        """Number of trials done."""
        return int(self.tally.counts[0, 0])

    def failure_interval(self, confidence: float = 0.95) -> tuple[float, float]:
        """Wilson's interval of the failure rate; as for `SweepResult.failure_interval`."""
        low, high = self.tally.failure_interval(confident(confidence))[0].tolist()
        return low, high

    def _reals(self, values: FloatArray) -> float:
        return float(values[0])

    def _wholes(self, values: IntArray) -> int:
        return int(values[0])


def confident(confidence: float) -> float:
    """A confidence level above 0 and below 1."""
    value = real("confidence", confidence, 0.0, 1.0, above=True)
    if value == 1.0:
        raise InvalidInputError(f"confidence: expected a number below 1, got {quote(confidence)}")
    return value
