# SPDX-License-Identifier: MIT OR Apache-2.0
"""Exceptions and what they carry."""

import copy
import pickle

import numpy as np
import pytest

import bearslam


def test_what_they_are():
    assert issubclass(bearslam.InvalidInputError, (bearslam.BearslamError, ValueError))
    assert issubclass(bearslam.DegenerateError, bearslam.BearslamError)
    assert issubclass(bearslam.DegenerateError, ArithmeticError)


@pytest.mark.parametrize("twin", [copy.copy, lambda error: pickle.loads(pickle.dumps(error))])
def test_a_degenerate_error_survives_the_way_between_processes(twin):
    error = bearslam.DegenerateError("no map", kind="parallel_rays", value=1.5, bound=2.0)
    error.add_note("seen in trial 3")
    again = twin(error)
    assert type(again) is bearslam.DegenerateError
    assert str(again) == "no map"
    assert (again.kind, again.value, again.bound) == ("parallel_rays", 1.5, 2.0)
    assert again.__notes__ == ["seen in trial 3"]


@pytest.mark.parametrize(
    ("call", "kind", "advice"),
    [
        (
            lambda: bearslam.refine(np.eye(3, 4), (np.zeros((3, 3)), np.zeros((4, 2)))),
            "coincident_start",
            "different places",
        ),
        (
            lambda: bearslam.align([[1, 2]] * 3, [[0, 0], [1, 0], [0, 1]]),
            "uncorrelated_points",
            "in at least two places",
        ),
        (lambda: bearslam.resect([[1, 2]] * 3, [0.1, 0.2, 0.3]), "coincident_landmarks", "landmarks in other places"),
        (lambda: bearslam.three_view([[0.1, 0.5, 0.9, 1.3, 1.7]] * 3), "three_view_system", "common line or circle"),
    ],
)
def test_the_kind_is_for_programs_and_the_advice_fits_it(call, kind, advice):
    with pytest.raises(bearslam.DegenerateError) as caught:
        call()
    error = caught.value
    assert error.kind == kind
    assert not error.value > error.bound
    assert advice in str(error)
