# SPDX-License-Identifier: MIT OR Apache-2.0
"""The example of a Kalman filter: its derivatives, its start, and a run of the whole script."""

import importlib.util
import subprocess
import sys
from argparse import Namespace

import numpy as np
import pytest

STEP = 1e-6
POSE = np.array([0.4, -1.2, 2.1])


@pytest.fixture(scope="module")
def ekf(repository):
    spec = importlib.util.spec_from_file_location("ekf_slam", repository / "examples" / "ekf_slam.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["ekf_slam"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    yield module
    del sys.modules["ekf_slam"]


@pytest.fixture(scope="module")
def run(ekf):
    options = Namespace(views=20, landmarks=30, reach=4.0, noise_deg=1.0, odometry=(0.05, 2.0))
    return ekf.simulate(3, options)


def differences(function, at):
    """Derivative of a function by central differences, one column for each number in `at`."""
    at = np.asarray(at, dtype=float)
    columns = []
    for k in range(at.size):
        step = np.zeros(at.size)
        step[k] = STEP
        step = step.reshape(at.shape)
        columns.append((function(at + step) - function(at - step)).ravel() / (2 * STEP))
    return np.column_stack(columns)


def test_motion(ekf):
    motion = np.array([0.5, 0.1, -0.3])
    end, by_pose, by_noise = ekf.move(POSE, motion)
    np.testing.assert_allclose(by_pose, differences(lambda pose: ekf.move(pose, motion)[0], POSE), atol=1e-8)
    noisy = differences(lambda noise: ekf.move(end, noise)[0], np.zeros(3))
    np.testing.assert_allclose(by_noise, noisy, atol=1e-8)


def test_sight(ekf):
    landmarks = np.array([[2.0, 1.0], [-3.0, 0.5], [0.3, -4.0]])
    bearings, by_pose, by_landmark = ekf.sight(POSE, landmarks)
    away = np.exp(1j * (POSE[2] + bearings)) * np.hypot(*(landmarks - POSE[:2]).T)
    np.testing.assert_allclose(landmarks - POSE[:2], np.column_stack([away.real, away.imag]), atol=1e-12)
    np.testing.assert_allclose(by_pose, differences(lambda pose: ekf.sight(pose, landmarks)[0], POSE), atol=1e-8)
    moved = differences(lambda points: ekf.sight(POSE, points)[0], landmarks).reshape(3, 3, 2)
    np.testing.assert_allclose(by_landmark, moved[range(3), range(3)], atol=1e-8)


def test_crossing(ekf):
    poses, point = np.array([POSE, [2.0, 0.3, -0.7]]), np.array([[1.5, 3.0]])
    bearings = np.array([ekf.sight(pose, point)[0][0] for pose in poses])
    found, ranges, by_poses, by_bearings = ekf.cross(poses, bearings)
    np.testing.assert_allclose(found, point[0], atol=1e-12)
    np.testing.assert_allclose(ranges, np.hypot(*(point - poses[:, :2]).T), atol=1e-12)
    np.testing.assert_allclose(by_poses, differences(lambda at: ekf.cross(at, bearings)[0], poses), atol=1e-7)
    np.testing.assert_allclose(by_bearings, differences(lambda at: ekf.cross(poses, at)[0], bearings), atol=1e-7)
    assert (ekf.cross(poses, bearings + np.pi)[1] < 0.0).all()


def test_the_joint_covariance_has_the_blocks_of_bearslam(ekf, run):
    result = ekf.solve_first(run, 15)
    joint = ekf.joint_covariance(result.poses, result.landmarks, run)
    for k, block in enumerate(result.pose_covariance):
        at = slice(3 * k, 3 * k + 3)
        np.testing.assert_allclose(joint[at, at], block, rtol=1e-6, atol=1e-12)
    known = np.flatnonzero(np.isfinite(result.landmarks[:, 0]))
    assert len(known) > 8
    for j in known:
        at = slice(45 + 2 * j, 47 + 2 * j)
        np.testing.assert_allclose(joint[at, at], result.landmark_covariance[j], rtol=1e-6, atol=1e-12)


def test_a_linear_update_is_that_of_least_squares(ekf, run):
    """Adding the bearings of one view to the information is what the update does, to first order, in another form."""
    result = ekf.solve_first(run, 15)
    known, covariance = ekf.state_of(result, run, blocks=False)
    filtered = ekf.Filter(len(known), run.sigma, run.reach, (0.9, 0.1))
    filtered.start(result.poses[-1], result.landmarks, known, covariance)
    seen = np.flatnonzero(np.isfinite(run.bearings[14]) & known)
    predicted, by_pose, by_landmark = ekf.sight(result.poses[-1], result.landmarks[seen])
    order = np.cumsum(known) - 1
    jacobian = np.zeros((len(seen), len(covariance)))
    jacobian[:, :3] = by_pose
    for row, j in enumerate(seen):
        jacobian[row, 3 + 2 * order[j] : 5 + 2 * order[j]] = by_landmark[row]
    information = np.linalg.inv(covariance) + jacobian.T @ jacobian / run.sigma**2
    moved = np.linalg.solve(information, jacobian.T @ (0.01 * np.ones(len(seen))) / run.sigma**2)

    bearings = np.full(len(known), np.nan)
    bearings[seen] = predicted + 0.01
    filtered.update(bearings)
    where = np.append([0, 1, 2], filtered.at[known].ravel())
    before = np.append(result.poses[-1], result.landmarks[known].ravel())
    np.testing.assert_allclose(filtered.mean[where] - before, moved, atol=1e-8)
    found = filtered.covariance[np.ix_(where, where)]
    np.testing.assert_allclose(found, np.linalg.inv(information), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("entry", ["guess", "parallax"])
def test_a_landmark_enters_with_the_covariance_of_what_it_comes_from(ekf, entry):
    """Against errors drawn at random, small enough to be linear."""
    sigma, reach, mean, spread = 1e-5, 4.0, 0.5, 1e-5
    noise, motion = np.array([1e-5, 2e-5, 1e-5]), np.array([1.5, -0.2, 0.4])
    random = np.random.default_rng(5)
    errors = []
    for _ in range(2000):
        filtered = ekf.Filter(1, sigma, reach, (mean, spread) if entry == "guess" else None)
        pose, landmark = np.zeros(3), None
        for _ in range(1 if entry == "guess" else 2):
            assert not filtered.known.any()
            pose = ekf.move(ekf.move(pose, motion)[0], -noise * random.normal(size=3))[0]
            filtered.predict(motion, noise)
            if landmark is None:
                range_, angle = reach * random.normal(mean, spread), pose[2] + 0.8
                landmark = pose[:2] + range_ * np.array([np.cos(angle), np.sin(angle)])
            filtered.update(ekf.sight(pose, landmark[None])[0] + random.normal(0.0, sigma))
        assert filtered.known.all()
        errors.append(filtered.mean[:5] - np.append(pose, landmark))
    assert not filtered.covariance[5:].any()
    whitened = np.linalg.solve(np.linalg.cholesky(filtered.covariance[:5, :5]), np.transpose(errors))
    # The covariance of 2000 draws differs from the true one by 0.03 or so.
    np.testing.assert_allclose(np.cov(whitened), np.eye(5), atol=0.15)


def test_the_script(repository, tmp_path):
    command = [sys.executable, repository / "examples" / "ekf_slam.py", "--runs", "3", "--views", "30", "--output"]
    outputs = [
        subprocess.run([*command, name], cwd=tmp_path, capture_output=True, text=True, check=True)
        for name in ("ekf.svg", "ekf.png")
    ]
    assert outputs[0].stderr == ""
    assert outputs[0].stdout == outputs[1].stdout
    assert (tmp_path / "ekf.svg").read_text().startswith("<?xml")
    assert (tmp_path / "ekf.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ekf.png", "ekf.svg"]
    figures = {}
    for line in outputs[0].stdout.splitlines()[3:]:
        *start, entry = line[:26].split()
        figures[" ".join(start), entry] = [float(figure) for figure in line[26:].split()]
    assert len(figures) == 6
    for (start, entry), (early, _, late, _, landmarks, early_nees, *_, beyond, lost) in figures.items():
        assert 0.0 <= beyond <= 100.0
        assert 0.0 <= lost <= 100.0
        if start != "blind":
            blind = figures["blind", entry]
            assert early < blind[0]
            assert early_nees < 11.8
        if (start, entry) == ("bearslam", "parallax"):
            assert late < figures["blind", "guess"][2]
            assert landmarks < figures["blind", "guess"][4]


@pytest.mark.parametrize(
    "wrong",
    [
        ["--runs", "0"],
        ["--seed", "-1"],
        ["--first", "2"],
        ["--first", "90"],
        ["--noise-deg", "nan"],
        ["--odometry", "0", "1"],
        ["--output", "ekf.txt"],
        ["--output", "nowhere/ekf.svg"],
    ],
    ids=" ".join,
)
def test_wrong_options_are_refused(ekf, wrong, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["ekf_slam.py", *wrong])
    with pytest.raises(SystemExit, match="2"):
        ekf.main()
    assert wrong[0] in capsys.readouterr().err
