# SPDX-License-Identifier: MIT OR Apache-2.0
"""A file that records the finished chunks of a sweep, so that nothing is lost if the process dies."""

from __future__ import annotations

import errno
import os
import sqlite3
import threading
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from bearslam._core import __version__
from bearslam.data.checks import IntArray, quote
from bearslam.errors import InvalidInputError
from bearslam.montecarlo.grid import Chunk, Grid
from bearslam.montecarlo.tally import COUNTS, HIGHEST, LOWEST, QUANTITIES

__all__ = ["Checkpoint"]

APPLICATION = 0x62656172
"""Mark of the file: "bear"."""
FORMAT = 1
PAUSE = 0.5
"""Time between two commits [s]: the most that is lost if the process is killed."""
SYSTEM = {
    "SQLITE_FULL": errno.ENOSPC,
    "SQLITE_READONLY": errno.EACCES,
    "SQLITE_PERM": errno.EACCES,
    "SQLITE_CANTOPEN": errno.EACCES,
    "SQLITE_IOERR": errno.EIO,
}
"""Errors of the file system rather than of the file."""
TABLES = """
CREATE TABLE design (name TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE chunk (
    cell INTEGER NOT NULL, first INTEGER NOT NULL, "end" INTEGER NOT NULL, tally BLOB NOT NULL,
    PRIMARY KEY (cell, first)
) WITHOUT ROWID;
"""


