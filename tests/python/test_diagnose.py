# SPDX-License-Identifier: MIT OR Apache-2.0
"""What is wrong with bearings, by name."""

import copy
import json
import pickle

import numpy as np
import pytest

import bearslam
from bearslam.cli.main import main

EXPECTED = {
    "two views": "two_views",
    "three views of four landmarks": "counting",
    "three landmarks": "too_few_landmarks",
    "three collinear poses": "three_collinear_views",
    "two coincident poses of three": "coincident_views",
    "four landmarks on a circle": "four_landmarks_on_a_circle",
    "collinear landmarks": "collinear_landmarks",
    "poses on one line, landmarks on another": "lines_of_views_and_of_landmarks",
    "everything on one line": "everything_on_one_line",
    "everything on one circle": "views_and_landmarks_on_one_circle",
    "three poses and all landmarks on one circle": "three_views_and_landmarks_on_one_circle",
}


def exact(poses, landmarks):
    """Bearings of all landmarks from all poses."""
    offset = landmarks[None] - poses[:, None, :2]
    return np.angle(np.exp(1j * (np.arctan2(offset[..., 1], offset[..., 0]) - poses[:, 2:])))


def wall():
    """Five views of eight landmarks along a wall."""
    poses = np.array([[0.0, 0, 0.3], [1.1, 0.6, 1], [2, -0.4, 2], [-1.2, 0.3, -1], [-2.1, -0.2, 0.1]])
    return poses, np.column_stack([np.linspace(-3, 3, 8), np.full(8, 2.0)])


def test_every_measured_configuration(own):
    """The numbers of free directions counted by another program, by the expected names of the findings."""
    seen = set()
    for record in own["counting"]:
        poses, landmarks = np.array(record["poses"]), np.array(record["landmarks"])
        bearings = exact(poses, landmarks)
        name = EXPECTED.get(record["name"])
        given = bearslam.diagnose(bearings, (poses, landmarks))
        assert given.extra == record["extra"], record["name"]
        for found in (given, bearslam.diagnose(bearings)):
            if name is None:
                assert found.determined, record["name"]
            else:
                assert name in [finding.name for finding in found.findings], record["name"]
                assert not found.determined
        seen.add(name)
    assert seen == {None, *EXPECTED.values()}


def test_what_it_carries():
    poses, landmarks = wall()
    found = bearslam.diagnose(exact(poses, landmarks), (poses, landmarks))
    (finding,) = found.findings
    assert finding.name == "collinear_landmarks"
    assert finding.severity == "error"
    assert finding.landmarks == tuple(range(8))
    assert finding.directions == found.extra == 1
    assert str(finding) in str(found)
    (direction,) = found.null_directions
    assert direction.free
    assert direction.deviation == np.inf
    assert direction.cause == finding.name
    assert sum(mover.share for mover in direction.movers) == pytest.approx(1, abs=0.1)
    (part,) = found.components
    assert (len(part.views), len(part.landmarks), part.sightings, part.freedom) == (5, 8, 40, 13)
    assert found.singular_values[0] < 1e-9 < found.singular_values[1]
    assert 1 < found.condition < 1e4
    assert "not determined" in repr(found)


def test_noise_is_stated_or_told_by_the_residuals():
    scene = bearslam.simulate("mixed", 6, 12, noise=0.004, seed=3)
    assert bearslam.diagnose(scene.bearings, sigma=0.004).noise == pytest.approx(0.004)
    assert bearslam.diagnose(scene.bearings).noise == pytest.approx(0.004, rel=0.3)


def test_a_solution_is_a_map():
    scene = bearslam.simulate("enclosed", 6, 12, noise=0.004, seed=3)
    found = bearslam.diagnose(scene.bearings, bearslam.solve(scene.bearings))
    assert found.determined
    assert found.findings == ()
    assert found.null_directions == ()


def test_who_sees_too_little():
    scene = bearslam.simulate("mixed", 6, 12, noise=0.0, seed=3)
    bearings = scene.bearings.copy()
    bearings[1:, 4] = np.nan
    (finding,) = bearslam.diagnose(bearings).findings
    assert (finding.name, finding.views, finding.landmarks) == ("too_few_sightings", (), (4,))


@pytest.mark.parametrize("bearings", [[[0.3]], np.zeros((2, 7)), np.zeros((5, 8)), np.eye(6)])
def test_it_never_fails(bearings):
    assert bearslam.diagnose(bearings).findings


def test_the_error_carries_it():
    with pytest.raises(bearslam.DegenerateError) as caught:
        bearslam.solve(exact(*wall()))
    found = caught.value.diagnosis
    assert found.findings[0].name == "collinear_landmarks"
    for twin in (copy.copy(caught.value), pickle.loads(pickle.dumps(caught.value))):
        assert str(twin.diagnosis) == str(found)
    assert bearslam.DegenerateError("no map", kind="no_hypothesis", value=1.5, bound=2.0).diagnosis is None


def test_wrong_arguments():
    scene = bearslam.simulate("mixed", 4, 7, noise=0.0, seed=3)
    with pytest.raises(bearslam.InvalidInputError, match="reconstruction"):
        bearslam.diagnose(scene.bearings, (scene.poses[:3], scene.landmarks))
    with pytest.raises(bearslam.InvalidInputError, match="sigma"):
        bearslam.diagnose(scene.bearings, sigma=-1.0)


def test_command(tmp_path, capsys):
    path = tmp_path / "wall.csv"
    sightings = bearslam.Sightings(*(index.ravel() for index in np.indices((5, 8))), exact(*wall()).ravel())
    bearslam.save(bearslam.Problem(sightings, "abcde", [f"door {k}" for k in range(8)]), path)
    assert main(["diagnose", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("40 sightings of 8 landmarks from 5 views: not determined")
    assert lines[1].startswith("error (collinear_landmarks): landmarks 0..7 lie on one line")
    assert lines[-1].startswith("landmarks: 0 door 0, 1 door 1")
    assert main(["diagnose", str(path), "--sigma-deg", "0"]) == 1
    assert "--sigma-deg" in capsys.readouterr().err


def test_command_prints_json(tmp_path, capsys):
    path = tmp_path / "wall.csv"
    sightings = bearslam.Sightings(*(index.ravel() for index in np.indices((5, 8))), exact(*wall()).ravel())
    bearslam.save(bearslam.Problem(sightings, "abcde", [f"door {k}" for k in range(8)]), path)
    assert main(["diagnose", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert found["determined"] is False
    assert found["findings"][0]["name"] == "collinear_landmarks"
    assert found["findings"][0]["landmarks"] == list(range(8))
    assert found["components"] == [
        {"views": [0, 1, 2, 3, 4], "landmarks": list(range(8)), "sightings": 40, "freedom": 13}
    ]
    assert found["landmark_ids"][3] == "door 3"
    free = [one for one in found["null_directions"] if one["free"]]
    assert free
    assert all(one["deviation"] is None for one in free)
    assert found["mirror_margin"] is None or found["mirror_margin"] > 1
    same = bearslam.diagnose(bearslam.load(path)).to_dict()
    assert {**same, "view_ids": list("abcde"), "landmark_ids": found["landmark_ids"]} == found
