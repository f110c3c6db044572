# SPDX-License-Identifier: MIT OR Apache-2.0
"""Three views in closed form, against reference values made by other means."""

import itertools
from operator import itemgetter

import numpy as np
import pytest

import bearslam

# Rounding, amplified by the condition of the worst scene in the reference.
TOLERANCE = 1e-8


def relative(poses):
    """Poses in the frame of the first, at unit distance between the first two."""
    poses = np.asarray(poses, dtype=float)
    position = (poses[:, 0] + 1j * poses[:, 1] - complex(*poses[0, :2])) * np.exp(-1j * poses[0, 2])
    return position / abs(position[1]), np.exp(1j * (poses[:, 2] - poses[0, 2]))


def distance(found, expected):
    return max(np.abs(a - b).max() for a, b in zip(relative(found), relative(expected), strict=True))


def equally_signed(solution, bearings):
    """The poses of a solution, also with those views rotated by pi whose sightings point either way equally often."""
    away = solution.landmarks[None] - solution.poses[:, None, :2]
    forwards = np.cos(np.arctan2(away[..., 1], away[..., 0]) - solution.poses[:, 2:] - bearings) > 0
    tied = 2 * forwards.sum(axis=1) == forwards.shape[1]
    for turns in itertools.product(*([0.0, np.pi] if tie else [0.0] for tie in tied)):
        yield solution.poses + np.column_stack([np.zeros((3, 2)), turns])


def test_both_solutions_agree_with_the_reference(reference):
    for record in reference["three_view"]:
        found = bearslam.three_view(record["bearings"], reweights=0)
        assert len(found) == len(record["solutions"])
        for expected in record["solutions"]:
            away = [
                (min(distance(poses, expected["poses"]) for poses in equally_signed(one, record["bearings"])), one)
                for one in found
            ]
            least, nearest = min(away, key=itemgetter(0))
            assert least < TOLERANCE
            assert nearest.inconsistent == expected["inconsistent"]


def test_the_truth_is_among_the_solutions_of_exact_bearings(reference):
    for record in reference["three_view"]:
        if record.get("noise_deg", 0.0) == 0.0:
            found = bearslam.three_view(record["bearings"])
            truth = np.array(record["true_landmarks"])
            errors = [np.abs(bearslam.align(one.landmarks, truth).apply(one.landmarks) - truth).max() for one in found]
            assert min(errors) < 1e-6


def test_the_tensor_is_that_of_the_null_vector(reference):
    for record in reference["three_view"]:
        v = np.array(record["null_vector"])
        tensor = bearslam.trifocal_tensor(record["bearings"], reweights=0)
        assert np.linalg.norm(tensor) == pytest.approx(1.0, abs=1e-12)
        # Both are the same trilinear form in the bearings, up to a factor: compare their values at other bearings.
        other = np.random.default_rng(0).uniform(-np.pi, np.pi, (3, 40))
        a, b, c = other
        u, w, z = np.stack([np.cos(other), np.sin(other)], axis=1)
        from_tensor = np.einsum("ijl,ik,jk,lk->k", tensor, u, w, z)
        angles = [a + b - c, a - b + c, -a + b + c]
        from_vector = v @ np.concatenate([[np.cos(angle), np.sin(angle)] for angle in angles])
        factor = from_tensor @ from_vector / (from_vector @ from_vector)
        assert np.abs(from_tensor - factor * from_vector).max() < TOLERANCE


def test_the_projective_tensor_is_the_reference_up_to_sign(own):
    for record in own["three_view"]:
        if "projective_tensor" in record:
            expected = np.array(record["projective_tensor"]).reshape(2, 2, 2)
            tensor = bearslam.trifocal_tensor(record["bearings"], method="projective")
            assert min(np.abs(tensor - expected).max(), np.abs(tensor + expected).max()) < TOLERANCE


def test_epipoles_are_the_reference_in_either_order(own):
    for record in own["three_view"]:
        expected = np.array(record["epipoles"], dtype=float)
        found = bearslam.epipoles(bearslam.trifocal_tensor(record["bearings"], reweights=0))
        assert np.isnan(found).tolist() == np.isnan(expected).tolist()
        away = [np.nanmax(np.abs(np.sin(found - order))) for order in (expected, expected[::-1])]
        assert min(away) < 1e-7


def test_complex_epipoles_are_an_error_with_the_discriminant():
    # The real part of the product of three complex numbers: its eigenvalues are +-i.
    tensor = [[[1, 0], [0, -1]], [[0, -1], [-1, 0]]]
    with pytest.raises(bearslam.DegenerateError, match="discriminant") as caught:
        bearslam.epipoles(tensor)
    assert caught.value.kind == "complex_epipoles"
    assert caught.value.value < caught.value.bound == 0.0


