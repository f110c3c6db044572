# SPDX-License-Identifier: MIT OR Apache-2.0
"""Random choices for inputs."""

from __future__ import annotations

import bisect
import itertools
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")


class Dice:
    """Random choices from one seed: the same seed gives the same choices."""

    def __init__(self, seed: int) -> None:
        self.numbers = np.random.Generator(np.random.PCG64(seed))

    def chance(self, share: float) -> bool:
        """True in this share of cases."""
        return bool(self.numbers.random() < share)

    def pick(self, options: Sequence[T]) -> T:
        """One of the options, all equally likely."""
        return options[int(self.numbers.integers(len(options)))]

    def weighted(self, shares: dict[T, float]) -> T:
        """One of the keys, in proportion to its value."""
        ends = list(itertools.accumulate(shares.values()))
        return list(shares)[bisect.bisect_right(ends, ends[-1] * self.numbers.random(), hi=len(ends) - 1)]

    def whole(self, low: int, high: int) -> int:
        """Integer from `low` to `high`, both included."""
        return int(self.numbers.integers(low, high, endpoint=True))

    def real(self, low: float, high: float) -> float:
        """Number between two others."""
        return float(self.numbers.uniform(low, high))

    def power(self, low: float, high: float) -> float:
        """Number between two powers of ten, evenly in the exponent."""
        return float(10.0 ** self.numbers.uniform(low, high))

    def normal(self, *shape: int) -> Any:
        """Standard normal numbers."""
        return self.numbers.standard_normal(shape)

    def subset(self, count: int, share: float) -> Any:
        """Ascending indices below `count`, each with this probability."""
        return np.flatnonzero(self.numbers.random(count) < share)
