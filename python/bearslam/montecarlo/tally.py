# SPDX-License-Identifier: MIT OR Apache-2.0
"""Counts and histograms of many groups of trials: integers, so that the order of summation does not matter."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal, TypeAlias

import numpy as np

from bearslam.data.checks import FloatArray, IntArray

__all__ = ["COUNTS", "HIGHEST", "LOWEST", "QUANTITIES", "Quantity", "Tally"]

Quantity: TypeAlias = Literal["position", "heading", "position_ratio", "heading_ratio"]
QUANTITIES = ("position", "heading", "position_ratio", "heading_ratio")
"""Quantities with histograms: root-mean-square errors, and their ratios to the Cramer-Rao bounds."""
COUNTS = ("trials", "failures", "without_map", "incomplete", "iterations", "nanoseconds")
TRIALS, FAILURES, WITHOUT_MAP, INCOMPLETE, ITERATIONS, NANOSECONDS = range(6)

LOWEST, HIGHEST = -4096, 4095
"""The first and the last bin of a histogram."""
WIDTH = HIGHEST - LOWEST + 1
PER_OCTAVE = 64
"""Bin b holds the values from 2^(b/64) to 2^((b+1)/64)."""


@dataclass(frozen=True, eq=False)
class Tally:
    """Counts and histograms of groups of trials; a group is one or several pairs of a cell and a start.

    Attributes
    ----------
    counts : (groups, 6) ndarray of int
        Counts in the order of `COUNTS`.
    keys : (k,) ndarray of int
        Group, quantity and bin of every bin that is not empty, packed into one integer each, ascending.
    sizes : (k,) ndarray of int
        Numbers of values in these bins.
    """

    counts: IntArray
    keys: IntArray
    sizes: IntArray

    def __post_init__(self) -> None:
        for array in (self.counts, self.keys, self.sizes):
            array.setflags(write=False)

    @classmethod
    def empty(cls, groups: int) -> Tally:
        """A tally of no trials."""
        nothing = np.empty(0, dtype=np.int64)
        return cls(np.zeros((groups, len(COUNTS)), dtype=np.int64), nothing, nothing)

    @property
    def groups(self) -> int:
        """Number of groups."""
        return len(self.counts)

    def plus(self, parts: Iterable[tuple[int, IntArray, IntArray]]) -> Tally:
        """The sum with parts from the core: first group, counts, and rows of group, quantity, bin and size."""
        counts = self.counts.copy()
        keys, sizes = [self.keys], [self.sizes]
        for first, more, bins in parts:
            counts[first : first + len(more)] += more
            group, quantity, place, size = bins.T
            keys.append(key(first + group, quantity, place))
            sizes.append(size)
        return Tally(counts, *_summed(np.concatenate(keys), np.concatenate(sizes)))

    def regrouped(self, to: IntArray, groups: int) -> Tally:
        """Sums over groups: group i is added to `to[i]`, or dropped if that is negative."""
        kept = to >= 0
        counts = np.zeros((groups, len(COUNTS)), dtype=np.int64)
        np.add.at(counts, to[kept], self.counts[kept])
        group, rest = np.divmod(self.keys, len(QUANTITIES) * WIDTH)
        chosen = kept[group]
        keys = to[group[chosen]] * (len(QUANTITIES) * WIDTH) + rest[chosen]
        return Tally(counts, *_summed(keys, self.sizes[chosen]))

    def bins(self) -> IntArray:
        """Rows of group, quantity, bin and size, ascending."""
        upper, place = np.divmod(self.keys, WIDTH)
        group, quantity = np.divmod(upper, len(QUANTITIES))
        return np.stack([group, quantity, place + LOWEST, self.sizes], axis=1)

    def flaw(self) -> tuple[int, str] | None:
        """The first group with impossible counts, and what is wrong with it; files may be damaged."""
        trials, failures, without_map, incomplete = self.counts[:, :4].T
        found = [
            (self.counts < 0).any(axis=1),
            (failures > trials) | (incomplete > trials),
            (without_map > failures),
        ]
        flaws = ["a count below 0", "more failures than trials", "more trials without a map than failures"]
        group = self.keys // (len(QUANTITIES) * WIDTH)
        for index, name in enumerate(QUANTITIES):
            chosen = self.keys // WIDTH % len(QUANTITIES) == index
            values = np.zeros(self.groups, dtype=np.int64)
            np.add.at(values, group[chosen], self.sizes[chosen])
            found.append(values > trials - without_map)
            flaws.append(f"more values of {name} than maps")
        at, which = np.nonzero(np.stack(found, axis=1))
        return (int(at[0]), flaws[which[0]]) if len(at) else None

    def share(self, count: int) -> FloatArray:
        """One of the counts per trial, for every group; NaN without trials."""
        trials = self.counts[:, TRIALS]
        with np.errstate(invalid="ignore"):
            shares: FloatArray = np.where(trials > 0, self.counts[:, count], np.nan) / trials
        return shares

    def failure_interval(self, confidence: float) -> FloatArray:
        """Wilson's interval (groups, 2) of the failure rate; NaN without trials."""
        z = NormalDist().inv_cdf(0.5 + confidence / 2)
        failed = self.counts[:, FAILURES].astype(float)
        trials = np.where(self.counts[:, TRIALS] > 0, self.counts[:, TRIALS], np.nan)
        middle = failed + z**2 / 2
        half = z * np.sqrt(failed * (trials - failed) / trials + z**2 / 4)
        low = np.where(failed == 0, 0.0 * trials, (middle - half) / (trials + z**2))
        high = np.where(failed == trials, 1.0, (middle + half) / (trials + z**2))
        interval: FloatArray = np.stack([low, high], axis=1)
        return interval

    def quantile(self, quantity: int, q: float) -> FloatArray:
        """The value below which a share `q` of the values of every group lies; NaN without values."""
        starts, ends = self._extent(quantity)
        running = np.concatenate([[0], np.cumsum(self.sizes)])
        below, upto = running[starts], running[ends]
        rank = below + np.floor(q * np.maximum(upto - below - 1, 0)).astype(np.int64)
        at = np.searchsorted(running, rank, side="right") - 1
        values = np.full(self.groups, np.nan)
        some = upto > below
        values[some] = _middle(self.keys[at[some]])
        return values

    def root_mean_square(self, quantity: int) -> FloatArray:
        """The root mean square of the values of every group; NaN without values."""
        group, other = np.divmod(self.keys // WIDTH, len(QUANTITIES))
        chosen = other == quantity
        sizes = self.sizes[chosen].astype(float)
        squares = _middle(self.keys[chosen]) ** 2 * sizes
        totals = np.bincount(group[chosen], sizes, self.groups)
        with np.errstate(invalid="ignore"):
            means = np.where(totals > 0, np.bincount(group[chosen], squares, self.groups), np.nan) / totals
        roots: FloatArray = np.sqrt(means)
        return roots

    def _extent(self, quantity: int) -> tuple[IntArray, IntArray]:
        """Start and end of the bins of every group."""
        first = (np.arange(self.groups) * len(QUANTITIES) + quantity) * WIDTH
        return np.searchsorted(self.keys, first), np.searchsorted(self.keys, first + WIDTH)


def key(group: IntArray, quantity: IntArray, place: IntArray) -> IntArray:
    """Group, quantity and bin packed into one integer."""
    return (group * len(QUANTITIES) + quantity) * WIDTH + (place - LOWEST)


def _middle(keys: IntArray) -> FloatArray:
    """The geometric middles of bins."""
    middles: FloatArray = np.exp2((keys % WIDTH + (LOWEST + 0.5)) / PER_OCTAVE)
    return middles


def _summed(keys: IntArray, sizes: IntArray) -> tuple[IntArray, IntArray]:
    """Every key once, ascending, with the sum of its sizes."""
    order = np.argsort(keys, kind="stable")
    keys, sizes = keys[order], sizes[order]
    first = np.flatnonzero(np.diff(keys, prepend=-1))
    return keys[first], np.add.reduceat(sizes, first) if len(first) else sizes
