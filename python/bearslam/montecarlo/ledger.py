# SPDX-License-Identifier: MIT OR Apache-2.0
"""What has come in of a sweep so far."""

from __future__ import annotations

from typing import NamedTuple

from bearslam.data.checks import IntArray
from bearslam.montecarlo.grid import Chunk, Grid
from bearslam.montecarlo.tally import Tally

__all__ = ["Ledger"]

ROWS = 10**6
"""Of histograms that wait to be added up."""


class _State(NamedTuple):
    sum: Tally
    chunks: frozenset[Chunk]
    """The chunks in the sum."""
    waiting: dict[Chunk, tuple[IntArray, IntArray]]
    """The others."""


class Ledger:
    """Tallies of chunks, every one once, added up now and then.

    Ctrl-C may stop Python between any two steps. So every change here is one step, and a chunk that is entered again
    because nobody knows how far it had come the first time does no harm.
    """

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._state = _State(Tally.empty(grid.cells * len(grid.start)), frozenset(), {})
        self._limit = ROWS
        self._rows = 0

    def enter(self, chunk: Chunk, counts: IntArray, bins: IntArray) -> bool:
        """Add what a chunk has brought, unless it has been added before."""
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
        # No more often than when as much has come as there is, or adding up would take all the time.
        self._limit = max(ROWS, len(self._state.sum.keys))
        self._rows = 0
