# SPDX-License-Identifier: MIT OR Apache-2.0
"""The test of the fit: against numpy and scipy, and what is said where."""

import json
import warnings

import numpy as np
import pytest
from scipy import stats

import bearslam
from bearslam.cli.main import main


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def wrapped(angle):
    return np.angle(np.exp(1j * angle))


def whitened(result):
    """Weighted residuals, their derivatives by the parameters of a map, and the number of rows of each observation."""
    views, landmarks = len(result.poses), len(result.landmarks)
    rows, residuals, counts = [], [], []

    def add(jacobian, residual, sigma):
        known = np.isfinite(sigma)
        rows.extend(jacobian[known] / sigma[known, None])
        residuals.extend(residual[known] / sigma[known])
        counts.append(int(known.sum()))

    seen = result.sightings
    for view, landmark, bearing, sigma in zip(seen.view, seen.landmark, seen.bearing, seen.sigma, strict=True):
        step = result.landmarks[landmark] - result.poses[view, :2]
        across = np.array([-step[1], step[0]]) / (step @ step)
        row = np.zeros(3 * views + 2 * landmarks)
        row[3 * view : 3 * view + 3] = [*-across, -1.0]
        row[3 * views + 2 * landmark :][:2] = across
        residual = wrapped(np.arctan2(step[1], step[0]) - result.poses[view, 2] - bearing)
        add(row[None], np.array([residual]), np.array([sigma]))
    for start, end, delta, sigma in zip(
        *(getattr(result.odometry, n) for n in ("start", "end", "delta", "sigma")), strict=True
    ):
        first, last = result.poses[start], result.poses[end]
        back = rotation(first[2] + delta[2]).T
        step = last[:2] - first[:2]
        block = np.zeros((3, 3 * views + 2 * landmarks))
        block[:2, 3 * end : 3 * end + 2] = back
        block[:2, 3 * start : 3 * start + 2] = -back
        block[:2, 3 * start + 2] = np.array([[0, 1], [-1, 0]]) @ back @ step
        block[2, [3 * end + 2, 3 * start + 2]] = 1.0, -1.0
        residual = [*(back @ step - rotation(delta[2]).T @ delta[:2]), wrapped(last[2] - first[2] - delta[2])]
        add(block, np.array(residual), sigma)
    known = result.pose_priors
    for view, pose, sigma in zip(known.view, known.pose, known.sigma, strict=True):
        block = np.zeros((3, 3 * views + 2 * landmarks))
        block[:, 3 * view : 3 * view + 3] = np.eye(3)
        offset = result.poses[view] - pose
        add(block, np.array([*offset[:2], wrapped(offset[2])]), sigma)
    beacons = result.landmark_priors
    for landmark, place, sigma in zip(beacons.landmark, beacons.position, beacons.sigma, strict=True):
        block = np.zeros((2, 3 * views + 2 * landmarks))
        block[:, 3 * views + 2 * landmark :][:, :2] = np.eye(2)
        add(block, result.landmarks[landmark] - place, sigma)
    return np.array(residuals), np.array(rows), counts


def surveyed(seed):
    """A problem with odometry and priors of all kinds."""
    noise, sigma = 0.01, (0.03, 0.02, 0.01)
    scene = bearslam.simulate("mixed", 6, 9, noise=noise, seed=seed)
    random = np.random.default_rng(seed)
    poses = scene.poses[[0, 3, 4]] + random.normal(size=(3, 3)) * [0.1, 0.1, 0.02]
    sigmas = [[0.1, 0.1, 0.02], [0.1, np.inf, np.inf], [np.inf, np.inf, 0.02]]
    beacons = scene.landmarks[[1, 5]] + random.normal(size=(2, 2)) * 0.05
    return bearslam.solve(
        scene.bearings,
        sigma=noise,
        odometry=scene.odometry(sigma, seed=seed),
        pose_priors=bearslam.PosePriors([0, 3, 4], poses, sigmas),
        landmark_priors=bearslam.LandmarkPriors([1, 5], beacons, 0.05),
    )


def test_redundancy_and_tests_are_those_of_numpy_and_scipy():
    checked = 0
    for seed in range(100):
        result = surveyed(seed)
        if result.undetermined or result.components:
            continue
        checked += 1
        residuals, rows, counts = whitened(result)
        assert result.freedom == len(residuals) - rows.shape[1]
        assert result.sigma0 == pytest.approx(np.sqrt(residuals @ residuals / result.freedom), rel=1e-8)
        assert result.p_value == pytest.approx(stats.chi2.sf(residuals @ residuals, result.freedom), rel=1e-7)
        # The projection on what no parameter explains.
        basis = np.linalg.qr(rows)[0]
        spare = np.eye(len(rows)) - basis @ basis.T
        places = np.split(np.arange(len(rows)), np.cumsum(counts)[:-1])
        redundancy = [np.trace(spare[np.ix_(k, k)]) / len(k) for k in places]
        squares = [residuals[k] @ np.linalg.pinv(spare[np.ix_(k, k)], rcond=1e-6) @ residuals[k] for k in places]
        numbers = np.concatenate([per_sighting(result, result.redundancy), *priors(result.redundancy)])
        assert numbers == pytest.approx(redundancy, abs=1e-8)
        told = np.concatenate(
            [per_sighting(result, result.standardized_residuals), *priors(result.standardized_residuals)]
        )
        tails = [stats.chi2.sf(square, len(k)) for square, k in zip(squares, places, strict=True)]
        # What nothing checks has none.
        assert np.array_equal(np.isnan(told), np.array(redundancy) < 1e-3)
        controlled = np.isfinite(told)
        assert np.abs(told[controlled]) == pytest.approx(stats.norm.isf(0.5 * np.array(tails)[controlled]), abs=1e-6)
    assert checked > 90


