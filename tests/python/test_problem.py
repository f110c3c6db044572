# SPDX-License-Identifier: MIT OR Apache-2.0
"""Sightings, names, and the forms in which a problem comes."""

import pickle

import numpy as np
import pytest

import bearslam
from bearslam import InvalidInputError, Problem, Sightings
from bearslam.data.normalize import normalize

NAN = np.nan


def test_a_table_with_gaps_and_parallel_arrays_are_the_same_problem():
    table = normalize([[0.1, NAN, 0.3], [NAN, 0.5, 0.6]], sigma=0.02)
    seen = table.sightings
    assert (table.views, table.landmarks) == (2, 3)
    assert seen.view.tolist() == [0, 0, 1, 1]
    assert seen.landmark.tolist() == [0, 2, 1, 2]
    assert seen.bearing.tolist() == [0.1, 0.3, 0.5, 0.6]
    assert table.sigma.tolist() == [0.02] * 4
    np.testing.assert_array_equal(table.restore(seen.bearing), [[0.1, NAN, 0.3], [NAN, 0.5, 0.6]])


def test_views_and_landmarks_that_nobody_saw_count_in_a_table():
    table = normalize([[0.1, NAN], [NAN, NAN]])
    assert (table.views, table.landmarks) == (2, 2)


def test_standard_deviations_of_a_table_may_have_gaps_where_the_table_has():
    assert normalize([[0.1, NAN, 0.3]], sigma=[[1.0, NAN, 3.0]]).sigma.tolist() == [1.0, 3.0]
    with pytest.raises(InvalidInputError, match=r"sigma\[1\]: expected a number above 0"):
        normalize([[0.1, NAN, 0.3]], sigma=[[1.0, 2.0, NAN]])


def test_sightings_keep_what_they_were_given():
    bearing = np.array([0.1, 0.2])
    seen = Sightings([0, 1], [0, 0], bearing, 0.01)
    bearing[0] = 9.0
    assert seen.bearing.tolist() == [0.1, 0.2]
    assert seen.sigma is not None
    assert seen.sigma.tolist() == [0.01, 0.01]
    with pytest.raises(ValueError, match="read-only"):
        seen.view[0] = 3
    again = pickle.loads(pickle.dumps(seen))
    assert again.bearing.tolist() == [0.1, 0.2]


def test_names_stay_with_the_problem():
    problem = Problem(Sightings([0, 1], [0, 0], [0.1, 0.2]), ["left", "right"], ["door"])
    table = normalize(problem, 0.5)
    assert table.view_ids == ("left", "right")
    assert table.landmark_ids == ("door",)
    assert table.sigma.tolist() == [0.5, 0.5]


@pytest.mark.parametrize(
    ("view", "landmark", "bearing", "sigma", "message"),
    [
        ([0, 1], [0], [0.1, 0.2], None, "landmark: expected as many entries as view has, 2, got 1"),
        ([0, 1], [0, 0], [0.1], None, "bearing: expected as many entries as view has, 2, got 1"),
        ([], [], [], None, "view: expected at least one sighting, got none"),
        ([0.0], [0], [0.1], None, "view: expected 0-based integers, got an array of dtype float64"),
        ([True], [0], [0.1], None, "view: expected 0-based integers, got an array of dtype bool"),
        (["a"], [0], [0.1], None, "view: expected 0-based integers, got an array of dtype <U1"),
        ([0], [-1], [0.1], None, r"landmark\[0\]: expected an index from 0 to 16777215, got -1"),
        ([10**9], [0], [0.1], None, r"view\[0\]: expected an index from 0"),
        ([[0]], [0], [0.1], None, r"view: expected an array of shape \(k,\), got \(1, 1\)"),
        ([0], [0], [NAN], None, r"bearing\[0\]: expected a finite number, got nan"),
        ([0], [0], [np.inf], None, r"bearing\[0\]: expected a finite number, got inf"),
        ([0], [0], ["0.1"], None, "bearing: expected real numbers, got an array of dtype <U3"),
        ([0], [0], [0.1], 0.0, "sigma: expected a number above 0 for every sighting, got 0"),
        ([0, 1], [0, 0], [0.1, 0.1], [1.0, -2.0], r"sigma\[1\]: expected a number above 0 for every sighting, got -2"),
        ([0], [0], [0.1], [NAN], r"sigma\[0\]: expected a finite number, got nan"),
        ([0], [0], [0.1], [1.0, 1.0], r"sigma: expected an array of shape \(1,\), got \(2,\)"),
    ],
)
def test_bad_sightings(view, landmark, bearing, sigma, message):
    with pytest.raises(InvalidInputError, match=f"^{message}"):
        Sightings(view, landmark, bearing, sigma)


