# SPDX-License-Identifier: MIT OR Apache-2.0
"""Warnings of the command line: reasons not to trust a map."""

from __future__ import annotations

from bearslam.cli.report import percent
from bearslam.data.doubts import doubts
from bearslam.data.estimate import Estimate, outliers

__all__ = ["warnings"]

MANY = 1 / 3
"""Share of outliers above which a robust map is no longer to be trusted."""
DOUBTFUL = 0.2
"""Uncertainty of a map, as a share of its size, above which it is no longer to be trusted."""


def warnings(result: Estimate, *, robust: bool) -> list[str]:
    """Reasons not to trust a map."""
    found = [message for _, message in doubts(result)]
    wrong = outliers(result).mean()
    if robust and wrong > MANY:
        found.append(f"{percent(wrong)} of the bearings are outliers; --robust tolerates a third")
    if result.uncertainty > DOUBTFUL:
        found.append(
            "the bearings hardly determine this map: residuals as large as these leave it uncertain by "
            f"{percent(result.uncertainty)} of its size; add sightings of other landmarks or from other places"
        )
    return found
