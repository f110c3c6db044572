# SPDX-License-Identifier: MIT OR Apache-2.0
"""Limited sight: both methods by name, and separate maps."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

import bearslam
from bearslam.data.options import Method


@pytest.mark.parametrize("method", ["search", "incremental", "global"])
def test_a_trajectory_is_recovered_by_both_methods(method: Method) -> None:
    scene = bearslam.simulate("trajectory", 45, 60, noise=math.radians(0.5), seed=3, sight=2.0)
    oracle = bearslam.refine(scene.bearings, scene)
    result = bearslam.solve(scene.bearings, method=method)
    assert result.cost <= oracle.cost * (1 + 1e-5)
    assert result.undetermined == oracle.undetermined
    assert result.components == ()
    assert bearslam.initialize(scene.bearings, method=method).termination == "not_refined"


def test_separate_maps_are_components(tmp_path: Path) -> None:
    scene = bearslam.simulate("mixed", 14, 20, noise=0.0, seed=7)
    bearings = scene.bearings.copy()
    bearings[:6, 9:] = np.nan
    bearings[6:, :9] = np.nan
    result = bearslam.solve(bearings)
    assert result.undetermined == ()
    (other,) = result.components
    assert np.isnan(result.poses[:6]).all()
    assert np.isfinite(result.poses[6:]).all()
    assert np.isfinite(other.poses[:6]).all()
    assert np.isnan(other.poses[6:]).all()
    assert np.isfinite(other.landmarks[:9]).all()
    assert np.isnan(other.landmarks[9:]).all()
    path = tmp_path / "map.json"
    result.save(path)
    saved = json.loads(path.read_text())
    assert len(saved["components"]) == 1
    assert saved["components"][0]["rms"] < 1e-9
