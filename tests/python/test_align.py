# SPDX-License-Identifier: MIT OR Apache-2.0
"""Similarities."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bearslam
from bearslam.data.align import wrap

angle = st.floats(-np.pi, np.pi)
length = st.floats(-100, 100)


def test_the_best_similarity_is_the_reference(own):
    for record in own["align"]:
        found = bearslam.align(record["source"], record["target"])
        assert found.scale == pytest.approx(record["scale"], rel=1e-12)
        assert wrap(np.array(found.angle - record["angle"])) == pytest.approx(0.0, abs=1e-12)
        np.testing.assert_allclose(found.translation, record["translation"], atol=1e-10)


@given(st.floats(0.01, 100), angle, length, length)
def test_a_similarity_is_found_again(scale, turn, x, y):
    known = bearslam.Similarity(scale, turn, np.array([x, y]))
    points = np.array([[0.0, 0.0], [1.0, 0.2], [-0.4, 2.0]])
    found = bearslam.align(points, known.apply(points))
    # Rounding of a translation of 100 against a scale of 0.01 costs four digits.
    np.testing.assert_allclose(found.apply(points), known.apply(points), atol=1e-10)
    assert found.scale == pytest.approx(scale, rel=1e-9)


@given(st.floats(-math.tau, math.tau))
def test_headings_stay_in_range(theta):
    turned = bearslam.Similarity(1.0, theta, np.zeros(2)).apply_poses([[0.0, 0.0, theta]])[0, 2]
    assert -np.pi < turned <= np.pi
    assert np.exp(1j * turned) == pytest.approx(np.exp(2j * theta), abs=1e-10)


def test_pi_is_plus_pi():
    assert wrap(np.array([-np.pi, np.pi, 3 * np.pi])).tolist() == [np.pi, np.pi, np.pi]


def test_what_is_unknown_stays_unknown():
    moved = bearslam.Similarity(2.0, 1.0, np.ones(2)).apply_poses([[np.nan, np.nan, np.nan], [0.0, 0.0, 0.0]])
    assert np.isnan(moved[0]).all()
    np.testing.assert_allclose(moved[1], [1.0, 1.0, 1.0])


def test_points_in_one_place_are_degenerate():
    with pytest.raises(bearslam.DegenerateError):
        bearslam.align([[1.0, 1.0], [1.0, 1.0]], [[0.0, 0.0], [1.0, 0.0]])
