# SPDX-License-Identifier: MIT OR Apache-2.0
"""Reconstruction of many views."""

import os
import signal
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bearslam
from bearslam.data.maps import Map, compare, register

seeds = st.integers(0, 2**32)


def truth_error(result, scene):
    """Largest error of a position after alignment, as a share of the size of the scene."""
    similarity = register(Map(result.poses, result.landmarks), Map(scene.poses, scene.landmarks))
    poses, landmarks = similarity.apply_poses(result.poses), similarity.apply(result.landmarks)
    away = np.concatenate([poses[:, :2] - scene.poses[:, :2], landmarks - scene.landmarks])
    return np.nanmax(np.abs(away)) / np.hypot(7.0, 5.0)


def test_the_best_known_cost_is_reached(reference):
    for record in reference["many_view"]:
        result = bearslam.solve(np.array(record["bearings"], dtype=float))
        best = record["best_known_cost"]
        # Theirs is the sum of the squared residuals, ours half of it. 1e-20: bearings without noise leave rounding.
        assert 2 * result.cost <= best * (1 + 1e-6) + 1e-20
        assert result.converged


def test_refinement_from_the_best_known_map_stays_there(reference):
    for record in reference["many_view"]:
        result = bearslam.refine(
            np.array(record["bearings"], dtype=float), (record["ml_poses"], record["ml_landmarks"])
        )
        assert 2 * result.cost == pytest.approx(record["best_known_cost"], rel=1e-6, abs=1e-20)


@pytest.mark.parametrize("method", ["search", "calibrated", "projective"])
@pytest.mark.parametrize("layout", ["mixed", "enclosed"])
def test_exact_bearings_give_the_truth(layout, method):
    for seed in range(20):
        scene = bearslam.simulate(layout, 5, 9, noise=0.0, seed=seed)
        result = bearslam.solve(scene.bearings, method=method)
        maps = [result, *result.alternatives]
        assert min(truth_error(one, scene) for one in maps) < 1e-7


def test_the_smallest_problems_are_solved():
    for views, landmarks in ((3, 5), (4, 4)):
        scene = bearslam.simulate("mixed", views, landmarks, noise=0.0, seed=3)
        result = bearslam.solve(scene.bearings)
        # Exactly determined problems may have another map that explains every bearing.
        assert min(truth_error(one, scene) for one in [result, *result.alternatives]) < 1e-6


def test_the_gauge():
    result = bearslam.solve(bearslam.simulate("mixed", 6, 9, noise=0.01, seed=2).bearings)
    assert result.poses[0].tolist() == [0.0, 0.0, 0.0]
    assert np.sqrt((result.poses[1:, :2] ** 2).sum(axis=1).mean()) == pytest.approx(1.0, abs=1e-9)
    assert (np.abs(result.poses[:, 2]) <= np.pi).all()


def test_residuals_are_predicted_minus_measured():
    scene = bearslam.simulate("mixed", 5, 9, noise=0.02, seed=4)
    bearings = scene.bearings.copy()
    bearings[1, 3] = np.nan
    sigma = np.linspace(0.01, 0.03, bearings.size).reshape(bearings.shape)
    result = bearslam.solve(bearings, sigma=sigma)
    away = result.landmarks[None] - result.poses[:, None, :2]
    predicted = np.arctan2(away[..., 1], away[..., 0]) - result.poses[:, 2:]
    expected = np.angle(np.exp(1j * (predicted - bearings)))
    expected[1, 3] = np.nan
    np.testing.assert_allclose(result.residuals, expected, atol=1e-12)
    assert result.cost == pytest.approx(0.5 * np.nansum((expected / sigma) ** 2))
    assert result.rms == pytest.approx(np.sqrt(np.nanmean(expected**2)))


def test_sightings_and_a_table_have_the_same_answer():
    scene = bearslam.simulate("mixed", 5, 9, noise=0.02, seed=4)
    table, arrays = bearslam.solve(scene.bearings), bearslam.solve(scene.sightings)
    np.testing.assert_array_equal(table.poses, arrays.poses)
    np.testing.assert_array_equal(table.residuals.ravel(), arrays.residuals)


def test_the_same_seed_gives_the_same_bits():
    scene = bearslam.simulate("mixed", 8, 12, noise=0.02, seed=4)
    first, second = (bearslam.solve(scene.bearings, seed=7) for _ in range(2))
    np.testing.assert_array_equal(first.poses, second.poses)
    np.testing.assert_array_equal(first.landmarks, second.landmarks)


