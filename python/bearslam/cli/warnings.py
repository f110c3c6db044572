# SPDX-License-Identifier: MIT OR Apache-2.0
"""Warnings of the command line: reasons not to trust a map."""

from __future__ import annotations

import math

from bearslam.cli.report import name, percent
from bearslam.data.doubts import doubts
from bearslam.data.estimate import outliers
from bearslam.data.fix import DOUBTFUL
from bearslam.errors import BearslamError
from bearslam.reconstruction import Reconstruction

__all__ = ["warnings"]

MANY = 1 / 3
"""Share of outliers above which a robust map is no longer to be trusted."""
ROUGH = 0.1
"""Expected error of the landmarks up to which no more than the worst view or landmark is doubtful then."""


def warnings(result: Reconstruction, *, robust: bool) -> list[str]:
    """Reasons not to trust a map."""
    found = [message for _, message in doubts(result)]
    wrong = outliers(result).mean()
    if robust and wrong > MANY:
        found.append(f"{percent(wrong)} of the bearings are outliers; --robust tolerates a third")
    if result.uncertainty > DOUBTFUL and result.worst is not None and (known := _expected_error(result)) < ROUGH:
        worst = name(result, *result.worst)
        found.append(
            f"{worst} is badly held: residuals as large as these leave it uncertain by {percent(result.uncertainty)} "
            f"of the size of the map, but the landmarks by {percent(known)} on average; add sightings to it"
        )
    elif result.uncertainty > DOUBTFUL:
        found.append(
            "the bearings hardly determine this map: residuals as large as these leave it uncertain by "
            f"{percent(result.uncertainty)} of its size; add sightings of other landmarks or from other places"
        )
    return found


def _expected_error(result: Reconstruction) -> float:
    try:
        return result.expected_error
    except (BearslamError, MemoryError):
        return math.inf
