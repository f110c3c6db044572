# SPDX-License-Identifier: MIT OR Apache-2.0
"""Every wrong argument gets an `InvalidInputError` that names it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bearslam
from bearslam import InvalidInputError, RefineOptions, SearchOptions

SCENE = bearslam.simulate("mixed", 4, 9, noise=0.01, seed=1)
SEEN = SCENE.bearings


def spoiled(array, *where, value=np.nan):
    array = np.array(array)
    array[where] = value
    return array


TABLE = [
    (lambda: bearslam.three_view(SEEN), r"bearings: expected an array of shape \(3, n\), got \(4, 9\)"),
    (lambda: bearslam.three_view(spoiled(SEEN[:3], 1, 2)), r"bearings\[1, 2\]: expected a finite number, got nan"),
    (lambda: bearslam.three_view(SEEN[:3], method="best"), "method: expected 'calibrated' or 'projective', got 'best'"),
    (lambda: bearslam.three_view(SEEN[:3], reweights=-1), "reweights: expected an integer from 0"),
    (lambda: bearslam.three_view(SEEN[:3], reweights=1.5), "reweights: expected an integer, got 1.5"),
    (lambda: bearslam.trifocal_tensor(SEEN[:2]), r"bearings: expected an array of shape \(3, n\), got \(2, 9\)"),
    (lambda: bearslam.trifocal_tensor(SEEN[:3], method=3), "method: expected"),
    (lambda: bearslam.epipoles(np.ones(8)), r"tensor: expected an array of shape \(2, 2, 2\), got \(8,\)"),
    (lambda: bearslam.epipoles(np.full((2, 2, 2), np.inf)), r"tensor\[0, 0, 0\]: expected a finite number, got inf"),
    (
        lambda: bearslam.triangulate(SCENE.poses[:, :2], SEEN),
        r"poses: expected an array of shape \(m, 3\), got \(4, 2\)",
    ),
    (
        lambda: bearslam.triangulate(SCENE.poses, SEEN[:3]),
        r"bearings: expected an array of shape \(4, n\), got \(3, 9\)",
    ),
    (lambda: bearslam.triangulate(spoiled(SCENE.poses, 2, 2), SEEN), r"poses\[2, 2\]: expected a finite number"),
    (lambda: bearslam.resect(SCENE.landmarks, SEEN[0, :5]), r"bearings: expected an array of shape \(9,\), got \(5,\)"),
    (lambda: bearslam.resect(spoiled(SCENE.landmarks, 3, 1), SEEN[0]), r"landmarks\[3, 1\]: expected a finite number"),
    (lambda: bearslam.align([[0, 0], [1, 1]], [[0, 0]]), r"target: expected an array of shape \(2, 2\), got \(1, 2\)"),
    (lambda: bearslam.align([[0, 0]], [[0, 0]]), "2"),
    (lambda: bearslam.align([["a", "b"]], [[0, 0]]), "source: expected real numbers, got an array of dtype <U1"),
    (lambda: bearslam.solve(SEEN[:2]), "3"),
    (lambda: bearslam.solve(SEEN[:, :3]), "4"),
    (lambda: bearslam.solve(SEEN[:3, :4]), "5"),
    (lambda: bearslam.solve(SEEN, method="magic"), "method: expected 'search' or 'calibrated' or 'projective'"),
    (lambda: bearslam.solve(SEEN, sigma=1e-300), "sigma: expected a number from 1e-100 to .*, got 1e-300"),
    (lambda: bearslam.solve(SEEN, seed="0" * 1000), r"seed: expected an integer, got '0{79}\.\.\. \(1002 characters\)"),
    (lambda: bearslam.simulate("mixed", 10**6, 10**6, noise=0.1, seed=0), "views: expected at most .*, got 1000000 x"),
    (lambda: bearslam.solve(SEEN, search=SearchOptions(triples=0)), "triples: expected an integer from 1"),
    (lambda: bearslam.solve(SEEN, search=SearchOptions(triples=True)), "triples: expected an integer from 1"),
    (lambda: bearslam.solve(SEEN, search=SearchOptions(grown=0)), "grown: expected an integer from 1"),
    (lambda: bearslam.initialize(SEEN, search=SearchOptions(grown=1.0)), "grown: expected an integer, got 1.0"),
    (lambda: bearslam.solve(SEEN, search=SearchOptions(candidates=0)), "candidates: expected an integer from 1"),
    (
        lambda: bearslam.solve(SEEN, refinement=RefineOptions(max_iterations="many")),
        "max_iterations: expected an integer, got 'many'",
    ),
    (
        lambda: bearslam.solve(SEEN, refinement=RefineOptions(max_iterations=2**70)),
        "max_iterations: expected an integer from 1",
    ),
    (
        lambda: bearslam.solve(SEEN, refinement=RefineOptions(damping=-1.0)),
        "damping: expected a number of at least 0, got -1.0",
    ),
    (
        lambda: bearslam.solve(SEEN, refinement=RefineOptions(damping=np.inf)),
        "damping: expected a number of at least 0, got inf",
    ),
    (
        lambda: bearslam.solve(SEEN, refinement=RefineOptions(tolerance=np.nan)),
        "tolerance: expected a number of at least 0, got nan",
    ),
    (
        lambda: bearslam.solve(SEEN, refinement=RefineOptions(tolerance="0")),
        "tolerance: expected a number of at least 0, got '0'",
    ),
    (lambda: bearslam.solve(SEEN, seed=-1), "seed: expected an integer from 0"),
    (
        lambda: bearslam.solve(SEEN, loss="l1"),
        "loss: expected 'squared' or 'huber' or 'cauchy' or 'truncated', got 'l1",
    ),
    (lambda: bearslam.initialize(SEEN, loss=2), "loss: expected 'squared' or 'huber'"),
    (
        lambda: bearslam.solve(SEEN, loss="huber"),
        "sigma: expected the standard deviation of a bearing in radians, at most 0.5, which loss='huber' needs; got 1$",
    ),
    (lambda: bearslam.refine(SEEN, SCENE, sigma=3, loss="cauchy"), "sigma: expected the standard deviation .* got 3$"),
    (
        lambda: bearslam.solve(SEEN, odometry=SCENE.odometry([0.1, 0.1, 0.1], seed=0)),
        "sigma: expected the standard deviation of a bearing in radians, at most 0.5, which odometry needs; got 1$",
    ),
    (
        lambda: bearslam.solve(SEEN, sigma=0.1, loss="huber", refinement=RefineOptions(loss_scale=0)),
        "loss_scale: expected a number of at least 1e-06",
    ),
    (
        lambda: bearslam.solve(SEEN, refinement=RefineOptions(loss_scale=2.0)),
        "loss_scale: expected None, since the squared loss has no width, got 2.0",
    ),
    (lambda: bearslam.solve(SEEN, robust=True), "sigma: expected the standard deviation .* robust=True needs; got 1$"),
    (
        lambda: bearslam.solve(SEEN, sigma=0.4, robust=True),
        "sigma: outliers can be identified only below 0.35 rad, got 0.4",
    ),
    (lambda: bearslam.solve(SEEN, sigma=0.1, robust=1), "robust: expected True or False, got 1"),
    (
        lambda: bearslam.solve(SEEN, method="global", oriented=False),
        "expected oriented bearings, got bearings known mod",
    ),
    (lambda: bearslam.solve(SEEN, oriented=0), "oriented: expected True or False, got 0"),
    (lambda: bearslam.solve(SEEN, odometry=SCENE), "odometry: expected None or Odometry, got Scene"),
    (lambda: bearslam.solve(SEEN, pose_priors=[1]), "pose_priors: expected None or PosePriors, got list"),
    (lambda: bearslam.solve(SEEN, landmark_priors=0), "landmark_priors: expected None or LandmarkPriors, got int"),
    (
        lambda: bearslam.solve(SEEN, covariance="origin"),
        "covariance: expected False, True or one of 'first_view', 'free_network', 'priors', got 'origin'",
    ),
    (lambda: bearslam.solve(SEEN, progress=3), "progress: expected None or a function"),
    (lambda: bearslam.solve(bearslam.Sightings([0, 0], [1, 1], [0.1, 0.2])), "."),
    (
        lambda: bearslam.solve(bearslam.Sightings([0, 2**24 - 1], [1, 2**24 - 1], [0.1, 0.2])),
        "sightings: expected nearly consecutive indices, got 2 sightings of 16777216 landmarks",
    ),
    (lambda: bearslam.initialize(SEEN, method="random"), "method: expected"),
    (lambda: bearslam.initialize(SEEN, sigma=0.0), "sigma: expected a number above 0"),
    (lambda: bearslam.refine(SEEN, (SCENE.poses,)), r"start: expected \(poses, landmarks\), got a tuple of 1"),
    (lambda: bearslam.refine(SEEN, 3), r"start: expected a map or \(poses, landmarks\), got int"),
    (
        lambda: bearslam.refine(SEEN, (SCENE.poses[:3], SCENE.landmarks)),
        r"start: poses: expected an array of shape \(4, 3\), got \(3, 3\)",
    ),
    (
        lambda: bearslam.refine(SEEN, (SCENE.poses, SCENE.landmarks[:4])),
        r"start: landmarks: expected an array of shape",
    ),
    (
        lambda: bearslam.refine(SEEN, (spoiled(SCENE.poses, 0, 0, value=np.inf), SCENE.landmarks)),
        r"start: poses\[0, 0\]",
    ),
    (lambda: bearslam.simulate("ring", 4, 9, noise=0.1, seed=0), "layout: expected 'mixed' or 'enclosed' or 'traj"),
    (lambda: bearslam.simulate("mixed", 0, 9, noise=0.1, seed=0), "views: expected an integer from 1"),
    (lambda: bearslam.simulate("mixed", 4, 2.0, noise=0.1, seed=0), "landmarks: expected an integer, got 2.0"),
    (
        lambda: bearslam.simulate("mixed", 4, 9, noise=-0.1, seed=0),
        "noise: expected a number of at least 0, got -0.1",
    ),
    (lambda: bearslam.simulate("mixed", 4, 9, noise=0.1, seed=None), "seed: expected an integer, got None"),
    (
        lambda: bearslam.simulate("mixed", 4, 9, noise=0.1, seed=0, width=0.0),
        "width: expected a number above 0 and at most .*, got 0.0",
    ),
    (lambda: bearslam.simulate("mixed", 4, 9, noise=0.1, seed=0, height=np.inf), "height: expected a number above 0"),
    (
        lambda: bearslam.simulate("mixed", 4, 9, noise=0.1, seed=0, sight=-1.0),
        "sight: expected a number above 0, or inf",
    ),
]


@pytest.mark.parametrize(("call", "message"), TABLE)
def test_a_wrong_argument_is_named(call, message):
    with pytest.raises(InvalidInputError, match=message):
        call()


def test_a_landmark_seen_twice_by_a_view():
    view, landmark = np.indices((4, 9)).reshape(2, -1)
    landmark[1] = 0
    with pytest.raises(InvalidInputError):
        bearslam.solve(bearslam.Sightings(view, landmark, SEEN.ravel()))


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.complex_numbers(),
    lambda inner: st.lists(inner, max_size=4) | st.tuples(inner, inner) | st.dictionaries(st.text(), inner, max_size=2),
    max_leaves=20,
)


@given(anything)
def test_no_object_whatever_gets_another_error(value):
    calls = [
        lambda: bearslam.solve(value),
        lambda: bearslam.solve(SEEN, sigma=value),
        lambda: bearslam.three_view(value),
        lambda: bearslam.refine(SEEN, value),
        lambda: bearslam.triangulate(SCENE.poses, value),
        lambda: bearslam.align(value, value),
        lambda: bearslam.Sightings(value, value, value),
        lambda: bearslam.solve(SEEN, refinement=RefineOptions(damping=value, max_iterations=2)),
        lambda: bearslam.solve(SEEN, seed=value, refinement=RefineOptions(max_iterations=2)),
        lambda: bearslam.solve(
            SEEN, sigma=0.01, loss="huber", refinement=RefineOptions(loss_scale=value, max_iterations=2)
        ),
        lambda: bearslam.solve(SEEN, covariance=value, refinement=RefineOptions(max_iterations=2)),
        lambda: bearslam.Odometry(value, value, value, value),
        lambda: bearslam.Odometry([0], [1], [[1, 0, 0]], value),
        lambda: bearslam.PosePriors([0], [[1, 0, 0]], value),
        lambda: bearslam.LandmarkPriors([0], value, value),
    ]
    for call in calls:
        try:
            call()
        except bearslam.BearslamError as error:
            assert str(error)


@given(
    st.integers(1, 5).flatmap(
        lambda m: st.integers(1, 7).flatmap(
            lambda n: st.lists(
                st.lists(st.floats(-4, 4) | st.sampled_from([np.nan, 0.0, np.pi]), min_size=n, max_size=n),
                min_size=m,
                max_size=m,
            )
        )
    )
)
def test_bearings_without_any_sense_give_an_error_or_a_map_that_says_how_bad_it_is(rows):
    try:
        result = bearslam.solve(rows)
    except bearslam.BearslamError as error:
        assert str(error)
    else:
        assert result.cost >= 0
        assert np.isfinite(result.cost)
        for one in result.undetermined:
            row = (result.poses if one.kind == "view" else result.landmarks)[one.index]
            assert np.isnan(row).all()
            assert one.reason
