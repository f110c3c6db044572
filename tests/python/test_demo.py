# SPDX-License-Identifier: MIT OR Apache-2.0
"""What the demonstration claims."""

import math

import pytest

from bearslam.demo import EXPERIMENTS, measure


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda one: one.name)
def test_refinement_beats_the_linear_estimates(experiment):
    noise = math.radians(experiment.noise_deg)
    *linear, refined = measure(experiment.scene(), noise)
    for row in linear:
        assert refined.result.cost < row.result.cost
        assert refined.errors.position < row.errors.position
    # Residuals of a fit are smaller than the noise, but not by much.
    assert 0.3 * noise < refined.result.rms < noise
    assert refined.errors.position < 0.3