def test_refinement_lowers_the_cost_of_every_start():
    for seed in range(10):
        scene = bearslam.simulate("enclosed", 6, 10, noise=0.02, seed=seed)
        start = bearslam.initialize(scene.bearings)
        assert not start.converged
        assert start.termination == "not_refined"
        assert bearslam.refine(scene.bearings, start).cost <= start.cost * (1 + 1e-12)
        assert bearslam.solve(scene.bearings).cost <= bearslam.refine(scene.bearings, start).cost * (1 + 1e-9)


def test_the_refinement_is_as_good_as_the_noise_allows():
    errors = []
    for seed in range(20):
        scene = bearslam.simulate("mixed", 8, 15, noise=0.01, seed=seed)
        result = bearslam.solve(scene.bearings, sigma=0.01)
        errors.append(compare(result, scene).heading)
        # 120 bearings less 50 unknowns and 4 of the gauge: chi-square of 74 degrees of freedom, six deviations.
        assert abs(2 * result.cost - 74) < 6 * np.sqrt(2 * 74)
    assert np.median(errors) < 0.01


def test_sensitivity_and_uncertainty_tell_what_to_expect():
    sigma = 0.01
    ratios = []
    for seed in range(30):
        scene = bearslam.simulate("mixed", 6, 12, noise=sigma, seed=seed)
        result = bearslam.solve(scene.bearings, sigma=sigma)
        distances = np.linalg.norm(result.landmarks - result.poses[:, None, :2], axis=2)
        # A landmark at infinity, or on a view, is one parameter.
        directions = len(result.undetermined) + int((distances < 1e-6).any(axis=0).sum())
        assert result.freedom == 6 * 12 + 4 - 3 * 6 - 2 * 12 + directions
        assert result.sigma0 == pytest.approx(np.sqrt(2 * result.cost / result.freedom))
        assert result.uncertainty == pytest.approx(result.sensitivity * result.sigma0)
        similarity = register(Map(result.poses, result.landmarks), Map(scene.poses, scene.landmarks))
        size = np.sqrt(np.square(result.poses[:, :2]).sum() + np.square(result.landmarks).sum())
        away = np.concatenate(
            [
                similarity.apply_poses(result.poses)[:, :2] - scene.poses[:, :2],
                similarity.apply(result.landmarks) - scene.landmarks,
            ]
        )
        ratios.append(np.linalg.norm(away) / similarity.scale / size / result.sensitivity)
    # The worst direction dominates the error; the gauge and the measure of size leave a factor open.
    assert 0.2 < np.median(ratios) < 5


def test_sigma_scales_sensitivity_but_not_uncertainty():
    scene = bearslam.simulate("mixed", 6, 12, noise=0.01, seed=1)
    one, ten = (bearslam.solve(scene.bearings, sigma=sigma) for sigma in (0.01, 0.1))
    assert ten.sensitivity == pytest.approx(10 * one.sensitivity, rel=1e-6)
    assert ten.uncertainty == pytest.approx(one.uncertainty, rel=1e-6)


def test_sensitivity_and_uncertainty_are_nan_where_there_are_none():
    scene = bearslam.simulate("mixed", 6, 12, noise=0.01, seed=1)
    start = bearslam.initialize(scene.bearings)
    assert np.isnan([start.sensitivity, start.uncertainty]).all()
    solved, refined = bearslam.solve(scene.bearings), bearslam.refine(scene.bearings, scene)
    assert refined.sensitivity == pytest.approx(solved.sensitivity, rel=1e-3)
    assert refined.uncertainty == pytest.approx(solved.uncertainty, rel=1e-3)
    # Three views of five landmarks: as many bearings as unknowns.
    exact = bearslam.solve(bearslam.simulate("mixed", 3, 5, noise=0.01, seed=1).bearings)
    assert np.isfinite(exact.sensitivity)
    assert np.isnan(exact.uncertainty)


def test_what_cannot_be_determined_is_listed_and_nan():
    scene = bearslam.simulate("mixed", 6, 9, noise=0.0, seed=2)
    bearings = scene.bearings.copy()
    bearings[1:, 8] = np.nan  # seen once
    bearings[5, 2:] = np.nan  # sees two
    result = bearslam.solve(bearings)
    assert {(one.kind, one.index) for one in result.undetermined} == {("landmark", 8), ("view", 5)}
    assert all(one.reason for one in result.undetermined)
    assert np.isnan(result.landmarks[8]).all()
    assert np.isnan(result.poses[5]).all()
    assert np.isnan(result.residuals[5, :2]).all()
    assert truth_error(result, scene) < 1e-7
    again = bearslam.refine(bearings, result)
    assert {(one.kind, one.index) for one in again.undetermined} == {("landmark", 8), ("view", 5)}


