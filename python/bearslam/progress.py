# SPDX-License-Identifier: MIT OR Apache-2.0
"""Progress of long work: reported to a callback, or shown on a terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Self, TextIO, TypeAlias

__all__ = ["Progress", "ProgressLine", "reporting"]

Progress: TypeAlias = Callable[[str, int, int], object]
"""Called with the stage, the number of steps done and their total number."""


@contextmanager
def reporting(progress: bool | Progress | None, stage: str, done: int, total: int) -> Iterator[Callable[[int], object]]:
    """A function to call with the number of steps done, which passes it on to a callback or shows it as a bar."""
    if callable(progress):
        yield lambda now: progress(stage, now, total)
    elif progress and sys.stderr is not None:
        from tqdm import tqdm

        # With None as `disable` there is no bar where standard error is not a terminal.
        with tqdm(total=total, initial=done, unit=f" {stage}", unit_scale=True, disable=None) as bar:
            yield lambda now: bar.update(now - bar.n)
    else:
        yield lambda now: None


class ProgressLine:
    """Progress as one line that is overwritten, shown once the work has taken longer than `patience` [s].

    Nothing is written if the stream is not a terminal.
    """

    def __init__(self, stream: TextIO | None = None, patience: float = 1.0) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._on = self._stream.isatty()
        self._due = time.monotonic() + patience
        self._width = 0

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show how many steps of a stage are done."""
        now = time.monotonic()
        if not self._on or now < self._due:
            return
        self._due = now + 0.1
        line = f"{stage} {done}/{total}"
        self._stream.write("\r" + line.ljust(self._width))
        self._stream.flush()
        self._width = len(line)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._width:
            self._stream.write("\r" + " " * self._width + "\r")
            self._stream.flush()
