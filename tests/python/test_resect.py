# SPDX-License-Identifier: MIT OR Apache-2.0
"""A pose from known landmarks."""

import numpy as np
import pytest

import bearslam


def test_exact_bearings_give_the_truth(own):
    for record in own["resection"]:
        found = bearslam.resect(record["landmarks"], record["bearings"])
        np.testing.assert_allclose(found, record["pose"], atol=1e-8)


def test_a_landmark_that_was_not_seen_does_not_count(own):
    record = own["resection"][-1]
    landmarks = [*record["landmarks"], [np.nan, np.nan]]
    found = bearslam.resect(landmarks, [*record["bearings"], np.nan])
    np.testing.assert_allclose(found, record["pose"], atol=1e-8)


def test_two_landmarks_are_too_few():
    with pytest.raises(bearslam.InvalidInputError, match="3"):
        bearslam.resect([[0.0, 0.0], [1.0, 0.0], [2.0, 2.0]], [0.0, np.nan, 1.0])


def test_a_circle_through_view_and_landmarks_is_degenerate():
    angles = np.array([0.3, 1.1, 2.6])
    view = np.array([np.cos(4.0), np.sin(4.0)])
    landmarks = np.column_stack([np.cos(angles), np.sin(angles)])
    away = landmarks - view
    with pytest.raises(bearslam.DegenerateError):
        bearslam.resect(landmarks, np.arctan2(away[:, 1], away[:, 0]))
