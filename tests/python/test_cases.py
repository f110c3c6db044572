# SPDX-License-Identifier: MIT OR Apache-2.0
"""Small inputs that went wrong: each states the cost that the best map has. Skipped where the files are absent."""

import re

import numpy as np
import pytest

import bearslam

SOLVED = [
    "two_seen_loop_0.g2o",
    "three_seen_loop_3.g2o",
    "two_robots_beacons.g2o",
    "aoa_anchors_3_tags.g2o",
    "one_view_two_tags.g2o",
    "corridor_337.csv",
    "corridor_844.csv",
]


@pytest.mark.parametrize("name", SOLVED)
def test_a_case_reaches_the_cost_of_its_best_map(cases, name):
    best = re.search(r"RIGHT cost at most (\S+)", (cases / name).read_text())
    found = bearslam.solve(bearslam.load(cases / name))
    assert np.all(np.isfinite(found.poses))
    assert found.cost <= float(best[1]) * (1 + 1e-5) + 1e-5


def test_rays_that_diverge_place_no_landmark(cases):
    found = bearslam.solve(bearslam.load(cases / "diverging_rays.g2o"))
    assert np.all(np.isnan(found.landmarks))
    assert len(found.undetermined) == 1
