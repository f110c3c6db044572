# SPDX-License-Identifier: MIT OR Apache-2.0
"""How things look in pictures of maps: colours, markers, and how they shrink where there are many."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = [
    "ESTIMATE",
    "HEAVY",
    "LINEAR",
    "PAPER",
    "RAY",
    "ROBOTS",
    "TRUTH",
    "WRONG",
    "Style",
    "colors",
    "shrunk",
]


@dataclass(frozen=True)
class Style:
    """How one map among several is drawn."""

    color: str
    marker: str
    size: float
    filled: bool
    zorder: float

    @property
    def face(self) -> str:
        """Of its symbols."""
        return self.color if self.filled else "none"


# The colours are those of Okabe and Ito, which every kind of colour vision tells apart; shape and filling tell the maps
# apart in black and white.
TRUTH = Style("#404040", "s", 8.0, filled=False, zorder=3.0)
PAPER = Style("#d55e00", "D", 5.0, filled=False, zorder=3.2)
LINEAR = Style("#009e73", "P", 5.5, filled=True, zorder=3.3)
ESTIMATE = Style("#0072b2", "o", 4.0, filled=True, zorder=3.4)
RAY = "#56b4e9"
WRONG = "#cc79a7"
ROBOTS = ("#0072b2", "#d55e00", "#009e73", "#56b4e9", "#cc79a7", "#f0e442")
"""Of robots that are told apart. Of those colours, orange is for ellipses and black for what all robots have seen."""
HEAVY = 500
"""Things of a kind from which on they are drawn as pixels, in SVG and PDF as well: a vector each would make a file that
takes long to open."""


def colors(count: int, style: Style) -> tuple[str, ...]:
    """Of so many robots: one each if there are several, and not too many to be told apart."""
    return ROBOTS[:count] if 1 < count <= len(ROBOTS) else (style.color,) * count


def shrunk(number: int, few: int, least: float) -> float:
    """Factor for the size of so many things: 1 as long as they are few, and never less than the least."""
    return float(max(min(1.0, (few / max(number, 1)) ** 0.5), least))