def test_solutions_that_noise_has_merged_are_one():
    counts = set()
    for seed in range(40):
        found = bearslam.three_view(bearslam.simulate("mixed", 3, 9, noise=0.05, seed=seed).bearings)
        counts.add(len(found))
        assert len(found) == 2 or found[0].near_collinear
    assert counts == {1, 2}


def test_reweighting_lowers_the_error_on_the_whole():
    errors = {0: [], 2: []}
    for seed in range(60):
        scene = bearslam.simulate("mixed", 3, 20, noise=0.005, seed=seed)
        for reweights, found in errors.items():
            solutions = bearslam.three_view(scene.bearings, reweights=reweights)
            headings = [relative(one.poses)[1] / relative(scene.poses)[1] for one in solutions]
            found.append(min(np.abs(np.angle(one)).max() for one in headings))
    assert np.median(errors[2]) < np.median(errors[0])


def test_five_landmarks_are_enough_for_calibrated_and_seven_for_projective():
    scene = bearslam.simulate("mixed", 3, 7, noise=0.0, seed=5)
    assert bearslam.three_view(scene.bearings[:, :5])
    assert bearslam.three_view(scene.bearings, method="projective")
    with pytest.raises(bearslam.InvalidInputError, match="5"):
        bearslam.three_view(scene.bearings[:, :4])
    with pytest.raises(bearslam.InvalidInputError, match="7"):
        bearslam.three_view(scene.bearings[:, :6], method="projective")


def test_landmarks_along_a_wall_are_degenerate():
    wall = np.arctan2(2.0, np.linspace(-3, 3, 9) - np.array([[0.0], [1.0], [-0.5]]))
    with pytest.raises(bearslam.DegenerateError) as caught:
        bearslam.three_view(wall)
    assert caught.value.kind == "three_view_system"
    assert np.isfinite([caught.value.value, caught.value.bound]).all()


def test_what_comes_back_can_be_read():
    (first, *_) = bearslam.three_view(bearslam.simulate("mixed", 3, 9, noise=0.0, seed=1).bearings)
    assert first.poses.shape == (3, 3)
    assert first.landmarks.shape == (9, 2)
    assert first.poses[0].tolist() == [0.0, 0.0, 0.0]
    assert np.hypot(*first.poses[1, :2]) == pytest.approx(1.0)
    assert "9 landmarks" in repr(first)


@pytest.mark.parametrize(("method", "landmarks"), [("calibrated", 5), ("calibrated", 12), ("projective", 9)])
def test_a_batch_is_each_problem_by_itself(method, landmarks):
    stack = np.stack([bearslam.simulate("mixed", 3, landmarks, noise=0.01, seed=seed).bearings for seed in range(200)])
    found = bearslam.three_view_batch(stack, method=method)
    assert len(found) == 200
    for k, bearings in enumerate(stack):
        solutions = bearslam.three_view(bearings, method=method)
        for branch, solution in enumerate(solutions):
            assert np.array_equal(found.poses[k, branch], solution.poses)
            assert np.array_equal(found.landmarks[k, branch], solution.landmarks)
            assert found.inconsistent[k, branch] == solution.inconsistent
            assert found.cost[k, branch] == solution.cost
            assert found.near_collinear[k] == solution.near_collinear
        assert np.isnan(found.poses[k, len(solutions) :]).all()


def test_a_degenerate_problem_of_a_batch_is_nan():
    wall = np.arctan2(2.0, np.linspace(-3, 3, 9) - np.array([[0.0], [1.0], [-0.5]]))
    scene = bearslam.simulate("mixed", 3, 9, noise=0.0, seed=1).bearings
    found = bearslam.three_view_batch([scene, wall, scene])
    assert np.isnan(found.poses[1]).all()
    assert (found.inconsistent[1] == -1).all()
    assert np.array_equal(found.poses[0], found.poses[2])
    assert "2 of 3" in repr(found)
    assert bearslam.three_view_batch(np.empty((0, 3, 9))).poses.shape == (0, 2, 3, 3)
    with pytest.raises(bearslam.InvalidInputError, match="at least 5 landmarks, got 4"):
        bearslam.three_view_batch(np.zeros((2, 3, 4)))
    with pytest.raises(bearslam.InvalidInputError, match="finite"):
        bearslam.three_view_batch(np.full((2, 3, 6), np.nan))
