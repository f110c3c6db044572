# SPDX-License-Identifier: MIT OR Apache-2.0
"""The grid of a sweep: kinds of scenes and starts, cut into chunks of work."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, Literal, NamedTuple, TypeAlias, TypeVar, cast

from numpy.typing import ArrayLike

from bearslam.data.checks import choice, quote, spread, whole
from bearslam.errors import InvalidInputError
from bearslam.verbs.simulate import LAYOUTS, PLACES, Layout

__all__ = ["AXES", "STARTS", "Chunk", "Grid", "RawChunk", "Start", "chunk_size", "cut"]

Start: TypeAlias = Literal["random", "projective", "calibrated", "solve"]
STARTS = ("random", "projective", "calibrated", "solve")
AXES = ("layout", "noise", "views", "landmarks")
"""Axes in the order in which cells are counted, the last fastest."""
RawChunk: TypeAlias = tuple[str, int, int, float, int, int]
"""A chunk as the core takes it: layout, views, landmarks, noise [rad], first trial and the one after the last."""

LONGEST = 10_000
"""Largest number of values along one axis."""
CELLS = 10**6
CHUNKS = 10**7
FEWEST, MOST = 10, 10_000
"""Default range of the number of trials per chunk."""
PIECES = 2000
"""Number of chunks into which a sweep of medium size is cut."""

T = TypeVar("T")


class Chunk(NamedTuple):
    """A range of trials of one cell: a piece of work."""

    cell: int
    first: int
    end: int


@dataclass(frozen=True)
class Grid:
    """Kinds of scenes (cells), every combination of layout, noise, views and landmarks, and the starts to compare.

    Attributes
    ----------
    layout, noise, views, landmarks, start : tuple
        The values along each axis; noise in radians.
    single : bool
        Whether the layout was given as a single word, so that results have no axis for it.
    """

    layout: tuple[Layout, ...]
    noise: tuple[float, ...]
    views: tuple[int, ...]
    landmarks: tuple[int, ...]
    start: tuple[Start, ...]
    single: bool = field(default=False, compare=False)

    @classmethod
    def of(cls, layout: object, views: ArrayLike, landmarks: ArrayLike, noise: ArrayLike, starts: object) -> Grid:
        """The grid of the arguments of `sweep`."""
        grid = cls(
            layout=_values("layout", layout, lambda name, value: cast("Layout", str(choice(name, value, LAYOUTS)))),
            # Minus zero equals zero, but would give other scenes.
            noise=_values("noise", noise, lambda name, value: spread(name, value) + 0.0),
            views=_values("views", views, lambda name, value: whole(name, value, 3)),
            landmarks=_values("landmarks", landmarks, lambda name, value: whole(name, value, 4)),
            start=_values("starts", starts, lambda name, value: cast("Start", str(choice(name, value, STARTS)))),
            single=isinstance(layout, str),
        )
        largest = max(grid.views), max(grid.landmarks)
        if math.prod(largest) > PLACES:
            raise InvalidInputError(
                f"views: expected at most {PLACES} pairs with landmarks, got {largest[0]} x {largest[1]}"
            )
        if grid.cells > CELLS:
            shape = " x ".join(map(str, grid.shape))
            raise InvalidInputError(f"noise: expected at most {CELLS} kinds of scenes in all, got {shape}")
        return grid

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Numbers of layouts, noises, views and landmarks."""
        return len(self.layout), len(self.noise), len(self.views), len(self.landmarks)

    @property
    def cells(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    def cell(self, index: int) -> tuple[Layout, float, int, int]:
        """Layout, noise, views and landmarks of a cell."""
        index, landmarks = divmod(index, len(self.landmarks))
        index, views = divmod(index, len(self.views))
        layout, noise = divmod(index, len(self.noise))
        return self.layout[layout], self.noise[noise], self.views[views], self.landmarks[landmarks]

    def raw(self, chunk: Chunk) -> RawChunk:
        """A chunk as the core takes it."""
        layout, noise, views, landmarks = self.cell(chunk.cell)
        return layout, views, landmarks, noise, chunk.first, chunk.end

    def difference(self, other: Grid) -> str | None:
        """The first difference to another grid, such as "noise (0.1,) instead of (0.2,)"."""
        for name in (*AXES, "start"):
            mine, theirs = getattr(self, name), getattr(other, name)
            if mine != theirs:
                return f"{name} {quote(theirs)} instead of {quote(mine)}"
        return None


def chunk_size(scenes: int) -> int:
    """Trials per chunk for a number of scenes: a 2000th of them, but at least 10 and at most 10 000."""
    return min(max(-(-scenes // PIECES), FEWEST), MOST)


def cut(grid: Grid, trials: int, size: int, done: Mapping[int, Sequence[tuple[int, int]]]) -> list[Chunk]:
    """Chunks of at most `size` trials that cover all trials but those done, which are given as ranges by cell.

    The first trials of all cells come first, so that an interrupted sweep has trials in every cell.
    """
    gaps = []
    for cell in range(grid.cells):
        at = 0
        for first, end in (*sorted(done.get(cell, ())), (trials, trials)):
            if first > at:
                gaps.append((cell, at, first))
            at = max(at, end)
    count = sum(-(-(end - first) // size) for _, first, end in gaps)
    if count > CHUNKS:
        raise InvalidInputError(f"chunk: expected a size that makes at most {CHUNKS} chunks, got {size}")
    chunks = [Chunk(cell, at, min(at + size, end)) for cell, first, end in gaps for at in range(first, end, size)]
    chunks.sort(key=lambda chunk: (chunk.first, chunk.cell))
    return chunks


def _values(name: str, given: object, one: Callable[[str, Any], T]) -> tuple[T, ...]:
    """Values along an axis from a single value or several, each converted by `one`."""
    if isinstance(given, str | bytes) or not isinstance(given, Iterable) or getattr(given, "ndim", 1) == 0:
        return (one(name, given),)
    items = list(islice(given, LONGEST + 1))
    if len(items) > LONGEST:
        raise InvalidInputError(f"{name}: expected at most {LONGEST} values, got more")
    if not items:
        raise InvalidInputError(f"{name}: expected at least one value, got none")
    values = tuple(one(f"{name}[{i}]", item) for i, item in enumerate(items))
    if len(set(values)) < len(values):
        twice = next(value for i, value in enumerate(values) if value in values[:i])
        raise InvalidInputError(f"{name}: expected every value once, got {twice!r} again")
    return values
