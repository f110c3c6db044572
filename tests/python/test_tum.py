# SPDX-License-Identifier: MIT OR Apache-2.0
"""Trajectories in the format of the TUM benchmark, read back with NumPy."""

import numpy as np
import pytest

import bearslam
from bearslam import InvalidInputError
from bearslam.cli.main import main

NOISE = np.radians(0.5)


def parsed(path):
    """Times, poses and comments of a file."""
    rows = np.loadtxt(path, ndmin=2)
    assert rows.shape[1] == 8
    time, x, y, z, qx, qy, qz, qw = rows.T
    assert not np.any([z, qx, qy])
    np.testing.assert_allclose(np.hypot(qz, qw), 1.0)
    comments = [line for line in path.read_text().splitlines() if line.startswith("#")]
    return time, np.column_stack([x, y, 2 * np.arctan2(qz, qw)]), comments


def problem(names, start=None):
    scene = bearslam.simulate("enclosed", 6, 9, noise=NOISE, seed=2)
    given = None if start is None else (scene.poses if start is True else start, scene.landmarks)
    return scene, bearslam.Problem(scene.sightings, names, map(str, range(9)), start=given)


def test_times_are_those_of_the_names_and_in_order(tmp_path):
    times = [1248446203.125, 1248446201.5, 1248446202.0, 1248446200.393, 1248446209.0, 1248446204.0]
    _, given = problem([f"3@{time}" for time in times])
    result = bearslam.solve(given, sigma=NOISE)
    path = tmp_path / "map.tum"
    result.save(path)
    time, poses, comments = parsed(path)
    order = np.argsort(times)
    np.testing.assert_array_equal(time, np.array(times)[order])
    np.testing.assert_allclose(np.exp(1j * poses[:, 2]), np.exp(1j * result.poses[order, 2]), atol=1e-12)
    np.testing.assert_array_equal(poses[:, :2], result.poses[order, :2])
    assert comments == ["# timestamp tx ty tz qx qy qz qw"]


def test_plain_numbers_are_times(tmp_path):
    _, given = problem(["0.5", "0.1", "2", "3", "4", "5"], start=True)
    bearslam.save(given, tmp_path / "map.tum")
    assert parsed(tmp_path / "map.tum")[0].tolist() == [0.1, 0.5, 2, 3, 4, 5]


@pytest.mark.parametrize("names", [["a", "b", "c", "d", "e", "f"], ["9", "8", "7", "6", "5", "north"]])
def test_without_times_views_are_numbered(tmp_path, names):
    scene, given = problem(names, start=True)
    bearslam.save(given, tmp_path / "map.tum")
    time, poses, _ = parsed(tmp_path / "map.tum")
    assert time.tolist() == [0, 1, 2, 3, 4, 5]
    np.testing.assert_array_equal(poses[:, :2], scene.poses[:, :2])


def test_an_array_has_numbers(tmp_path):
    scene, _ = problem(list("abcdef"))
    bearslam.solve(scene.bearings).save(tmp_path / "map.tum")
    assert parsed(tmp_path / "map.tum")[0].tolist() == [0, 1, 2, 3, 4, 5]


def test_one_robot_of_several(tmp_path):
    path = tmp_path / "map.tum"
    scene, given = problem(["1@5", "1@4", "2@4", "2@3", "2@7", "10@1"], start=True)
    with pytest.raises(InvalidInputError, match=r"robot: expected one of \['1', '2', '10'\], got none"):
        bearslam.save(given, path)
    with pytest.raises(InvalidInputError, match=r"robot: expected one of \['1', '2', '10'\], got '3'"):
        bearslam.save(given, path, robot="3")
    assert not path.exists()
    bearslam.save(given, path, robot=2)
    time, poses, _ = parsed(path)
    assert time.tolist() == [3, 4, 7]
    np.testing.assert_array_equal(poses[:, :2], scene.poses[[3, 2, 4], :2])
    bearslam.solve(given).save(path, robot="10")
    assert parsed(path)[0].tolist() == [1]


def test_what_is_undetermined_is_counted(tmp_path):
    scene, given = problem(list("abcdef"))
    known = scene.poses.copy()
    known[[0, 3]] = np.nan
    _, given = problem(list("abcdef"), start=known)
    bearslam.save(given, tmp_path / "map.tum")
    time, _, comments = parsed(tmp_path / "map.tum")
    assert time.tolist() == [1, 2, 4, 5]
    assert comments[1] == "# 2 of 6 views have no pose and are left out"
    _, given = problem(list("abcdef"), start=np.full((6, 3), np.nan))
    with pytest.raises(InvalidInputError, match="expected views with a pose, got none"):
        bearslam.save(given, tmp_path / "none.tum")


def test_what_has_no_poses(tmp_path):
    scene, given = problem(list("abcdef"))
    for what in (given, scene.bearings, scene.sightings):
        with pytest.raises(InvalidInputError, match="what: expected a reconstruction, or a problem with a start"):
            bearslam.save(what, tmp_path / "map.tum")


def test_a_robot_is_for_trajectories(tmp_path):
    _, given = problem(["1@5", "1@4", "2@4", "2@3", "2@7", "10@1"], start=True)
    for what, name in ((given, "a.csv"), (bearslam.solve(given), "a.json")):
        with pytest.raises(InvalidInputError, match=r"robot: applies to trajectories \(.tum\) only"):
            bearslam.save(what, tmp_path / name, robot=1)


def test_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    _, given = problem(["1@5", "1@4", "2@4", "2@3", "2@7", "2@1"])
    bearslam.save(given, "scene.csv")
    assert main(["solve", "scene.csv", "-o", "map.tum", "--robot", "2"]) == 0
    assert parsed(tmp_path / "map.tum")[0].tolist() == [1, 3, 4, 7]
    assert main(["solve", "scene.csv", "-o", "map.tum"]) == 1
    assert "robot: expected one of ['1', '2'], got none" in capsys.readouterr().err
    assert main(["solve", "scene.csv", "-o", "map.txt"]) == 1
    assert ".tum" in capsys.readouterr().err
