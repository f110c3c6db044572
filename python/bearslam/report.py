# SPDX-License-Identifier: MIT OR Apache-2.0
"""Results in words, for people: degrees instead of radians."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from bearslam.reconstruction import Reconstruction

__all__ = ["columns", "describe", "listing"]

SHOWN = 20
"""Rows of a listing that are printed; a file has them all."""


def describe(result: Reconstruction) -> str:
    """What was solved, how well, and what was not: a few lines."""
    views, landmarks = len(result.poses), len(result.landmarks)
    lines = [
        f"{views} views, {landmarks} landmarks, {len(result.sightings)} sightings",
        f"residual rms {math.degrees(result.rms):.4g} deg, cost {result.cost:.6g}, "
        f"{'converged' if result.converged else 'not converged'} after {result.iterations} iterations "
        f"({result.termination.replace('_', ' ')})",
    ]
    for one in result.undetermined:
        ids = result.view_ids if one.kind == "view" else result.landmark_ids
        lines.append(f"undetermined: {one.kind} {one.index if ids is None else ids[one.index]}: {one.reason}")
    lines += [
        f"alternative: residual rms {math.degrees(other.rms):.4g} deg, cost {other.cost:.6g}"
        for other in result.alternatives
    ]
    return "\n".join(lines)


def listing(result: Reconstruction) -> str:
    """The map as a table: views, then landmarks."""
    views = result.view_ids or range(len(result.poses))
    landmarks = result.landmark_ids or range(len(result.landmarks))
    degrees = np.column_stack([result.poses[:, :2], np.degrees(result.poses[:, 2])])
    return "\n\n".join(
        (
            _table(("view", "x", "y", "heading [deg]"), views, degrees.tolist()),
            _table(("landmark", "x", "y"), landmarks, result.landmarks.tolist()),
        )
    )


def columns(rows: Iterable[Sequence[str]]) -> str:
    """Rows of text as a table: the first column to the left, the others to the right."""
    table = [tuple(row) for row in rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = []
    for first, *others in table:
        cells = [cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True)]
        lines.append("  ".join([first.ljust(widths[0]), *cells]).rstrip())
    return "\n".join(lines)


def _table(head: Sequence[str], names: Sequence[object], values: Sequence[Sequence[float]]) -> str:
    rows = [(str(name), *(f"{value:.4f}" for value in row)) for name, row in zip(names, values, strict=True)]
    text = columns([head, *rows[:SHOWN]])
    return text if len(rows) <= SHOWN else f"{text}\n... and {len(rows) - SHOWN} more"
