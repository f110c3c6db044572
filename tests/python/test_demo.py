# SPDX-License-Identifier: MIT OR Apache-2.0
"""What the demonstration claims."""

import math

import numpy as np
import pytest

from bearslam.cli.demo import EXPERIMENTS, measure


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


@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda one: one.name)
def test_the_scenes_shown_are_typical(experiment):
    noise = math.radians(experiment.noise_deg)

    def errors(seed=None):
        rows = [row.errors for row in measure(experiment.scene(seed), noise, 1)]
        return [[math.nan] * 3 if one is None else [one.position, one.landmark, one.heading] for one in rows]

    typical = np.nanmedian([errors(seed) for seed in range(200)], axis=0)
    assert (np.abs(np.log2(errors() / typical)) < 1).all()
