# SPDX-License-Identifier: MIT OR Apache-2.0
"""Endings of file names: the format each stands for, and those that can be written."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, TypeAlias, get_args

from bearslam.errors import InvalidInputError

__all__ = ["ENDINGS", "FORMATS", "MAPS", "PROBLEMS", "RESULTS", "TRUTHS", "Format", "ending_of"]

Format: TypeAlias = Literal["csv", "g2o", "graph"]
"""Formats that `load` reads."""
FORMATS: tuple[Format, ...] = get_args(Format)

ENDINGS: dict[str, Format] = {".csv": "csv", ".g2o": "g2o", ".graph": "graph", ".toro": "graph"}
"""Formats by ending. Other files are recognised by their content."""
PROBLEMS = (".csv", ".g2o")
"""Endings of the files that problems are written to."""
MAPS = (".json", ".csv", ".g2o")
"""Endings of the files that hold maps."""
RESULTS = (*MAPS, ".tum")
"""Endings of the files that reconstructions are written to."""
TRUTHS = (".json", ".csv")
"""Endings of the files that hold the truth of a scene."""


def ending_of(path: str | os.PathLike[str], known: Sequence[str]) -> str:
    """The ending of a file name, which must be a known one."""
    suffix = Path(path).suffix.lower()
    if suffix not in known:
        raise InvalidInputError(f"path: expected a name that ends in {' or '.join(known)}, got {os.fspath(path)!r}")
    return suffix
