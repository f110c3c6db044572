# SPDX-License-Identifier: MIT OR Apache-2.0
"""Maps against the truth."""

import numpy as np
import pytest

import bearslam
from bearslam.data.maps import compare

SCENE = bearslam.simulate("mixed", 4, 9, noise=0.0, seed=1)


def test_a_moved_truth_has_no_error():
    similarity = bearslam.Similarity(0.3, 2.0, np.array([5.0, -1.0]))
    errors = compare((similarity.apply_poses(SCENE.poses), similarity.apply(SCENE.landmarks)), SCENE)
    assert max(errors.position, errors.landmark, errors.heading) < 1e-12


def test_errors_are_in_the_units_of_the_truth():
    poses = SCENE.poses + [0.0, 0.0, 0.1]
    errors = compare((poses, SCENE.landmarks), SCENE)
    assert errors.heading == pytest.approx(0.1)
    assert errors.position == pytest.approx(0.0, abs=1e-12)


def test_what_is_unknown_does_not_count():
    poses, landmarks = SCENE.poses.copy(), SCENE.landmarks.copy()
    poses[1] = landmarks[2] = np.nan
    errors = compare((poses, landmarks), SCENE)
    assert max(errors.position, errors.landmark, errors.heading) < 1e-12
