# SPDX-License-Identifier: MIT OR Apache-2.0
"""A pose from known landmarks."""

import warnings

import numpy as np
import pytest

import bearslam


def test_exact_bearings_give_the_truth(own):
    for record in own["resection"]:
        found = bearslam.resect(record["landmarks"], record["bearings"])
        np.testing.assert_allclose(found, record["pose"], atol=1e-8)


def test_a_landmark_that_was_not_seen_does_not_count(own):
    record = own["resection"][-1]
    landmarks = [*record["landmarks"], [np.nan, np.nan]]
    found = bearslam.resect(landmarks, [*record["bearings"], np.nan])
    np.testing.assert_allclose(found, record["pose"], atol=1e-8)


def test_two_landmarks_are_too_few():
    with pytest.raises(bearslam.InvalidInputError, match="3"):
        bearslam.resect([[0.0, 0.0], [1.0, 0.0], [2.0, 2.0]], [0.0, np.nan, 1.0])


def test_a_circle_through_view_and_landmarks_is_degenerate():
    angles = np.array([0.3, 1.1, 2.6])
    view = np.array([np.cos(4.0), np.sin(4.0)])
    landmarks = np.column_stack([np.cos(angles), np.sin(angles)])
    away = landmarks - view
    with pytest.raises(bearslam.DegenerateError):
        bearslam.resect(landmarks, np.arctan2(away[:, 1], away[:, 0]))


LANDMARKS = np.array([[3.0, 4.0], [-2.0, 1.5], [0.5, -3.0], [5.0, -1.0], [1.0, 6.0]])
POSES = np.array([[0.3, 0.2, 0.4], [1.5, 1.0, -2.0], [-1.0, 2.5, 3.0]])


def bearings_of(poses):
    away = LANDMARKS - poses[:, None, :2]
    return np.arctan2(away[..., 1], away[..., 0]) - poses[:, None, 2]


def test_several_views_at_once():
    table = bearings_of(POSES)
    found = bearslam.resect(LANDMARKS, table)
    np.testing.assert_allclose(found, POSES, atol=1e-12)
    for k in range(3):
        np.testing.assert_array_equal(bearslam.resect(LANDMARKS, table[k]), found[k])


def test_of_several_views_one_that_cannot_be_resected_is_nan():
    table = bearings_of(POSES)
    table[1, 2:] = np.nan
    found = bearslam.resect(LANDMARKS, table)
    assert np.isnan(found[1]).all()
    np.testing.assert_allclose(found[::2], POSES[::2], atol=1e-12)
    with pytest.raises(bearslam.InvalidInputError, match="3"):
        bearslam.resect(LANDMARKS, table[1])


def test_a_landmark_without_position_must_not_be_seen():
    landmarks = LANDMARKS.copy()
    landmarks[3] = np.nan
    table = bearings_of(POSES)
    with pytest.raises(bearslam.InvalidInputError, match=r"landmarks\[3, 0\]"):
        bearslam.resect(landmarks, table)
    table[:, 3] = np.nan
    np.testing.assert_allclose(bearslam.resect(landmarks, table), POSES, atol=1e-12)


def test_details_are_those_of_least_squares():
    sigma = 0.002
    exact = bearings_of(POSES)
    noisy = exact + np.random.default_rng(1).normal(0, sigma, exact.shape)
    fix = bearslam.resect(LANDMARKS, noisy, sigma=sigma, details=True)
    np.testing.assert_array_equal(fix.value, bearslam.resect(LANDMARKS, noisy))
    residuals = np.angle(np.exp(1j * (bearings_of(fix.value) - noisy)))
    np.testing.assert_allclose(fix.rms, np.sqrt((residuals**2).mean(axis=1)), rtol=1e-9)
    np.testing.assert_allclose(fix.sigma0, np.sqrt((residuals**2).sum(axis=1) / 2) / sigma, rtol=1e-9)
    for k, pose in enumerate(fix.value):
        away = LANDMARKS - pose[:2]
        across = np.column_stack([-away[:, 1], away[:, 0]]) / (away**2).sum(axis=1)[:, None]
        jacobian = np.column_stack([-across, -np.ones(len(across))])
        expected = sigma**2 * np.linalg.inv(jacobian.T @ jacobian)
        np.testing.assert_allclose(fix.covariance[k], expected, rtol=1e-9, atol=1e-12 * sigma**2)


def test_details_have_the_shape_of_the_call():
    table = bearings_of(POSES)
    table[1, 2:] = np.nan
    many = bearslam.resect(LANDMARKS, table, details=True)
    assert many.covariance.shape == (3, 3, 3)
    assert all(np.isnan(each[1]).all() for each in (many.value, many.covariance, many.rms, many.sigma0))
    one = bearslam.resect(LANDMARKS, table[0], details=True)
    assert (one.value.shape, one.covariance.shape) == ((3,), (3, 3))
    assert isinstance(one.sigma0, float)
    with pytest.raises(bearslam.InvalidInputError, match="3"):
        bearslam.resect(LANDMARKS, table[1], details=True)
    three = bearslam.resect(LANDMARKS[:3], table[0, :3], details=True)
    assert np.isnan(three.sigma0)


def test_arguments_are_checked():
    for wrong in (np.zeros(4), np.zeros((2, 4)), np.zeros((1, 2, 5))):
        with pytest.raises(bearslam.InvalidInputError, match="bearings"):
            bearslam.resect(LANDMARKS, wrong)
    with pytest.raises(bearslam.InvalidInputError, match="sigma"):
        bearslam.resect(LANDMARKS, bearings_of(POSES), sigma=0.0)


def test_clockwise_bearings_are_refused():
    table = bearings_of(POSES)
    with pytest.raises(bearslam.DegenerateError, match="counter-clockwise") as raised:
        bearslam.resect(LANDMARKS, -table[0])
    assert raised.value.kind == "contradictory_bearings"
    assert raised.value.value > raised.value.bound
    table[1] *= -1
    found = bearslam.resect(LANDMARKS, table, details=True)
    assert np.isnan(found.value[1]).all()
    assert np.isnan(found.uncertainty[1])
    np.testing.assert_allclose(found.value[::2], POSES[::2], atol=1e-12)


def test_a_poor_fit_and_a_danger_circle_come_with_warnings():
    table = bearings_of(POSES)
    table[1, 2] += 0.15
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bearslam.resect(LANDMARKS, table)
        bearslam.resect(LANDMARKS, table, sigma=0.1)
    with pytest.warns(bearslam.PoorFitWarning, match="1 of 3 views, worst view 1: the residuals are"):
        bearslam.resect(LANDMARKS, table, sigma=0.01)
    # A circle of radius 1 through four landmarks, and the view 3 % off it.
    around = np.array([0.3, 1.1, 2.6, 3.1])
    landmarks = np.column_stack([np.cos(around), np.sin(around)])
    away = landmarks - 1.03 * np.array([np.cos(4.6), np.sin(4.6)])
    bearings = np.arctan2(away[:, 1], away[:, 0])
    with pytest.warns(bearslam.AmbiguousWarning, match="nearly on one circle"):
        fix = bearslam.resect(landmarks, bearings, sigma=0.02, details=True)
    assert fix.uncertainty > 0.2
    assert fix.p_value > 0.99