class Checkpoint:
    """Finished chunks in an SQLite file, committed by a thread of its own and at the end of the block.

    Parameters
    ----------
    path : str or path
        The file; it is created if it does not exist.
    grid : Grid
        The grid of the sweep.
    seed : int
        The seed of the sweep.

    Raises
    ------
    InvalidInputError
        If the file belongs to another sweep, is in use, is damaged, or is not a checkpoint.
    OSError
        If it cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str], grid: Grid, seed: int) -> None:
        self._path = os.fspath(path)
        self._grid = grid
        self._seed = seed
        self._waiting: dict[tuple[int, int], tuple[int, int, int, bytes]] = {}
        self._access = threading.Lock()
        self._over = threading.Event()
        self._failure: Exception | None = None
        self._writer: threading.Thread | None = None
        folder = Path(self._path).parent
        if not folder.is_dir():
            raise InvalidInputError(f"checkpoint: there is no folder {str(folder)!r}")
        if Path(self._path).is_dir():
            raise InvalidInputError(f"checkpoint: expected a file, got the folder {self._path!r}")
        try:
            # Autocommit: transactions are begun and committed explicitly.
            self._file = sqlite3.connect(self._path, timeout=0.5, isolation_level=None, check_same_thread=False)
        except sqlite3.Error as error:
            raise self._error(error) from None
        try:
            self._open()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        if self._writer is not None:
            self._writer.join()
        try:
            self._commit()
        finally:
            self._file.close()

    def chunks(self) -> Iterator[tuple[Chunk, IntArray, IntArray]]:
        """Recorded chunks with their counts and bins."""
        end_before: tuple[int, int] = (-1, 0)
        try:
            for cell, first, end, blob in self._file.execute(
                'SELECT cell, first, "end", tally FROM chunk ORDER BY cell, first'
            ):
                if not (0 <= cell < self._grid.cells and 0 <= first < end and end_before <= (cell, first)):
                    raise self._damaged(f"a chunk from {first} to {end} in cell {cell}")
                end_before = cell, end
                yield Chunk(cell, first, end), *self._unpacked(blob, end - first)
        except sqlite3.Error as error:
            raise self._error(error) from None
        except (TypeError, UnicodeDecodeError) as error:  # text instead of a number
            raise self._damaged(error) from None

    def add(self, chunk: Chunk, counts: IntArray, bins: IntArray) -> None:
        """Record a chunk, at the next commit."""
        if self._failure is not None:
            raise self._failure
        self._waiting[chunk.cell, chunk.first] = (*chunk, _packed(counts, bins))
        if self._writer is None:
            writer = threading.Thread(target=self._write, name="bearslam-checkpoint", daemon=True)
            writer.start()
            self._writer = writer

    def _write(self) -> None:
        while not self._over.wait(PAUSE):
            try:
                self._commit()
            except (OSError, InvalidInputError) as error:
                self._failure = error
                return

    def _commit(self) -> None:
        with self._access:
            rows = list(self._waiting.copy().values())
            if not rows:
                return
            try:
                self._file.execute("BEGIN IMMEDIATE")
                self._file.executemany("INSERT OR REPLACE INTO chunk VALUES (?, ?, ?, ?)", rows)
                self._file.execute("COMMIT")
            except sqlite3.Error as error:
                with suppress(sqlite3.Error):
                    self._file.execute("ROLLBACK")
                raise self._error(error) from None
            for cell, first, _, _ in rows:
                self._waiting.pop((cell, first), None)

    def _open(self) -> None:
        design = self._design()
        try:
            # The file is locked until the sweep ends.
            self._file.execute("PRAGMA locking_mode = EXCLUSIVE")
            self._file.execute("BEGIN EXCLUSIVE")
            ((tables,),) = self._file.execute("SELECT count(*) FROM sqlite_schema")
            if tables == 0:
                self._file.execute(f"PRAGMA application_id = {APPLICATION}")
                self._file.execute(f"PRAGMA user_version = {FORMAT}")
                for statement in TABLES.split(";"):
                    self._file.execute(statement)
                self._file.executemany("INSERT INTO design VALUES (?, ?)", design.items())
            self._file.execute("COMMIT")
            ((application,),) = self._file.execute("PRAGMA application_id")
            ((version,),) = self._file.execute("PRAGMA user_version")
            if application != APPLICATION:
                raise self._foreign()
            if version != FORMAT:
                raise InvalidInputError(f"checkpoint: {self._path}: expected format {FORMAT}, got {version}")
            ((verdict,),) = self._file.execute("PRAGMA quick_check(1)")
            if verdict != "ok":
                raise self._damaged(verdict)
            found = dict(self._file.execute("SELECT name, value FROM design"))
        except sqlite3.Error as error:
            raise self._error(error) from None
        except UnicodeDecodeError as error:  # in a message of SQLite
            raise self._damaged(error) from None
        for name, wanted in design.items():
            if found.get(name) != wanted:
                raise InvalidInputError(
                    f"checkpoint: {self._path} belongs to another sweep: {name} {quote(found.get(name))} instead of "
                    f"{quote(wanted)}"
                )

    def _design(self) -> dict[str, str]:
        """What must agree for chunks to belong to the same sweep."""
        grid = self._grid
        return {
            "bearslam": __version__,
            "layout": " ".join(grid.layout),
            "noise": " ".join(map(repr, grid.noise)),
            "views": " ".join(map(str, grid.views)),
            "landmarks": " ".join(map(str, grid.landmarks)),
            "starts": " ".join(grid.start),
            "seed": str(self._seed),
        }

    def _unpacked(self, blob: bytes, trials: int) -> tuple[IntArray, IntArray]:
        starts = len(self._grid.start)
        try:
            numbers = np.frombuffer(zlib.decompress(blob), dtype="<i8").astype(np.int64)
            counts = numbers[: starts * len(COUNTS)].reshape(starts, len(COUNTS))
            bins = numbers[starts * len(COUNTS) :].reshape(4, -1).cumsum(axis=1).T
        except (zlib.error, ValueError, TypeError) as error:
            raise self._damaged(error) from None
        limits = np.array([[0, starts - 1], [0, len(QUANTITIES) - 1], [LOWEST, HIGHEST], [1, trials]])
        if (counts[:, 0] != trials).any() or (bins < limits[:, 0]).any() or (bins > limits[:, 1]).any():
            raise self._damaged("a chunk with implausible counts")
        return counts, bins

    def _error(self, error: sqlite3.Error) -> OSError | InvalidInputError:
        """An error of SQLite as one of ours."""
        name = getattr(error, "sqlite_errorname", "")
        if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
            return InvalidInputError(f"checkpoint: {self._path} is in use by another sweep")
        if name == "SQLITE_NOTADB":
            return self._foreign()
        for start, number in SYSTEM.items():
            if name.startswith(start):
                return OSError(number, str(error), self._path)
        return self._damaged(error)

    def _foreign(self) -> InvalidInputError:
        return InvalidInputError(f"checkpoint: {self._path}: expected a checkpoint of a sweep, got another file")

    def _damaged(self, what: object) -> InvalidInputError:
        return InvalidInputError(f"checkpoint: {self._path} is damaged: {what}; delete it to begin anew")


def _packed(counts: IntArray, bins: IntArray) -> bytes:
    """Counts, and the bins as differences, which compress well."""
    differences = np.diff(bins, axis=0, prepend=0).T
    return zlib.compress(np.concatenate([counts.ravel(), differences.ravel()]).astype("<i8").tobytes())
