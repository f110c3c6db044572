# SPDX-License-Identifier: MIT OR Apache-2.0
"""Legends of figures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

try:
    from matplotlib.artist import Artist
    from matplotlib.legend_handler import HandlerTuple
except ImportError:
    raise ImportError('pictures need matplotlib: pip install "bearslam[plot]"') from None

__all__ = ["Entry", "legend"]

Entry: TypeAlias = tuple[Artist | tuple[Artist, ...], str]
"""One or several symbols and their label."""


def legend(entries: Sequence[Entry]) -> dict[str, Any]:
    """Keyword arguments for a legend with these entries."""
    handles, labels = zip(*entries, strict=True)
    return {
        "handles": handles,
        "labels": labels,
        "handler_map": {tuple: HandlerTuple(ndivide=None, pad=0.6)},
        "handlelength": 2.4,
        "frameon": False,
    }
