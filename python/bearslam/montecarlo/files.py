# SPDX-License-Identifier: MIT OR Apache-2.0
"""Sweeps in files: as a NumPy archive, which can be read back, and as CSV for other programs."""

from __future__ import annotations

import io
import math
import os
import zipfile
import zlib
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from bearslam.data.checks import IntArray
from bearslam.errors import InvalidInputError
from bearslam.io.atomic import replacing
from bearslam.io.bounded import LARGEST_FILE, read_bounded
from bearslam.io.endings import ending_of
from bearslam.montecarlo.grid import Grid
from bearslam.montecarlo.result import Result
from bearslam.montecarlo.table import coordinates, statistics
from bearslam.montecarlo.tally import COUNTS, HIGHEST, LOWEST, QUANTITIES, Tally, key

__all__ = ["READABLE", "RESULTS", "load", "save"]

RESULTS = (".npz", ".csv")
"""Endings of the files that sweeps are written to."""
READABLE = (".npz",)
"""Endings of the files that sweeps are read from."""

TITLE = "# bearslam sweep 1"
"""The first line of a CSV file."""
BINS = tuple(f"{quantity}_bins" for quantity in QUANTITIES)
"""Columns of histograms in a CSV file: the filled bins, as bin:size."""
FORMAT = "bearslam sweep 1"
ENTRIES = {
    "format": ("U", 0),
    "single": ("b", 0),
    "layout": ("U", 1),
    "noise": ("f", 1),
    "views": ("i", 1),
    "landmarks": ("i", 1),
    "start": ("U", 1),
    "trials": ("i", 0),
    "seeds": ("u", 1),
    "counts": ("i", 6),
    "bins": ("i", 2),
}
"""What is in the file: kind of the numbers, and dimensions."""


def save(result: Result, path: str | os.PathLike[str]) -> None:
    """See `SweepResult.save`."""
    write = _write_csv if ending_of(path, RESULTS) == ".csv" else _write_npz
    with replacing(path) as file:
        write(result, file)


def load(path: str | os.PathLike[str]) -> Result:
    """See `SweepResult.load`."""
    ending_of(path, READABLE)
    with open(path, "rb") as file:
        return _read(file, os.fspath(path))


def _write_npz(result: Result, file: BinaryIO) -> None:
    """Write everything; the same result gives the same bytes."""
    grid = result.grid
    np.savez_compressed(
        file,
        format=np.array(FORMAT),
        single=np.array(grid.single),
        layout=np.array(grid.layout),
        noise=result.noise,
        views=result.views,
        landmarks=result.landmarks,
        start=np.array(grid.start),
        trials=np.array(result.trials),
        seeds=np.array(result.seeds, dtype=np.uint64),
        counts=result.tally.counts.reshape(*grid.shape, len(grid.start), len(COUNTS)),
        bins=result.tally.bins(),
    )


def _read(file: BinaryIO, name: str) -> Result:
    """The result in a file of that name."""
    entries = _entries(read_bounded(file, name, text=False), name)
    if str(entries["format"]) != FORMAT:
        raise InvalidInputError(f"{name}: expected the format {FORMAT!r}, got {str(entries['format'])!r}")
    layouts = entries["layout"].tolist()
    single = bool(entries["single"])
    if single and len(layouts) != 1:
        raise InvalidInputError(f"{name}: expected one layout, got {len(layouts)}")
    try:
        grid = Grid.of(
            layouts[0] if single else layouts,
            entries["views"],
            entries["landmarks"],
            entries["noise"],
            entries["start"].tolist(),
        )
    except InvalidInputError as error:
        raise InvalidInputError(f"{name}: {error}") from None
    shape = (*grid.shape, len(grid.start), len(COUNTS))
    if entries["counts"].shape != shape:
        raise InvalidInputError(f"{name}: expected counts of shape {shape}, got {entries['counts'].shape}")
    counts = entries["counts"].reshape(-1, len(COUNTS)).astype(np.int64)
    trials, seeds = int(entries["trials"]), tuple(entries["seeds"].tolist())
    done = counts[:, 0].reshape(grid.cells, -1)
    if trials < 1 or not seeds or len(set(seeds)) < len(seeds) or (done > trials).any() or (done != done[:, :1]).any():
        raise InvalidInputError(f"{name}: expected seeds, and as many trials from each start, {trials} at most")
    tally = _tally(counts, entries["bins"].astype(np.int64), name)
    flaw = tally.flaw()
    if flaw is not None:
        raise InvalidInputError(f"{name}: {flaw[1]} in group {flaw[0]}")
    return Result(grid, trials, seeds, tally)


