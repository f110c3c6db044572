# SPDX-License-Identifier: MIT OR Apache-2.0
"""Covariances: shapes, frames, unconstrained directions. Their values are tested in test_nees.py."""

import numpy as np
import pytest

import bearslam
from bearslam import DegenerateError, LandmarkPriors

NOISE = 0.002
SCENE = bearslam.simulate("enclosed", 6, 10, noise=NOISE, seed=8)


def test_none_unless_asked_for():
    result = bearslam.solve(SCENE.bearings, sigma=NOISE)
    assert result.pose_covariance is None
    assert result.landmark_covariance is None
    assert result.covariance_frame is None


@pytest.mark.parametrize("verb", ["solve", "refine"])
def test_shapes_and_symmetry(verb):
    start = () if verb == "solve" else (SCENE,)
    result = getattr(bearslam, verb)(SCENE.bearings, *start, sigma=NOISE, covariance=True)
    assert result.covariance_frame == "first_view"
    assert result.pose_covariance.shape == (6, 3, 3)
    assert result.landmark_covariance.shape == (10, 2, 2)
    for blocks in (result.pose_covariance, result.landmark_covariance):
        np.testing.assert_array_equal(blocks, blocks.transpose(0, 2, 1))
        assert (np.linalg.eigvalsh(blocks) > -1e-15).all()
        assert (np.diagonal(blocks, axis1=1, axis2=2) >= 0).all()
    # The first view is the reference of the others.
    assert np.abs(result.pose_covariance[0]).max() < 1e-15
    assert all(other.pose_covariance is None for other in result.alternatives)


def test_variances_go_with_the_square_of_sigma():
    one, two = (bearslam.refine(SCENE.bearings, SCENE, sigma=k * NOISE, covariance=True) for k in (1, 2))
    np.testing.assert_allclose(two.pose_covariance, 4 * one.pose_covariance, rtol=1e-6, atol=1e-15)


def test_a_free_network_has_the_least_variance_of_positions():
    traces = {}
    for frame in ("first_view", "free_network"):
        result = bearslam.refine(SCENE.bearings, SCENE, sigma=NOISE, covariance=frame)
        assert result.covariance_frame == frame
        views = result.pose_covariance[:, :2, :2]
        traces[frame] = np.trace(views.sum(axis=0)) + np.trace(result.landmark_covariance.sum(axis=0))
    assert traces["free_network"] < traces["first_view"]


def test_priors_are_the_frame_where_they_leave_nothing_open():
    known = LandmarkPriors([0, 3], SCENE.landmarks[[0, 3]], 1e-4)
    result = bearslam.solve(SCENE.bearings, sigma=NOISE, landmark_priors=known, covariance=True)
    assert result.covariance_frame == "priors"
    # The bearings add next to nothing to such an accurate prior.
    np.testing.assert_allclose(np.sqrt(np.diag(result.landmark_covariance[0])), 1e-4, rtol=0.1)
    half = LandmarkPriors([0], SCENE.landmarks[[0]], 1e-4)
    with pytest.raises(DegenerateError, match="directions of the gauge that odometry and priors leave free") as caught:
        bearslam.solve(SCENE.bearings, sigma=NOISE, landmark_priors=half, covariance="priors")
    assert (caught.value.kind, caught.value.value) == ("free_frame", 2)
    assert caught.value.diagnosis is None  # nothing is wrong with the bearings
    assert bearslam.solve(SCENE.bearings, sigma=NOISE, landmark_priors=half, covariance=True).covariance_frame == (
        "first_view"
    )


def test_what_is_undetermined_has_no_covariance():
    bearings = SCENE.bearings.copy()
    bearings[1:, 9] = np.nan
    result = bearslam.solve(bearings, sigma=NOISE, covariance=True)
    assert np.isnan(result.landmark_covariance[9]).all()
    assert np.isfinite(result.landmark_covariance[:9]).all()


def test_what_nothing_holds_has_infinite_variance():
    poses = np.array([[0, 0, 0.1], [1, 0.3, -0.2], [2.5, -0.4, 0.4], [1.5, -1, 0]])
    wall = np.column_stack([0.7 * np.arange(8) - 1, np.full(8, 2.0)])
    x, y = (wall[None] - poses[:, None, :2]).transpose(2, 0, 1)
    bearings = np.arctan2(y, x) - poses[:, 2:]
    result = bearslam.refine(bearings, (poses, wall), sigma=0.01, covariance="free_network")
    variances = np.diagonal(result.pose_covariance, axis1=1, axis2=2)
    assert np.isinf(variances).any(axis=1).sum() >= 3
    assert not np.isnan(variances).any()


def test_progress_is_told_and_can_stop_the_work():
    told = []
    scene = bearslam.simulate("trajectory", 300, 200, noise=NOISE, seed=1, sight=2.0)
    odometry = scene.odometry([0.02, 0.02, 0.01], seed=1)
    bearslam.refine(
        scene.bearings, scene, sigma=NOISE, odometry=odometry, covariance=True, progress=lambda *x: told.append(x)
    )
    stages = {stage for stage, _, _ in told}
    assert stages <= {"refine", "covariance"}
    assert all(0 <= done <= total for _, done, total in told)
