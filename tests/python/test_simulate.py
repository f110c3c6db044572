# SPDX-License-Identifier: MIT OR Apache-2.0
"""Scenes with known truth."""

import numpy as np
import pytest

import bearslam


@pytest.mark.parametrize("layout", ["mixed", "enclosed", "trajectory"])
def test_bearings_are_those_of_the_truth_without_noise(layout):
    scene = bearslam.simulate(layout, 5, 8, noise=0.0, seed=3)
    away = scene.landmarks[None] - scene.poses[:, None, :2]
    expected = np.arctan2(away[..., 1], away[..., 0]) - scene.poses[:, 2:]
    assert np.isfinite(scene.bearings).all()
    assert np.abs(np.angle(np.exp(1j * (scene.bearings - expected)))).max() < 1e-12
    assert (np.abs(scene.bearings) <= np.pi).all()


def test_the_same_seed_gives_the_same_scene():
    first, second, other = (bearslam.simulate("mixed", 4, 9, noise=0.1, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.bearings, second.bearings)
    assert (first.bearings != other.bearings).all()


def test_noise_has_the_standard_deviation_asked_for():
    exact, noisy = (bearslam.simulate("mixed", 100, 100, noise=noise, seed=1) for noise in (0.0, 0.05))
    np.testing.assert_array_equal(exact.poses, noisy.poses)
    # 10^4 draws: their deviation is known to 0.7 %.
    assert np.std(np.angle(np.exp(1j * (noisy.bearings - exact.bearings)))) == pytest.approx(0.05, rel=0.05)


def test_where_things_are():
    scene = bearslam.simulate("enclosed", 50, 50, noise=0.0, seed=1, width=10.0, height=4.0)
    x, y = scene.landmarks.T
    on_border = np.isclose(x, 0) | np.isclose(x, 10) | np.isclose(y, 0) | np.isclose(y, 4)
    assert on_border.all()
    for points in (scene.poses[:, :2], scene.landmarks):
        assert (points >= -1e-9).all()
        assert (points <= [10 + 1e-9, 4 + 1e-9]).all()


def test_sight_is_limited():
    scene = bearslam.simulate("trajectory", 20, 60, noise=0.0, seed=1, width=50.0, height=50.0, sight=8.0)
    distance = np.hypot(*(scene.landmarks[None] - scene.poses[:, None, :2]).transpose(2, 0, 1))
    np.testing.assert_array_equal(np.isfinite(scene.bearings), distance <= 8.0)
    assert len(scene.sightings) == np.isfinite(scene.bearings).sum()


@pytest.mark.parametrize("kind", ["uniform", "exchanged", "merged", "mixture"])
def test_outliers_are_told_and_the_rest_is_as_without_them(kind):
    clean = bearslam.simulate("mixed", 12, 15, noise=0.01, seed=1)
    scene = bearslam.simulate("mixed", 12, 15, noise=0.01, seed=1, outliers=0.2, outlier_kind=kind)
    np.testing.assert_array_equal(clean.poses, scene.poses)
    assert not clean.outliers.any()
    seen = np.isfinite(scene.bearings)
    np.testing.assert_array_equal(scene.outliers, seen & (scene.bearings != clean.bearings))
    # The last pair of merged landmarks may exceed the share, by fewer than half of its sightings.
    assert 36 <= scene.outliers.sum() < (42 if kind == "merged" else 37)
    rows = zip(np.sort(scene.bearings), np.sort(clean.bearings), strict=True)
    assert all(np.array_equal(*row) for row in rows) == (kind == "exchanged")
    assert (~seen.any(axis=0)).any() == (kind == "merged")


def test_a_scene_from_elsewhere_has_no_outliers():
    scene = bearslam.simulate("mixed", 4, 9, noise=0.01, seed=1, outliers=0.5)
    assert not bearslam.Scene(scene.poses, scene.landmarks, scene.bearings).outliers.any()
    with pytest.raises(bearslam.InvalidInputError, match="outlier_kind"):
        bearslam.simulate("mixed", 4, 9, noise=0.01, seed=1, outliers=0.5, outlier_kind="odd")
    with pytest.raises(bearslam.InvalidInputError, match="outliers"):
        bearslam.simulate("mixed", 4, 9, noise=0.01, seed=1, outliers=1.5)
