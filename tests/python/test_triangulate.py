# SPDX-License-Identifier: MIT OR Apache-2.0
"""Landmarks from known poses."""

import numpy as np

import bearslam


def test_exact_bearings_give_the_truth(own):
    for record in own["triangulation"]:
        found = bearslam.triangulate(record["poses"], np.array(record["bearings"], dtype=float))
        np.testing.assert_allclose(found, record["landmarks"], atol=1e-9)


def test_what_the_rays_do_not_determine_is_nan():
    poses = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    bearings = np.array(
        [
            [np.pi / 4, 0.3, np.pi / 2, np.nan],  # determined, seen once, parallel, never seen
            [np.pi / 2, np.nan, np.pi / 2, np.nan],
        ]
    )
    found = bearslam.triangulate(poses, bearings)
    np.testing.assert_allclose(found[0], [1.0, 1.0], atol=1e-12)
    assert np.isnan(found[1:]).all()
