# SPDX-License-Identifier: MIT OR Apache-2.0
"""Inputs as JSON: what has failed outlives the generator that made it.

Numbers come back bit for bit. The scene behind an input is not kept.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from .inputs import GENERATOR, Input

FOLDER = Path(__file__).parents[1] / "data/fuzz"
"""One file for each input, `KIND-SEED.json` of the kind of fault that it showed first."""


def write(given: Input, path: Path) -> None:
    """Write an input, with the seed and the generator that it comes from."""
    line = {
        "generator": GENERATOR,
        "seed": given.seed,
        "verb": given.verb,
        "wild": given.wild,
        "arguments": _plain(given.arguments),
    }
    path.write_text(json.dumps(line) + "\n")


def read(path: Path) -> Input:
    """The input of a file."""
    line = json.loads(path.read_text())
    return Input(line["seed"], line["verb"], _value(line["arguments"]), wild=line["wild"])


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return {"array": value.ravel().tolist(), "shape": value.shape, "dtype": str(value.dtype)}
    if isinstance(value, tuple):
        return {"tuple": [_plain(one) for one in value]}
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    return value.item() if isinstance(value, np.generic) else value


def _value(plain: Any) -> Any:
    if not isinstance(plain, dict):
        return plain
    if "array" in plain:
        return np.array(plain["array"], dtype=plain["dtype"]).reshape(plain["shape"])
    if "tuple" in plain:
        return tuple(_value(one) for one in plain["tuple"])
    return {name: _value(one) for name, one in plain.items()}
