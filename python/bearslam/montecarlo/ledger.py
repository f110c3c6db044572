# SPDX-License-Identifier: MIT OR Apache-2.0
"""The sum of the chunks of a sweep that are done."""

from __future__ import annotations

from typing import NamedTuple

from bearslam.data.checks import IntArray
from bearslam.montecarlo.grid import Chunk, Grid
from bearslam.montecarlo.tally import Tally

__all__ = ["Ledger"]

ROWS = 10**6
"""Rows of histograms that wait before they are added up."""


class _State(NamedTuple):
    sum: Tally
    chunks: frozenset[Chunk]
    """The chunks in the sum."""
    waiting: dict[Chunk, tuple[IntArray, IntArray]]
    """The others."""


class Ledger:
    """Tallies of chunks, each counted once, added up from time to time.

    Ctrl-C may interrupt Python between any two bytecodes. Every change of state here is therefore a single assignment,
    and entering a chunk again after an interruption does no harm.
    """

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._state = _State(Tally.empty(grid.cells * len(grid.start)), frozenset(), {})
        self._limit = ROWS
        self._rows = 0

    def enter(self, chunk: Chunk, counts: IntArray, bins: IntArray) -> bool:
        """Add the result of a chunk; False if it was added before."""
        if chunk in self._state.waiting or chunk in self._state.chunks:
            return False
        self._state.waiting[chunk] = counts, bins
        self._rows += len(bins)
        if self._rows > self._limit:
            self._add_up()
        return True

    def tally(self) -> Tally:
        """The sum of all."""
        self._add_up()
        return self._state.sum

    def _add_up(self) -> None:
        total, chunks, waiting = self._state
        parts = ((chunk.cell * len(self._grid.start), *arrays) for chunk, arrays in waiting.items())
        self._state = _State(total.plus(parts), chunks | waiting.keys(), {})
        # Waiting for as many new rows as the sum has keeps the total cost of adding up linear.
        self._limit = max(ROWS, len(self._state.sum.keys))
        self._rows = 0
