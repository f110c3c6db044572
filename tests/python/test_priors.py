# SPDX-License-Identifier: MIT OR Apache-2.0
"""Odometry, known poses and landmarks, losses, bearings modulo pi."""

import numpy as np
import pytest

import bearslam
from bearslam import InvalidInputError, LandmarkPriors, Odometry, PosePriors, Sightings
from bearslam.data.align import wrap

NOISE = 0.009
SIGMA = (0.02, 0.02, 0.01)


def trajectory(views=40, landmarks=25, seed=1, noise=NOISE):
    return bearslam.simulate("trajectory", views, landmarks, noise=noise, seed=seed, sight=2.5)


def motion(start, end):
    """Pose of `end` in the frame of `start`, both (k, 3)."""
    c, s = np.cos(start[:, 2]), np.sin(start[:, 2])
    x, y = (end - start)[:, :2].T
    return np.column_stack([c * x + s * y, c * y - s * x, wrap(end[:, 2] - start[:, 2])])


def squares(result, odometry):
    """Twice the cost of the odometry, by its definition."""
    predicted = motion(result.poses[odometry.start], result.poses[odometry.end])
    error = motion(odometry.delta, predicted)
    return ((error / odometry.sigma) ** 2).sum()


def test_odometry_of_a_scene_is_its_motion_with_noise():
    scene = trajectory(views=2000, landmarks=3)
    odometry = scene.odometry(SIGMA, seed=3)
    assert odometry.start.tolist() == list(range(1999))
    assert odometry.end.tolist() == list(range(1, 2000))
    error = motion(odometry.delta, motion(scene.poses[:-1], scene.poses[1:]))
    # Four standard errors of a standard deviation from 1999 draws: 6 %, whatever the heading of the motion.
    np.testing.assert_allclose(error.std(axis=0), SIGMA, rtol=0.07)
    np.testing.assert_array_equal(scene.odometry(SIGMA, seed=3).delta, odometry.delta)
    assert (scene.odometry(SIGMA, seed=4).delta != odometry.delta).all()


def test_odometry_fixes_the_scale_and_the_cost_is_what_it_says():
    scene = trajectory()
    odometry = scene.odometry(SIGMA, seed=3)
    result = bearslam.solve(scene.bearings, sigma=NOISE, odometry=odometry)
    assert result.converged
    assert result.poses[0] == pytest.approx([0, 0, 0], abs=1e-12)
    np.testing.assert_allclose(result.poses, motion(np.tile(scene.poses[0], (40, 1)), scene.poses), atol=0.3)
    bearings = np.nansum((result.residuals / NOISE) ** 2)
    assert result.cost == pytest.approx((bearings + squares(result, odometry)) / 2, rel=1e-9)
    from_truth = bearslam.refine(scene.bearings, scene, sigma=NOISE, odometry=odometry)
    assert result.cost == pytest.approx(from_truth.cost, rel=1e-6)


@pytest.mark.parametrize(
    "sigma",
    [SIGMA, np.tile(SIGMA, (39, 1)), np.tile(np.diag(np.square(SIGMA)), (39, 1, 1))],
    ids=["all", "each", "covariances"],
)
def test_one_uncertainty_in_three_forms(sigma):
    scene = trajectory()
    made = scene.odometry(SIGMA, seed=3)
    odometry = Odometry(made.start, made.end, made.delta, sigma)
    plain = bearslam.solve(scene.bearings, sigma=NOISE, odometry=made)
    assert bearslam.solve(scene.bearings, sigma=NOISE, odometry=odometry).cost == pytest.approx(plain.cost, rel=1e-9)


def test_views_that_see_nothing_are_carried_by_odometry():
    scene = trajectory()
    seen = scene.sightings
    early = seen.view < 38
    sightings = Sightings(seen.view[early], seen.landmark[early], seen.bearing[early], NOISE)
    assert sightings.view_count == 38
    result = bearslam.solve(sightings, odometry=scene.odometry(SIGMA, seed=3), covariance=True)
    assert result.poses.shape == (40, 3)
    assert np.isfinite(result.poses).all()
    assert np.trace(result.pose_covariance[39]) > np.trace(result.pose_covariance[38])


def test_known_landmarks_fix_the_frame():
    scene = bearslam.simulate("enclosed", 6, 9, noise=0.0, seed=4)
    known = [0, 3, 5]
    priors = LandmarkPriors(known, scene.landmarks[known], 1e-3)
    result = bearslam.solve(scene.bearings, sigma=NOISE, landmark_priors=priors)
    np.testing.assert_allclose(result.poses, scene.poses, atol=1e-6)
    np.testing.assert_allclose(result.landmarks, scene.landmarks, atol=1e-6)


