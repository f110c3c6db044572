# SPDX-License-Identifier: MIT OR Apache-2.0
"""The result of a sweep, which can also save, load, tabulate and plot itself."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Self

from bearslam.data.checks import choice
from bearslam.montecarlo import files, table
from bearslam.montecarlo.result import Result

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["SweepResult"]


@dataclass(frozen=True, eq=False, repr=False)
class SweepResult(Result):
    """Failures, errors, iterations and time of every start in every cell of a sweep.

    A cell is one combination of layout, noise, views and landmarks. A statistic is a dict from start to an array of
    shape (noise, views, landmarks), or (layout, noise, views, landmarks) if the layouts of the sweep were given as a
    sequence. It is NaN in cells without trials.

    Attributes
    ----------
    grid, trials, seeds, tally
        The cells and starts, the number of trials per cell, the seeds, and the counts.

    See Also
    --------
    bearslam.montecarlo.result.Result : the same attributes with their types, and what follows from them.

    Examples
    --------
    >>> import numpy as np
    >>> from bearslam import sweep
    >>> result = sweep("mixed", views=[4, 6], landmarks=[7, 9], noise=np.radians([0.5, 1]), trials=20)
    >>> result
    <SweepResult: 1 layout, 2 noises, 2 views, 2 landmarks, 3 starts; 160 of 160 scenes>
    >>> result.failure_rate["solve"].shape
    (2, 2, 2)
    >>> result.total("random").failures > result.total("solve").failures
    True
    """

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the sweep to a file: arrays that `load` reads to `.npz`, a row for each cell and start to `.csv`.

        An existing file is replaced in one step and never left half written.

        Raises
        ------
        InvalidInputError
            If the name has another ending.
        OSError
            If the file cannot be written.
        """
        files.save(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a `.npz` file that `save` has written.

        Parameters
        ----------
        path : str or path
            Ends in `.npz`.

        Returns
        -------
        SweepResult
            The sweep that was saved, bit by bit.

        Raises
        ------
        InvalidInputError
            If the name has another ending, or the file is damaged or not the result of a sweep.
        OSError
            If the file cannot be read.
        """
        found = files.load(path)
        return cls(found.grid, found.trials, found.seeds, found.tally)

    def to_pandas(self) -> pd.DataFrame:
        """A table of the statistics with a row for each cell and start.

        Returns
        -------
        pandas.DataFrame
            Layout, noise, views, landmarks and start, then the statistics. Angles are in radians, in `_deg` columns in
            degrees.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        return table.to_pandas(self)

    def to_xarray(self) -> xr.Dataset:
        """The statistics over layout, noise, views, landmarks and start.

        Returns
        -------
        xarray.Dataset
            Always with these five dimensions.

        Raises
        ------
        ImportError
            If xarray is not installed.
        """
        return table.to_xarray(self)

    def plot(self, kind: Literal["failures", "errors"] = "failures", **options: Any) -> Figure:
        """Draw the sweep.

        Parameters
        ----------
        kind : {"failures", "errors"}
            "failures": failure rates as heat maps over views and landmarks, a column for each start, a row for each
            noise and layout. "errors": errors against noise, and their ratio to the Cramer-Rao bound.
        **options
            Options of `bearslam.montecarlo.plot.draw_failures` or `bearslam.montecarlo.plot.draw_errors`.

        Returns
        -------
        matplotlib.figure.Figure
            The figure.

        Raises
        ------
        ImportError
            If matplotlib is not installed (``pip install "bearslam[plot]"``).
        InvalidInputError
            If an option is out of range.
        """
        from bearslam.montecarlo.plot import draw_errors, draw_failures

        if choice("kind", kind, ("failures", "errors")) == "failures":
            return draw_failures(self, **options)
        return draw_errors(self, **options)