def _entries(data: bytes, name: str) -> dict[str, NDArray[Any]]:
    try:
        with np.lib.npyio.NpzFile(io.BytesIO(data), allow_pickle=False) as archive:
            for entry in ENTRIES:
                _check_size(archive, entry, name)
            entries = {entry: archive[entry] for entry in ENTRIES}
    except InvalidInputError:
        raise
    except KeyError as error:
        raise InvalidInputError(f"{name}: expected the result of a sweep: {error.args[0]}") from None
    except (
        AttributeError,
        EOFError,
        MemoryError,
        NotImplementedError,
        OSError,
        RuntimeError,
        ValueError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        raise InvalidInputError(f"{name}: expected a file that save has written: {error}") from None
    for entry, (kind, dimensions) in ENTRIES.items():
        array = entries[entry]
        if array.dtype.kind != kind or array.ndim != dimensions:
            raise InvalidInputError(
                f"{name}: expected {entry} of kind {kind!r} and {dimensions} dimensions, "
                f"got {array.dtype.kind!r} and {array.ndim}"
            )
    return entries


def _check_size(archive: np.lib.npyio.NpzFile, entry: str, name: str) -> None:
    """Refuse an array that is larger than a file may be, or than what follows its header, before memory is taken."""
    assert archive.zip is not None
    member = f"{entry}.npy"
    if member not in archive.zip.namelist():
        return  # which reading it tells
    with archive.zip.open(member) as file:
        version = np.lib.format.read_magic(file)
        header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, kind = header(file)
        size = math.prod(shape) * kind.itemsize
        follows = archive.zip.getinfo(member).file_size - file.tell()
    if size > min(follows, LARGEST_FILE):
        raise InvalidInputError(
            f"{name}: expected {entry} of at most {min(follows, LARGEST_FILE)} bytes, got one that declares {size}"
        )


def _tally(counts: IntArray, bins: IntArray, name: str) -> Tally:
    limits = np.array([[0, len(counts) - 1], [0, len(QUANTITIES) - 1], [LOWEST, HIGHEST], [1, 2**62]])
    if bins.shape[1] != 4 or (bins < limits[:, 0]).any() or (bins > limits[:, 1]).any():
        raise InvalidInputError(f"{name}: expected rows of group, quantity, bin and size as bins, got others")
    group, quantity, place, size = bins.T
    keys = key(group, quantity, place)
    if (np.diff(keys) <= 0).any():
        raise InvalidInputError(f"{name}: expected ascending bins, got others")
    return Tally(counts, keys, size.copy())


def _write_csv(result: Result, file: BinaryIO) -> None:
    """Write comments that state what was requested, then a row for each cell and start.

    The same result gives the same bytes.
    """
    grid = result.grid
    asked = {
        "layout" if grid.single else "layouts": grid.layout,
        "noise": map(repr, grid.noise),
        "views": map(str, grid.views),
        "landmarks": map(str, grid.landmarks),
        "starts": grid.start,
        "trials": [str(result.trials)],
        "seeds": map(str, result.seeds),
    }
    lines = [TITLE, *(f"# {name}: {' '.join(values)}" for name, values in asked.items())]
    columns: dict[str, list[Any]] = coordinates(result)
    columns |= {name: values.tolist() for name, values in statistics(result).items()}
    columns |= {name: result.tally.counts[:, index].tolist() for index, name in enumerate(COUNTS)}
    columns |= dict(zip(BINS, _histograms(result.tally), strict=True))
    lines.append(",".join(columns))
    lines += [",".join(map(str, row)) for row in zip(*columns.values(), strict=True)]
    file.write(("\n".join(lines) + "\n").encode())


def _histograms(tally: Tally) -> list[list[str]]:
    """For every quantity the filled bins of every group, as bin:size."""
    texts: list[list[list[str]]] = [[[] for _ in range(tally.groups)] for _ in QUANTITIES]
    for group, quantity, place, size in tally.bins().tolist():
        texts[quantity][group].append(f"{place}:{size}")
    return [[" ".join(words) for words in column] for column in texts]