def per_sighting(result, table):
    return table.sightings[result.sightings.view, result.sightings.landmark]


def priors(table):
    return table.odometry, table.pose_priors, table.landmark_priors


def test_standardized_residuals_are_standard_normal():
    random, drawn = np.random.default_rng(1), []
    for seed in range(300):
        result = bearslam.solve(bearslam.simulate("mixed", 7, 12, noise=0.01, seed=seed).bearings, sigma=0.01)
        values = result.standardized_residuals.sightings.ravel()
        drawn.append(random.choice(values[np.isfinite(values)]))
    assert stats.kstest(drawn, "norm").pvalue > 0.01


def test_expected_error_is_the_error_on_average():
    shares = []
    for seed in range(40):
        scene = bearslam.simulate("enclosed", 10, 14, noise=0.01, seed=seed)
        result = bearslam.solve(scene.bearings, sigma=0.01)
        if result.undetermined:
            continue
        aligned = bearslam.align(result.landmarks, scene.landmarks).apply(result.landmarks)
        error = np.sqrt(np.square(aligned - scene.landmarks).sum(axis=1).mean())
        radius = np.sqrt(np.square(scene.landmarks - scene.landmarks.mean(axis=0)).sum(axis=1).mean())
        shares.append((error / radius / result.expected_error) ** 2)
    assert 0.5 < np.mean(shares) < 1.5
    # Whatever the unit of the weights.
    told = bearslam.solve(scene.bearings, sigma=0.001).expected_error
    assert bearslam.solve(scene.bearings).expected_error == pytest.approx(told, rel=1e-6)


def wrong_bearing():
    scene = bearslam.simulate("mixed", 7, 14, noise=0.01, seed=5)
    bearings = scene.bearings.copy()
    bearings[2, 6] += 0.5
    return scene, bearings


def test_solve_warns_of_a_wrong_bearing_and_names_it(tmp_path, capsys):
    scene, bearings = wrong_bearing()
    with pytest.warns(bearslam.PoorFitWarning, match="the bearing of landmark 6 from view 2 contradicts the others"):
        result = bearslam.solve(bearings, sigma=0.01)
    assert [one.name for one in result.findings if one.views == (2,)] == ["blunder"]
    with pytest.warns(bearslam.PoorFitWarning, match=r"residuals are \d.* times as large"):
        bearslam.refine(bearings, scene, sigma=0.01)
    path, saved = tmp_path / "scene.csv", tmp_path / "map.json"
    bearslam.save(bearings, path)
    assert main(["solve", str(path), "--sigma-deg", "0.57", "-o", str(saved)]) == 0
    assert "warning: the bearing of landmark 6 from view 2 contradicts" in capsys.readouterr().err
    written = json.loads(saved.read_text())
    assert written["p_value"] < 1e-6
    assert written["findings"][0]["severity"] == "warning"


def test_a_right_fit_and_one_without_sigma_come_without_a_warning():
    scene, bearings = wrong_bearing()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        right = bearslam.solve(scene.bearings, sigma=0.01)
        untold = bearslam.solve(bearings)
        robust = bearslam.solve(bearings, sigma=0.01, robust=True)
        close = bearslam.solve(scene.bearings, sigma=0.007)
    assert right.findings == untold.findings == robust.findings == ()
    assert 0.8 < right.sigma0 < 1.2
    assert np.isnan(untold.p_value)
    assert [one.name for one in close.findings] == ["understated_sigma"]
    assert bearslam.diagnose(bearings, robust, sigma=0.01).findings == ()
    names = [one.name for one in bearslam.diagnose(bearings, sigma=0.01).findings]
    assert names == ["poor_fit", "blunder"]


def test_other_maps_and_refinements_that_end_too_early_come_with_a_warning():
    others = [bearslam.simulate("mixed", 3, 6, noise=0.01, seed=seed).bearings for seed in range(10)]
    ambiguous = next(one for one in others if bearslam.solve(one, sigma=0.01).alternatives)
    with pytest.warns(bearslam.AmbiguousWarning, match="another map explains"):
        bearslam.solve(ambiguous, sigma=0.01)
    scene = bearslam.simulate("mixed", 8, 12, noise=0.1, seed=1)
    short = bearslam.RefineOptions(max_iterations=1, tolerance=0.0)
    with pytest.warns(bearslam.NotConvergedWarning, match="raise max_iterations"):
        bearslam.refine(scene.bearings, scene, refinement=short)
