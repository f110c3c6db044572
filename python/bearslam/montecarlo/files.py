# SPDX-License-Identifier: MIT OR Apache-2.0
"""Files that hold the result of a sweep: arrays or text."""

from __future__ import annotations

import os

from bearslam.io.atomic import replacing
from bearslam.io.files import kind
from bearslam.montecarlo import csv_file, npz_file
from bearslam.montecarlo.result import SweepResult

__all__ = ["RESULTS", "load", "save"]

RESULTS = (".npz", ".csv")
"""Endings of the files that hold results of sweeps."""


def save(result: SweepResult, path: str | os.PathLike[str]) -> None:
    """See `SweepResult.save`."""
    write = csv_file.write if kind(path, RESULTS) == ".csv" else npz_file.write
    with replacing(path) as file:
        write(result, file)


def load(path: str | os.PathLike[str]) -> SweepResult:
    """See `SweepResult.load`."""
    read = csv_file.read if kind(path, RESULTS) == ".csv" else npz_file.read
    with open(path, "rb") as file:
        return read(file, os.fspath(path))
