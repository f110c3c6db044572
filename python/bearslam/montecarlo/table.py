# SPDX-License-Identifier: MIT OR Apache-2.0
"""The result of a sweep as a table: for people, pandas and xarray."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bearslam.montecarlo.result import Result
from bearslam.montecarlo.tally import COUNTS, FAILURES, ITERATIONS, NANOSECONDS, QUANTITIES

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


__all__ = ["coordinates", "statistics", "to_pandas", "to_xarray"]


def coordinates(result: Result) -> dict[str, list[Any]]:
    """Coordinates of every group of trials: columns of layout, noise [rad], noise_deg, views, landmarks and start."""
    cells = [result.grid.cell(index) for index in range(result.grid.cells)]
    rows = [(*cell, start) for cell in cells for start in result.start]
    layout, noise, views, landmarks, start = (list(column) for column in zip(*rows, strict=True))
    return {
        "layout": layout,
        "noise": noise,
        "noise_deg": [degrees(value) for value in noise],
        "views": views,
        "landmarks": landmarks,
        "start": start,
    }


def statistics(result: Result) -> dict[str, NDArray[Any]]:
    """Statistics of every group of trials."""
    tally = result.tally
    counts = dict(zip(COUNTS, tally.counts.T, strict=True))
    low, high = tally.failure_interval(0.95).T
    position, heading, position_ratio, heading_ratio = range(len(QUANTITIES))
    return {
        "trials": counts["trials"],
        "failures": counts["failures"],
        "failure_rate": tally.share(FAILURES),
        "failure_low": low,
        "failure_high": high,
        "without_map": counts["without_map"],
        "incomplete": counts["incomplete"],
        "position_median": tally.quantile(position, 0.5),
        "position_p90": tally.quantile(position, 0.9),
        "heading_median": tally.quantile(heading, 0.5),
        "heading_p90": tally.quantile(heading, 0.9),
        "position_ratio": tally.root_mean_square(position_ratio),
        "heading_ratio": tally.root_mean_square(heading_ratio),
        "mean_iterations": tally.share(ITERATIONS),
        "mean_seconds": tally.share(NANOSECONDS) * 1e-9,
    }


def degrees(radians: float) -> float:
    """Degrees without rounding errors of the conversion: 0.5 rather than 0.49999999999999994."""
    return float(f"{math.degrees(radians):.14g}")


def to_pandas(result: Result) -> pd.DataFrame:
    """See `SweepResult.to_pandas`."""
    try:
        import pandas as pd
    except ImportError:
        raise ImportError("tables need pandas: pip install pandas") from None
    return pd.DataFrame({**coordinates(result), **statistics(result)})


def to_xarray(result: Result) -> xr.Dataset:
    """See `SweepResult.to_xarray`."""
    try:
        import xarray as xr
    except ImportError:
        raise ImportError("labelled arrays need xarray: pip install xarray") from None
    grid = result.grid
    dimensions = ("layout", "noise", "views", "landmarks", "start")
    shape = (*grid.shape, len(grid.start))
    return xr.Dataset(
        {name: (dimensions, values.reshape(shape).copy()) for name, values in statistics(result).items()},
        coords={
            "layout": np.array(grid.layout),
            "noise": ("noise", result.noise, {"units": "rad"}),
            "noise_deg": ("noise", np.array([degrees(value) for value in grid.noise]), {"units": "deg"}),
            "views": result.views,
            "landmarks": result.landmarks,
            "start": np.array(grid.start),
        },
        attrs={"trials": result.trials, "seeds": [str(seed) for seed in result.seeds]},
    )
