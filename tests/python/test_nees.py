# SPDX-License-Identifier: MIT OR Apache-2.0
"""Covariances match the errors: normalised estimation errors squared over 1000 scenes, as in `benches/nees.py`.

The bench also prints the 95 % band, in which one value of twenty is not.
"""

import functools
import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

SCENES = 1000


def load():
    path = Path(__file__).parents[2] / "benches" / "nees.py"
    spec = importlib.util.spec_from_file_location("nees", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules["nees"] = module  # dataclasses look there
    spec.loader.exec_module(module)
    return module


nees = load()
squares = functools.cache(nees.squares)


@pytest.mark.parametrize("case", nees.CASES, ids=str)
def test_errors_are_as_large_as_the_covariances_say(case):
    for name, values in squares(case, SCENES, seed=0).items():
        known = values[np.isfinite(values)]
        assert len(known) > 0.99 * SCENES
        low, high = nees.band(nees.DEGREES[name], len(known), 0.999)
        assert low <= known.mean() <= high, name


def test_covariances_that_are_a_tenth_too_small_would_be_noticed():
    values = squares(nees.CASES[0], SCENES, seed=0)["landmark"] / 0.9
    low, high = nees.band(2, SCENES, 0.999)
    assert not low <= values.mean() <= high
