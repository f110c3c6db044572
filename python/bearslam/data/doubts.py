# SPDX-License-Identifier: MIT OR Apache-2.0
"""Reasons to doubt a map, as warnings."""

from __future__ import annotations

from bearslam.data.estimate import Estimate
from bearslam.errors import AmbiguousWarning, BearslamWarning, NotConvergedWarning, PoorFitWarning

__all__ = ["doubts"]


def doubts(result: Estimate) -> list[tuple[type[BearslamWarning], str]]:
    """Reasons to doubt a map and its components, each with the category of its warning."""
    found: list[tuple[type[BearslamWarning], str]] = []
    for one in (result, *result.components):
        if not one.converged:
            ended = one.termination.replace("_", " ")
            found.append((NotConvergedWarning, f"not converged ({ended}): raise max_iterations"))
        found += [(PoorFitWarning, f"{note.message} {note.advice}") for note in one.findings if note.severity != "note"]
    others = len(result.alternatives)
    if others:
        maps = "another map explains" if others == 1 else f"{others} other maps explain"
        found.append(
            (
                AmbiguousWarning,
                f"{maps} the measurements nearly as well (alternatives): add sightings that tell them apart",
            )
        )
    return found