def test_a_wall_seen_by_three_views_is_degenerate():
    scene = bearslam.simulate("mixed", 3, 8, noise=0.0, seed=1)
    landmarks = np.column_stack([np.linspace(0, 7, 8), np.full(8, 6.0)])
    away = landmarks[None] - scene.poses[:, None, :2]
    bearings = np.arctan2(away[..., 1], away[..., 0]) - scene.poses[:, 2:]
    with pytest.raises(bearslam.DegenerateError):
        bearslam.solve(bearings)


def test_views_in_one_place_are_degenerate():
    bearings = np.array([[0.3, 1.2, 2.4, -1.0, -2.0, 0.9]]) - np.array([[0.0], [0.5], [1.0], [2.0]])
    with pytest.raises(bearslam.DegenerateError):
        bearslam.solve(bearings)


@pytest.mark.skipif(os.name == "nt", reason="needs SIGALRM")
def test_a_signal_ends_a_long_solve():
    def interrupted(number, frame):
        raise KeyboardInterrupt

    scene = bearslam.simulate("mixed", 500, 500, noise=0.02, seed=1)
    before = signal.signal(signal.SIGALRM, interrupted)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        start = time.monotonic()
        with pytest.raises(KeyboardInterrupt):
            bearslam.solve(scene.bearings)
        assert time.monotonic() - start < 3.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize(
    ("layout", "views", "landmarks", "noise", "seed"),
    [
        ("mixed", 6, 7, 0.01, 21),
        ("mixed", 6, 7, 0.04, 21),
        ("mixed", 8, 7, 0.01, 59),
        ("enclosed", 10, 6, 0.01, 10),
        ("enclosed", 5, 8, 0.04, 22),
    ],
)
def test_alternatives_are_minima_of_their_own(layout, views, landmarks, noise, seed):
    scene = bearslam.simulate(layout, views, landmarks, noise=noise, seed=seed, sight=4.0)
    found = bearslam.solve(scene.bearings, sigma=noise)
    for rival in found.alternatives:
        assert rival.converged
        assert rival.cost > found.cost * (1 - 1e-6)
        assert np.abs(rival.poses - found.poses).max() > 0.005
        if not rival.undetermined:  # what is at infinity has no place to start from
            again = bearslam.refine(scene.bearings, rival, sigma=noise)
            assert again.cost == pytest.approx(rival.cost, rel=1e-5)


@given(seeds, st.lists(st.floats(-6, 6), min_size=4, max_size=4))
def test_turning_a_view_changes_its_heading_alone(seed, turns):
    scene = bearslam.simulate("mixed", 4, 9, noise=0.01, seed=seed)
    before = bearslam.solve(scene.bearings)
    bearings = np.angle(np.exp(1j * (scene.bearings - np.array(turns)[:, None])))
    after = bearslam.refine(bearings, turned(before, turns))
    assert after.cost == pytest.approx(before.cost, rel=1e-6, abs=1e-15)


def turned(result, turns):
    poses = result.poses.copy()
    poses[:, 2] = np.angle(np.exp(1j * (poses[:, 2] + turns)))
    return poses, result.landmarks


@given(seeds, st.randoms(use_true_random=False))
def test_the_order_of_views_and_landmarks_does_not_matter(seed, random):
    scene = bearslam.simulate("enclosed", 5, 10, noise=0.01, seed=seed)
    views, landmarks = list(range(5)), list(range(10))
    random.shuffle(views)
    random.shuffle(landmarks)
    one = bearslam.solve(scene.bearings)
    other = bearslam.solve(scene.bearings[np.ix_(views, landmarks)])
    assert other.cost == pytest.approx(one.cost, rel=1e-6)


def test_progress_is_told_and_can_stop_the_work():
    told = []
    # Large enough to take longer than the 0.05 s between two reports.
    scene = bearslam.simulate("mixed", 200, 200, noise=0.02, seed=4)
    bearslam.solve(scene.bearings, progress=lambda *step: told.append(step))
    assert told
    for stage, done, total in told:
        assert isinstance(stage, str)
        assert 0 <= done <= total

    def stop(stage, done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bearslam.solve(scene.bearings, progress=stop)


def test_real_views_reach_the_minimum_at_the_truth(mrclam):
    # One of them lies in a long valley.
    for scene in mrclam("short_linked"):
        seen = bearslam.Sightings(scene["view_index"], scene["landmark_index"], scene["bearing"])
        sigma = np.radians(0.2)
        best = bearslam.refine(seen, (scene["true_poses"], scene["true_landmarks"]), sigma=sigma)
        assert bearslam.solve(seen, sigma=sigma).cost <= best.cost * (1 + 1e-5)
