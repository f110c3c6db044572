# SPDX-License-Identifier: MIT OR Apache-2.0
"""Styles of maps in figures: colours, markers, and how they shrink where there are many."""

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
    """Style of one map among several."""

    color: str
    marker: str
    size: float
    filled: bool
    zorder: float

    @property
    def face(self) -> str:
        """Fill colour of its symbols."""
        return self.color if self.filled else "none"


# Colours by Okabe and Ito, which people with any colour vision can distinguish; markers and fill distinguish the maps
# in black and white.
TRUTH = Style("#404040", "s", 8.0, filled=False, zorder=3.0)
PAPER = Style("#d55e00", "D", 5.0, filled=False, zorder=3.2)
LINEAR = Style("#009e73", "P", 5.5, filled=True, zorder=3.3)
ESTIMATE = Style("#0072b2", "o", 4.0, filled=True, zorder=3.4)
RAY = "#56b4e9"
WRONG = "#cc79a7"
ROBOTS = ("#0072b2", "#d55e00", "#009e73", "#56b4e9", "#cc79a7", "#f0e442")
"""Colours of several robots. Orange of the same palette is for ellipses, black for landmarks."""
HEAVY = 500
"""Number of items of a kind above which they are rasterized, in SVG and PDF as well: as vectors they would make files
that open slowly."""


def colors(count: int, style: Style) -> tuple[str, ...]:
    """Colours of a number of robots: one each if there are several, but not too many to distinguish."""
    return ROBOTS[:count] if 1 < count <= len(ROBOTS) else (style.color,) * count


def shrunk(number: int, few: int, least: float) -> float:
    """Factor for the size of `number` items: 1 up to `few` of them, and never below `least`."""
    return float(max(min(1.0, (few / max(number, 1)) ** 0.5), least))
