# SPDX-License-Identifier: MIT OR Apache-2.0
"""Exceptions and what they carry."""

import copy
import pickle

import pytest

import bearslam


def test_what_they_are():
    assert issubclass(bearslam.InvalidInputError, (bearslam.BearslamError, ValueError))
    assert issubclass(bearslam.DegenerateError, bearslam.BearslamError)
    assert issubclass(bearslam.DegenerateError, ArithmeticError)


@pytest.mark.parametrize("twin", [copy.copy, lambda error: pickle.loads(pickle.dumps(error))])
def test_a_degenerate_error_survives_the_way_between_processes(twin):
    error = bearslam.DegenerateError("no map", quantity="gap", value=1.5, bound=2.0)
    error.add_note("seen in trial 3")
    again = twin(error)
    assert type(again) is bearslam.DegenerateError
    assert str(again) == "no map"
    assert (again.quantity, again.value, again.bound) == ("gap", 1.5, 2.0)
    assert again.__notes__ == ["seen in trial 3"]
