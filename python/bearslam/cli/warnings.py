# SPDX-License-Identifier: MIT OR Apache-2.0
"""Warnings of the command line: reasons not to trust a map."""

from __future__ import annotations

import math

from bearslam.cli.report import percent
from bearslam.data.estimate import Estimate, outliers

__all__ = ["residuals_over_sigma", "warnings"]

LARGE = 3.0
"""Ratio of residuals to standard deviations above which the map is suspected to be wrong."""
MANY = 1 / 3
"""Share of outliers above which a robust map is no longer to be trusted."""
DOUBTFUL = 0.2
"""Uncertainty of a map, as a share of its size, above which it is no longer to be trusted."""


def warnings(result: Estimate, *, robust: bool) -> list[str]:
    """Reasons not to trust a map."""
    found = []
    if not result.converged:
        found.append(f"not converged ({result.termination.replace('_', ' ')})")
    large = residuals_over_sigma(result)
    if large > LARGE:
        found.append(
            f"residuals are {large:.3g} times as large as their standard deviations: wrong bearings"
            f"{'' if robust else ' (try --robust)'}, wrong odometry, a wrong minimum, or too small a sigma"
        )
    wrong = outliers(result).mean()
    if robust and wrong > MANY:
        found.append(f"{percent(wrong)} of the bearings are outliers; --robust tolerates a third")
    if result.uncertainty > DOUBTFUL:
        found.append(
            "the bearings hardly determine this map: residuals as large as these leave it uncertain by "
            f"{percent(result.uncertainty)} of its size; add sightings of other landmarks or from other places"
        )
    return found


def residuals_over_sigma(result: Estimate) -> float:
    """Ratio of the residuals to what their standard deviations predict, outliers apart.

    NaN without degrees of freedom to judge by, or without standard deviations.
    """
    sigma = result.sightings.sigma
    if sigma is None or (sigma == 1.0).all():
        return math.nan
    wrong = int(outliers(result).sum())
    # An outlier contributes the square of three standard deviations.
    squares = 2.0 * result.cost - 9.0 * wrong
    return math.sqrt(max(squares, 0.0) / result.freedom) if result.freedom > 0 else math.nan
