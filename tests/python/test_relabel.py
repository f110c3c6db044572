# SPDX-License-Identifier: MIT OR Apache-2.0
"""Wrong identities put right by a map."""

import numpy as np
import pytest

import bearslam

NOISE = np.radians(0.5)


@pytest.fixture(scope="module")
def exchanged():
    clean = bearslam.simulate("mixed", 12, 15, noise=NOISE, seed=3)
    scene = bearslam.simulate("mixed", 12, 15, noise=NOISE, seed=3, outliers=0.4, outlier_kind="exchanged")
    result = bearslam.solve(scene.bearings, sigma=NOISE, robust=True)
    return clean, scene, result


def test_exchanged_identities_are_put_right(exchanged):
    clean, scene, result = exchanged
    assert result.explained >= 165
    # Three standard deviations leave out one good bearing in 370; few of the exchanged ones agree with their own label.
    assert (result.inliers & scene.outliers).sum() <= 3
    repaired, changes = bearslam.relabel(scene.bearings, result, sigma=NOISE)
    wrong = (repaired != clean.bearings).sum()
    assert wrong <= 0.2 * scene.outliers.sum()
    assert len(changes) == (repaired != scene.bearings).sum()
    for change in changes:
        assert repaired[change.view, change.new] == scene.bearings[change.view, change.old]
    assert not bearslam.relabel(clean.bearings, result, sigma=NOISE)[1]


def test_every_form_is_repaired_in_kind(exchanged):
    _, scene, result = exchanged
    table, changes = bearslam.relabel(scene.bearings, result, sigma=NOISE)
    seen = scene.sightings
    # In another order, with names.
    order = np.random.default_rng(1).permutation(len(seen))
    sightings = bearslam.Sightings(seen.view[order], seen.landmark[order], seen.bearing[order], NOISE)
    repaired, same = bearslam.relabel(sightings, result)
    assert set(same) == set(changes)
    np.testing.assert_array_equal(repaired.bearing, sightings.bearing)
    np.testing.assert_array_equal(repaired.sigma, sightings.sigma)
    np.testing.assert_array_equal(table[repaired.view, repaired.landmark], repaired.bearing)
    names = [f"robot {i}" for i in range(12)], [f"mark {j}" for j in range(15)]
    problem, _ = bearslam.relabel(bearslam.Problem(sightings, *names), result)
    assert (list(problem.view_ids), list(problem.landmark_ids)) == names
    np.testing.assert_array_equal(problem.sightings.landmark, repaired.landmark)


def test_it_needs_a_standard_deviation_and_a_map_of_the_problem(exchanged):
    _, scene, result = exchanged
    with pytest.raises(bearslam.InvalidInputError, match=r"sigma: .* relabel needs"):
        bearslam.relabel(scene.bearings, result)
    with pytest.raises(bearslam.InvalidInputError, match="reconstruction"):
        bearslam.relabel(scene.bearings[:5], result, sigma=NOISE)


def test_random_bearings_that_agree_by_chance_are_warned_of():
    scene = bearslam.simulate("mixed", 12, 15, noise=NOISE, seed=5, outliers=0.48, outlier_kind="exchanged")
    try:
        with pytest.warns(bearslam.PoorFitWarning, match="may agree by chance"):
            result = bearslam.solve(scene.bearings, sigma=NOISE, robust=True)
        assert "weak_consensus" in [finding.name for finding in result.findings]
    except bearslam.DegenerateError as error:
        assert "bearings may be wrong" in str(error)
