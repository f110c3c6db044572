# SPDX-License-Identifier: MIT OR Apache-2.0
"""Outliers: found, reported, and without influence on the map and its covariances."""

import numpy as np
import pytest

import bearslam

NOISE = np.radians(0.5)


def contaminated(seed, share=0.2, **options):
    """A scene, its bearings with a share of them random, and which these are."""
    scene = bearslam.simulate("enclosed", 8, 15, noise=NOISE, seed=seed, **options)
    random = np.random.default_rng(seed)
    wrong = np.zeros(scene.bearings.shape, dtype=bool)
    wrong.flat[random.choice(wrong.size, int(share * wrong.size), replace=False)] = True
    bearings = np.where(wrong, random.uniform(-np.pi, np.pi, wrong.shape), scene.bearings)
    return scene, bearings, wrong


@pytest.mark.parametrize("seed", range(4))
def test_a_fifth_of_the_bearings_may_be_wrong(seed):
    scene, bearings, wrong = contaminated(seed)
    result = bearslam.solve(bearings, sigma=NOISE, robust=True)
    clean = bearslam.solve(np.where(wrong, np.nan, bearings), sigma=NOISE)
    assert result.inliers.shape == bearings.shape
    # A random bearing is within three standard deviations by chance once in 120.
    assert (result.inliers & wrong).sum() <= 1
    assert (~result.inliers & ~wrong).sum() <= 3
    known = np.isfinite(result.landmarks[:, 0] + clean.landmarks[:, 0])
    similarity = bearslam.align(result.landmarks[known], scene.landmarks[known])
    error = similarity.apply(result.landmarks[known]) - scene.landmarks[known]
    assert np.hypot(*error.T).max() < 0.3
    bounded = np.minimum((result.residuals / NOISE) ** 2, 9)
    assert result.cost == pytest.approx(np.where(np.isnan(bounded), 9, bounded).sum() / 2, rel=1e-6)


def test_covariances_are_those_of_the_inliers():
    _, bearings, _ = contaminated(1)
    result = bearslam.solve(bearings, sigma=NOISE, robust=True, covariance=True)
    alone = np.where(result.inliers, bearings, np.nan)
    again = bearslam.refine(alone, result, sigma=NOISE, covariance=True)
    np.testing.assert_allclose(result.poses, again.poses, atol=1e-4)
    np.testing.assert_allclose(result.pose_covariance, again.pose_covariance, rtol=1e-2, atol=1e-9)
    assert result.covariance_frame == "first_view"


def test_nothing_is_left_out_without_robust():
    _, bearings, _ = contaminated(1)
    result = bearslam.solve(bearings, sigma=NOISE)
    np.testing.assert_array_equal(result.inliers, np.isfinite(result.residuals))


def test_with_odometry():
    scene = bearslam.simulate("trajectory", 20, 20, noise=NOISE, seed=1, sight=3.0)
    odometry = scene.odometry([0.02, 0.02, 0.01], seed=1)
    bearings = scene.bearings.copy()
    seen = np.argwhere(np.isfinite(bearings))
    places = tuple(seen[np.random.default_rng(1).choice(len(seen), 15, replace=False)].T)
    bearings[places] += 1.0
    result = bearslam.solve(bearings, sigma=NOISE, odometry=odometry, robust=True, covariance=True)
    assert not result.inliers[places].any()
    theta = scene.poses[0, 2]
    offset = (scene.poses - scene.poses[0])[:, :2]
    c, s = np.cos(theta), np.sin(theta)
    np.testing.assert_allclose(result.poses[:, :2], offset @ [[c, -s], [s, c]], atol=0.2)
    assert np.isfinite(result.pose_covariance).all()


@pytest.mark.parametrize("share", [0.0, 0.2])
def test_real_robots_with_odometry(mrclam, share):
    for scene in mrclam("track_joint"):
        sigma = float(scene["sigma"])
        view, bearing = scene["view_index"], scene["bearing"].copy()
        odometry = bearslam.Odometry(*(scene[f"odo_{name}"] for name in ("from", "to", "delta", "sigma")))
        random = np.random.default_rng(1)
        wrong = random.choice(bearing.size, int(share * bearing.size), replace=False)
        bearing[wrong] = random.uniform(-np.pi, np.pi, wrong.size)
        seen = bearslam.Sightings(view, scene["landmark_index"], bearing)
        result = bearslam.solve(seen, sigma=sigma, odometry=odometry, robust=True)
        truth = (scene["true_poses"], scene["true_landmarks"])
        near_truth = bearslam.refine(seen, truth, sigma=sigma, odometry=odometry, loss="truncated")
        assert result.cost <= near_truth.cost
        assert not result.undetermined
        # Random bearings within three standard deviations, and what the odometry explains of views that see little.
        assert result.inliers[wrong].sum() <= 0.05 * wrong.size
        assert np.delete(~result.inliers, wrong).sum() <= 0.02 * bearing.size


def test_bearings_modulo_pi():
    _, bearings, wrong = contaminated(2, share=0.1)
    result = bearslam.solve(bearings % np.pi, sigma=NOISE, robust=True, oriented=False)
    assert (result.inliers & wrong).sum() <= 1
    assert (~result.inliers & ~wrong).sum() <= 3


def test_along_odometry_most_bearings_must_agree():
    """Odometry alone makes a map, whatever the bearings say."""
    noise = np.radians(0.5)
    scene = bearslam.simulate("trajectory", 60, 30, noise=noise, seed=4, sight=2.5)
    odometry = scene.odometry([0.02, 0.02, 0.01], seed=1)
    random = np.random.default_rng(0)
    nonsense = np.where(np.isnan(scene.bearings), np.nan, random.uniform(-np.pi, np.pi, scene.bearings.shape))
    with pytest.raises(bearslam.DegenerateError, match="no consensus") as caught:
        bearslam.solve(nonsense, sigma=noise, odometry=odometry, robust=True)
    assert caught.value.kind == "no_consensus"