@pytest.mark.parametrize(
    ("problem", "sigma", "message"),
    [
        ([0.1, 0.2], 1.0, r"bearings: expected an array of shape \(m, n\), got \(2,\)"),
        ([[0.1], [0.2, 0.3]], 1.0, "bearings: expected an array of numbers, got rows that do not fit together"),
        ([[0.1, None]], 1.0, "bearings: expected real numbers, got an array of dtype object"),
        ([[0.1, 1j]], 1.0, "bearings: expected real numbers, got an array of dtype complex128"),
        ([["0.1"]], 1.0, "bearings: expected real numbers"),
        ([[0.1, np.inf]], 1.0, r"bearings\[0, 1\]: expected a finite number, or NaN for what is missing, got inf"),
        ([[NAN, NAN]], 1.0, r"bearings: expected at least one sighting, got none in shape \(1, 2\)"),
        (np.empty((0, 3)), 1.0, r"bearings: expected at least one sighting, got none in shape \(0, 3\)"),
        (np.ma.masked_invalid([[0.1, NAN]]), 1.0, "bearings: expected a plain array, got a masked one"),
        ([[0.1]], -1.0, "sigma: expected a number above 0 for every sighting, got -1"),
        ([[0.1]], NAN, "sigma: expected a finite number, got nan"),
        ([[0.1]], "wide", "sigma: expected real numbers"),
        ([[0.1]], [1.0], r"sigma: expected an array of shape \(1, 1\), got \(1,\)"),
        (Sightings([0], [0], [0.1], 0.1), 0.2, "sigma: the sightings have their own standard deviations"),
        (object(), 1.0, r"bearings: expected real numbers, got an array of dtype object"),
    ],
)
def test_bad_problems(problem, sigma, message):
    with pytest.raises(InvalidInputError, match=f"^{message}"):
        normalize(problem, sigma)


@pytest.mark.parametrize(
    ("views", "message"),
    [
        (["a"], "view_ids: expected at least 2 names, got 1"),
        (["a", "a"], "view_ids: expected distinct names, got 'a' twice"),
        (["a", ""], r"view_ids\[1\]: expected a name"),
        (["a", " b"], r"view_ids\[1\]: expected a name"),
        (["a", "b\nc"], r"view_ids\[1\]: expected a name"),
        (["a", 3], r"view_ids\[1\]: expected a name"),
    ],
)
def test_bad_names(views, message):
    with pytest.raises(InvalidInputError, match=f"^{message}"):
        Problem(Sightings([0, 1], [0, 0], [0.1, 0.2]), views, ["door"])


def everything():
    """A problem with every field filled."""
    scene = bearslam.simulate("enclosed", 4, 6, noise=0.01, seed=1)
    seen = Sightings(*np.nonzero(np.isfinite(scene.bearings)), scene.bearings.ravel(), 0.01)
    return scene, {
        "sightings": seen,
        "view_ids": ["a", "b", "c", "d", "e"],
        "landmark_ids": [str(j) for j in range(6)],
        "odometry": bearslam.Odometry([2, 3], [3, 4], [[1, 0, 0], [1, 0, 0.1]], [0.1, 0.1, 0.1]),
        "pose_priors": bearslam.PosePriors([1], [scene.poses[1]], [0.1, 0.1, np.inf]),
        "landmark_priors": bearslam.LandmarkPriors([3], [scene.landmarks[3]], np.eye(2)[None]),
        "start": (np.vstack([scene.poses, np.full(3, np.nan)]), scene.landmarks),
        "fixed_views": [2, 0, 0],
        "fixed_landmarks": [5],
    }


