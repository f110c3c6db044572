# SPDX-License-Identifier: MIT OR Apache-2.0
"""Landmarks from known poses."""

import numpy as np
import pytest

import bearslam


def test_exact_bearings_give_the_truth(own):
    for record in own["triangulation"]:
        found = bearslam.triangulate(record["poses"], np.array(record["bearings"], dtype=float))
        np.testing.assert_allclose(found, record["landmarks"], atol=1e-9)


def test_what_the_rays_do_not_determine_is_nan():
    poses = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    bearings = np.array(
        [
            [np.pi / 4, 0.3, np.pi / 2, np.nan],  # determined, seen once, parallel, never seen
            [np.pi / 2, np.nan, np.pi / 2, np.nan],
        ]
    )
    found = bearslam.triangulate(poses, bearings)
    np.testing.assert_allclose(found[0], [1.0, 1.0], atol=1e-12)
    assert np.isnan(found[1:]).all()


POSES = np.array([[0.0, 0.0, 0.2], [4.0, 1.0, 2.0], [1.0, 5.0, -1.0]])
POINTS = np.array([[3.0, 4.0], [-2.0, 1.5]])


def bearings_of(points, poses=POSES):
    away = points - poses[:, None, :2]
    return np.arctan2(away[..., 1], away[..., 0]) - poses[:, None, 2]


def test_one_landmark_is_a_column():
    table = bearings_of(POINTS)
    found = bearslam.triangulate(POSES, table)
    assert found.shape == (2, 2)
    for k in range(2):
        one = bearslam.triangulate(POSES, table[:, k])
        assert one.shape == (2,)
        np.testing.assert_array_equal(one, found[k])
    assert np.isnan(bearslam.triangulate(POSES[:1], table[:1, 0])).all()


def test_a_point_behind_its_rays_is_nan():
    stations = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]]
    for diverging in ([0.5, 0.2], [2.6, 0.5]):
        assert np.isnan(bearslam.triangulate(stations, diverging)).all()
    # A distant emitter over a short base: rays that diverge by their noise.
    base = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    noise = np.random.default_rng(0).normal(0, np.radians(1), (200, 2)).T
    found = bearslam.triangulate(base, bearings_of(np.array([[0.5, 60.0]]), base) + noise)
    assert np.isnan(found[:, 0]).sum() == 36
    assert (found[~np.isnan(found[:, 1]), 1] > 0).all()


def test_details_are_those_of_least_squares():
    sigma = 0.002
    exact = bearings_of(POINTS)
    noisy = exact + np.random.default_rng(1).normal(0, sigma, exact.shape)
    fix = bearslam.triangulate(POSES, noisy, sigma=sigma, details=True)
    np.testing.assert_array_equal(fix.value, bearslam.triangulate(POSES, noisy))
    residuals = bearings_of(fix.value) - noisy
    np.testing.assert_allclose(fix.rms, np.sqrt((residuals**2).mean(axis=0)), rtol=1e-9)
    np.testing.assert_allclose(fix.sigma0, np.sqrt((residuals**2).sum(axis=0)) / sigma, rtol=1e-9)
    for k, point in enumerate(fix.value):
        away = point - POSES[:, :2]
        jacobian = np.column_stack([-away[:, 1], away[:, 0]]) / (away**2).sum(axis=1)[:, None]
        expected = sigma**2 * np.linalg.inv(jacobian.T @ jacobian)
        np.testing.assert_allclose(fix.covariance[k], expected, rtol=1e-9)


def test_details_have_the_shape_of_the_call():
    table = bearings_of(POINTS)
    table[1:, 1] = np.nan  # seen once
    many = bearslam.triangulate(POSES, table, details=True)
    assert many.covariance.shape == (2, 2, 2)
    assert many.rms.shape == many.sigma0.shape == (2,)
    assert all(np.isnan(each[1]).all() for each in (many.value, many.covariance, many.rms, many.sigma0))
    one = bearslam.triangulate(POSES, table[:, 0], details=True)
    assert (one.value.shape, one.covariance.shape) == ((2,), (2, 2))
    assert isinstance(one.rms, float)
    np.testing.assert_array_equal(one.covariance, many.covariance[0])
    two_rays = bearslam.triangulate(POSES[:2], table[:2, 0], details=True)
    assert np.isfinite(two_rays.covariance).all()
    assert np.isnan(two_rays.sigma0)


def test_arguments_are_checked():
    with pytest.raises(bearslam.InvalidInputError, match="bearings"):
        bearslam.triangulate(POSES, [0.1, 0.2])
    with pytest.raises(bearslam.InvalidInputError, match="bearings"):
        bearslam.triangulate(POSES, np.zeros((3, 2, 1)))
    for sigma in (0.0, -1.0, np.inf, 1e-200):
        with pytest.raises(bearslam.InvalidInputError, match="sigma"):
            bearslam.triangulate(POSES, bearings_of(POINTS), sigma=sigma, details=True)
    with pytest.raises(bearslam.InvalidInputError, match="details"):
        bearslam.triangulate(POSES, bearings_of(POINTS), details=1)


def test_rays_that_miss_each_other_are_told():
    exact = bearings_of(POINTS)
    off = exact.copy()
    off[0, 0] += 0.1
    assert np.isfinite(bearslam.triangulate(POSES, off)).all()
    with pytest.warns(bearslam.PoorFitWarning, match="worst landmark 0"):
        found = bearslam.triangulate(POSES, off, sigma=0.01, details=True)
    assert found.p_value[0] < 1e-3
    assert (found.p_value[1:] > 0.5).all()