@pytest.mark.parametrize(
    "sigma", [0.01, [0.01, 0.01], np.full((3, 2), 0.01), np.tile(1e-4 * np.eye(2), (3, 1, 1))], ids=np.ndim
)
def test_landmark_priors_in_four_forms(sigma):
    priors = LandmarkPriors([0, 1, 2], np.arange(6).reshape(3, 2), sigma)
    expected = np.tile(1e-4 * np.eye(2), (3, 1, 1)) if np.ndim(sigma) == 3 else np.full((3, 2), 0.01)
    np.testing.assert_array_equal(priors.sigma, expected)


def test_a_compass_and_one_known_pose():
    scene = bearslam.simulate("mixed", 6, 9, noise=0.0, seed=2)
    sigma = np.tile([np.inf, np.inf, 0.01], (6, 1))
    sigma[2] = [0.1, 0.1, 0.01]
    result = bearslam.solve(scene.bearings, sigma=NOISE, pose_priors=PosePriors(range(6), scene.poses, sigma))
    np.testing.assert_allclose(wrap(result.poses[:, 2] - scene.poses[:, 2]), 0, atol=1e-6)
    np.testing.assert_allclose(result.poses[2], scene.poses[2], atol=1e-6)
    # Neither determines the scale: it is fixed as in every reconstruction.
    offsets = (result.poses - result.poses[0])[1:, :2]
    assert (offsets**2).sum(axis=1).mean() == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("loss", ["huber", "cauchy", "truncated"])
def test_a_loss_bears_a_wrong_bearing(loss):
    scene = bearslam.simulate("enclosed", 8, 15, noise=0.002, seed=1)
    bearings = scene.bearings.copy()
    bearings[2, 3] += 0.2
    start = bearslam.refine(bearings, scene, sigma=0.002)
    result = bearslam.refine(bearings, scene, sigma=0.002, loss=loss)

    def error(found):
        moved = bearslam.align(found.landmarks, scene.landmarks).apply(found.landmarks)
        return np.abs(moved - scene.landmarks).max()

    assert error(result) < error(start) / 2
    scale = {"huber": 1.345, "cauchy": 2.385, "truncated": 3.0}[loss]
    s = (result.residuals / 0.002) ** 2
    rho = {
        "huber": np.where(s <= scale**2, s, 2 * scale * np.sqrt(s) - scale**2),
        "cauchy": scale**2 * np.log1p(s / scale**2),
        "truncated": np.minimum(s, scale**2),
    }[loss]
    assert result.cost == pytest.approx(rho.sum() / 2, rel=1e-9)
    given = bearslam.refine(
        bearings, scene, sigma=0.002, loss=loss, refinement=bearslam.RefineOptions(loss_scale=scale)
    )
    assert given.cost == result.cost
    wider = bearslam.refine(
        bearings, scene, sigma=0.002, loss=loss, refinement=bearslam.RefineOptions(loss_scale=5 * scale)
    )
    assert wider.cost > result.cost


def test_outliers_of_a_truncated_loss_are_named():
    scene = bearslam.simulate("enclosed", 8, 15, noise=0.002, seed=1)
    bearings = scene.bearings.copy()
    bearings[2, 3] += 0.2
    bearings[5, 5] = np.nan
    result = bearslam.refine(
        bearings, scene, sigma=0.002, loss="truncated", refinement=bearslam.RefineOptions(loss_scale=4.0)
    )
    wrong = np.isfinite(bearings) & ~result.inliers
    assert np.argwhere(wrong).tolist() == [[2, 3]]
    assert result.inliers.dtype == bool
    assert not result.inliers[5, 5]
    everything = bearslam.refine(bearings, scene, sigma=0.002, loss="huber")
    np.testing.assert_array_equal(everything.inliers, np.isfinite(bearings))


def test_bearings_modulo_pi():
    scene = bearslam.simulate("mixed", 6, 10, noise=0.002, seed=3)
    straight = bearslam.solve(scene.bearings, sigma=0.002)
    turned = scene.bearings + np.pi * (np.random.default_rng(1).random(scene.bearings.shape) < 0.4)
    result = bearslam.solve(turned, sigma=0.002, oriented=False)
    assert result.cost <= straight.cost * (1 + 1e-6)
    assert straight.oriented
    assert not result.oriented
    assert np.abs(result.residuals).max() <= np.pi / 2
    assert np.abs(result.poses[:, 2]).max() <= np.pi / 2
    start = bearslam.initialize(turned, sigma=0.002, oriented=False)
    assert bearslam.refine(turned, start, sigma=0.002, oriented=False).cost == pytest.approx(result.cost, rel=1e-6)