def test_all_that_a_problem_can_have_is_used():
    scene, parts = everything()
    problem = Problem(**parts)
    assert repr(problem) == "<Problem: 24 of 6 landmarks from 5 views, 2 motions, 1 known pose, 1 known landmark>"
    assert problem.fixed_views == (0, 2)
    given = {
        "odometry": problem.odometry,
        "pose_priors": bearslam.PosePriors(
            [1, 0, 2], scene.poses[[1, 0, 2]], [[0.1, 0.1, np.inf], [1e-6] * 3, [1e-6] * 3]
        ),
        "landmark_priors": bearslam.LandmarkPriors([3, 5], scene.landmarks[[3, 5]], [np.eye(2), 1e-12 * np.eye(2)]),
    }
    one, other = bearslam.solve(problem), bearslam.solve(parts["sightings"], **given)
    np.testing.assert_array_equal(one.poses, other.poses)
    assert one.cost == other.cost
    assert one.odometry is problem.odometry
    assert len(one.pose_priors) == 3
    assert np.abs(one.poses[[0, 2]] - scene.poses[[0, 2]]).max() < 1e-4  # fixed
    refined = bearslam.refine(problem)
    assert refined.cost == pytest.approx(one.cost, rel=1e-6)
    alone = bearslam.solve(problem, odometry=bearslam.Odometry([0], [1], [[1, 0, 0]], [100, 100, 3]))
    assert len(alone.odometry) == 1
    assert len(bearslam.initialize(problem).poses) == 5
    assert problem.bearings_only().odometry is None


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("view_ids", ["a", "b", "c", "d"], r"start: poses: expected an array of shape \(4, 3\)"),
        ("odometry", bearslam.Odometry([4], [5], [[0, 0, 0]], [1, 1, 1]), r"odometry: end: .* 5 views, got 5"),
        ("pose_priors", bearslam.PosePriors([5], [[0, 0, 0]], [1, 1, 1]), r"pose_priors: view: .* got 5"),
        ("landmark_priors", bearslam.LandmarkPriors([6], [[0, 0]], 1.0), r"landmark_priors: landmark: .* got 6"),
        ("offsets", bearslam.Offsets([24], [[0, 1]], [1, 1]), r"offsets: sighting: .* got 24"),
        ("start", (np.zeros((4, 3)), np.zeros((6, 2))), r"start: poses: expected an array of shape \(5, 3\)"),
        ("start", None, r"fixed_views: expected a place in start"),
        ("fixed_views", [4], r"fixed_views: expected a place in start for what is fixed, got none for 4"),
        ("fixed_landmarks", [6], r"fixed_landmarks: expected indices of the 6 landmarks, got 6"),
    ],
)
def test_parts_that_do_not_fit(name, value, message):
    _, parts = everything()
    with pytest.raises(InvalidInputError, match=message):
        Problem(**{**parts, name: value})


def test_offsets():
    correlated = np.array([[[0.04, 0.01], [0.01, 0.02]]])
    offsets = bearslam.Offsets([0], [[3, 4]], correlated)
    step = 1e-6
    moved = [bearslam.Offsets([0], [[3 + dx, 4 + dy]], correlated).bearing[0] for dx, dy in ((step, 0), (0, step))]
    slope = (np.array(moved) - offsets.bearing[0]) / step
    assert offsets.bearing_sigma[0] == pytest.approx(np.sqrt(slope @ correlated[0] @ slope), rel=1e-5)
    with pytest.raises(InvalidInputError, match=r"position\[1\]: expected a landmark away"):
        bearslam.Offsets([0, 1], [[1, 0], [0, 0]], [1, 1])
    with pytest.raises(InvalidInputError, match="sighting: expected every sighting at most once"):
        bearslam.Offsets([0, 0], [[1, 0], [1, 0]], [1, 1])


def test_refine_without_a_start():
    _, parts = everything()
    with pytest.raises(InvalidInputError, match="start: expected an initial map"):
        bearslam.refine(parts["sightings"])