def test_arrays_are_the_priors_own():
    delta = np.zeros((1, 3))
    odometry = Odometry([0], [1], delta, SIGMA)
    delta[0] = 7
    assert (odometry.delta == 0).all()
    with pytest.raises(ValueError, match="read-only"):
        odometry.delta[0] = 1


ONE = ([0], [1], [[1.0, 0.0, 0.0]])
SCENE = bearslam.simulate("mixed", 4, 9, noise=0.01, seed=1)
BAD = [
    (lambda: Odometry([0, 1], [1], np.zeros((2, 3)), SIGMA), "end: expected as many entries as start has, 2, got 1"),
    (lambda: Odometry([0], [0], [[1, 0, 0]], SIGMA), r"end\[0\]: expected a view other than that of start, got 0"),
    (lambda: Odometry([0], [-1], [[1, 0, 0]], SIGMA), r"end\[0\]: expected an index from 0"),
    (lambda: Odometry([0], [1], [[1, 0]], SIGMA), r"delta: expected an array of shape \(1, 3\), got \(1, 2\)"),
    (lambda: Odometry([0], [1], [[1, 0, np.nan]], SIGMA), r"delta\[0, 2\]: expected a finite number, got nan"),
    (lambda: Odometry(*ONE, [0.1, 0.1]), r"sigma: expected an array of shape \(3,\), got \(2,\)"),
    (lambda: Odometry(*ONE, 0.1), r"sigma: expected an array of shape \(1, 3\), got \(\)"),
    (lambda: Odometry(*ONE, [0.1, 0.1, 0.0]), r"sigma\[2\]: expected a number above 0, got 0"),
    (lambda: Odometry(*ONE, [0.1, 0.1, np.inf]), r"sigma\[2\]: expected a finite number, got inf"),
    (lambda: Odometry(*ONE, [0.1, 0.1, 1e-300]), r"sigma\[2\]: expected a number from 1e-100 to 1e\+100, got 1e-300"),
    (lambda: Odometry(*ONE, [-np.eye(3)]), r"sigma\[0\]: expected a positive definite covariance, got one with the"),
    (
        lambda: Odometry(*ONE, [np.triu(np.ones((3, 3)))]),
        r"sigma\[0\]: expected a symmetric covariance, got 1 at \[0, 1\] and 0 at \[1, 0\]",
    ),
    (
        lambda: PosePriors([0], [[0, 0, 0]], [[np.inf, -np.inf, 1]]),
        r"sigma\[0, 1\]: expected a finite number, got -inf",
    ),
    (lambda: PosePriors([0], [[0, 0, np.inf]], [1, 1, 1]), r"pose\[0, 2\]: expected a finite number, got inf"),
    (lambda: LandmarkPriors([0], [[0, 0, 0]], 1.0), r"position: expected an array of shape \(1, 2\), got \(1, 3\)"),
    (lambda: LandmarkPriors([0], [[0, 0]], np.inf), r"sigma\[0\]: expected a finite number, got inf"),
    (lambda: LandmarkPriors([0], [[0, 0]], -1), r"sigma\[0\]: expected a number above 0, got -1"),
    (
        lambda: bearslam.solve(SCENE.bearings, sigma=0.01, odometry=Odometry([0], [7], [[1, 0, 0]], SIGMA)),
        "odometry: end: expected indices below 4, got 7 at index 0",
    ),
    (
        lambda: bearslam.solve(SCENE.bearings, sigma=0.01, landmark_priors=LandmarkPriors([9], [[1, 0]], 0.1)),
        "landmark priors: landmark: expected indices below 9, got 9 at index 0",
    ),
    (lambda: SCENE.odometry([0.1, 0.0, 0.1], seed=1), r"sigma\[1\]: expected a number above 0, got 0.0"),
    (lambda: SCENE.odometry([0.1, 0.1], seed=1), r"sigma: expected an array of shape \(3,\), got \(2,\)"),
]


@pytest.mark.parametrize(("call", "message"), BAD)
def test_a_wrong_prior_is_named(call, message):
    with pytest.raises(InvalidInputError, match=f"^{message}"):
        call()
