# SPDX-License-Identifier: MIT OR Apache-2.0
"""True maps in files, in the order of a problem, and what the command line reports on them."""

import gzip
import json
import re

import numpy as np
import pytest

import bearslam
from bearslam import InvalidInputError, load_truth
from bearslam.cli.main import main
from bearslam.data.maps import compare
from bearslam.io.files import save_truth

NOISE = np.radians(0.5)
HEADER = "# a\n"


@pytest.fixture
def scene():
    return bearslam.simulate("enclosed", 6, 9, noise=NOISE, seed=2)


@pytest.mark.parametrize("suffix", [".json", ".csv"])
def test_truth_of_a_simulation(scene, tmp_path, suffix):
    path = tmp_path / f"truth{suffix}"
    save_truth(scene, path)
    truth = load_truth(path, scene.bearings)
    np.testing.assert_array_equal(truth.poses, scene.poses)
    np.testing.assert_array_equal(truth.landmarks, scene.landmarks)


@pytest.mark.parametrize("suffix", [".json", ".csv"])
def test_a_reconstruction_is_found_by_names_in_another_order(scene, tmp_path, suffix):
    path = tmp_path / f"map{suffix}"
    sightings = scene.sightings
    views, landmarks = [f"view, {i}" for i in range(7)], [f"#{j}" for j in range(10)]
    names = bearslam.Problem(sightings, views, landmarks)  # the last of each is seen by nobody
    result = bearslam.solve(names)
    result.save(path)
    turned = bearslam.Problem(
        bearslam.Sightings(5 - sightings.view, 8 - sightings.landmark, sightings.bearing),
        [*views[5::-1], "another", "view, 6"],
        [*landmarks[8::-1], "#9"],
    )
    truth = load_truth(path, turned)
    np.testing.assert_array_equal(truth.poses[:6], result.poses[5::-1])
    np.testing.assert_array_equal(truth.landmarks[:9], result.landmarks[8::-1])
    assert np.isnan(truth.poses[6:]).all()
    assert np.isnan(truth.landmarks[9:]).all()


def test_a_heading_may_be_unknown(scene, tmp_path):
    path = tmp_path / "map.csv"
    path.write_text("kind,id,x,y,theta\nview,0,1,2,\nview,1,nan,2,0.5\n\n# more\nlandmark,0,3,4,\n")
    truth = load_truth(path, scene.bearings)
    np.testing.assert_array_equal(truth.poses[0], [1, 2, np.nan])
    assert np.isnan(truth.poses[1:]).all()
    np.testing.assert_array_equal(truth.landmarks[0], [3, 4])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "map.csv: expected a map, got an empty file"),
        ("view,landmark,bearing\n", "map.csv:1: expected a header kind,id,x,y,theta"),
        ("kind,id,x,y,theta\nview,0,1,2\n", "map.csv:2: expected view or landmark, id"),
        ("kind,id,x,y,theta\nrobot,0,1,2,3\n", "map.csv:2: expected view or landmark, id"),
        ("kind,id,x,y,theta\nview,,1,2,3\n", "map.csv:2: expected view or landmark, id"),
        ("kind,id,x,y,theta\n\nview,0,1,two,3\n", "map.csv:3: expected a finite number or nan as y, got 'two'"),
        ("kind,id,x,y,theta\nview,0,inf,2,3\n", "map.csv:2: expected a finite number or nan as x, got 'inf'"),
        ("kind,id,x,y,theta\nview,0,1_0,2,3\n", "map.csv:2: expected a finite number or nan as x, got '1_0'"),
        ("kind,id,x,y,theta\nlandmark,0,1,2,3\n", "map.csv:2: expected no theta of a landmark, got '3'"),
        ("kind,id,x,y,theta\nview,0,1,2,3\nview,0,1,2,3\n", "map.csv:3: expected every id once, got '0' again"),
        ('kind,id,x,y,theta\nview,"0,1,2,3\n', "map.csv:2: "),
        ("kind,id,x,y,theta\nview,a,1,2,3\n", "map.csv: expected views or landmarks of the problem, got none of them"),
        (b"\xff\xfe\x00", "map.csv:1: expected text in UTF-8"),
    ],
)
def test_damaged_csv(scene, tmp_path, text, message):
    path = tmp_path / "map.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        load_truth(path, scene.bearings)


VIEW, POINT = {"id": 0, "x": 1, "y": 2, "theta": 3}, {"id": "0", "x": 1.5, "y": None}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "map.json:1: expected JSON: "),
        ('{\n"views": [],\n,', "map.json:3: expected JSON: "),
        ("[" * 100_000, "map.json: expected JSON"),
        ('{"views": [{"id": 0, "x": ' + "9" * 5000 + "}]}", "map.json: expected JSON"),
        ([1], "map.json: expected a JSON object with views and landmarks, got [1]"),
        ({"views": []}, "map.json: expected a list of landmarks, got None"),
        ({"views": {}, "landmarks": []}, "map.json: expected a list of views, got {}"),
        ({"views": [5], "landmarks": []}, "map.json: views[0]: expected an object with an id, got 5"),
        ({"views": [{"id": True}], "landmarks": []}, "map.json: views[0]: expected an object with an id"),
        ({"views": [VIEW, VIEW], "landmarks": []}, "map.json: views[1]: expected every id once, got '0' again"),
        ({"views": [POINT], "landmarks": []}, "map.json: views[0]: expected a number or null as theta, got none"),
        (
            {"views": [], "landmarks": [POINT | {"x": "1"}]},
            "landmarks[0]: x: expected a finite number or null, got '1'",
        ),
        ({"views": [], "landmarks": [POINT | {"x": True}]}, "landmarks[0]: x: expected a finite number or null"),
        ({"views": [], "landmarks": [POINT | {"x": np.inf}]}, "landmarks[0]: x: expected a finite number or null"),
        ({"views": [], "landmarks": [POINT | {"x": 10**400}]}, "landmarks[0]: x: expected a finite number or null"),
        ({"views": [], "landmarks": [POINT]}, "expected views or landmarks of the problem, got none of them"),
    ],
    ids=range(16),
)
def test_damaged_json(scene, tmp_path, content, message):
    path = tmp_path / "map.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        load_truth(path, scene.bearings)


def test_other_names_and_no_file(scene, tmp_path):
    with pytest.raises(InvalidInputError, match=r"expected a name that ends in .json or .csv or .g2o, or a folder"):
        load_truth(tmp_path / "map.txt", scene.bearings)
    with pytest.raises(FileNotFoundError):
        load_truth(tmp_path / "map.csv", scene.bearings)


@pytest.fixture
def folder(tmp_path):
    """Motion capture every 0.1 s from 10 to 13 s, with a gap of 0.6 s from 11.2 s, of a robot that turns through pi."""
    times = [t for t in np.arange(10, 13.05, 0.1).round(3).tolist() if not 11.25 < t < 11.75]
    rows = [f"{t} {t - 10} {2 * (t - 10)} {np.angle(np.exp(1j * (3.0 + 0.1 * (t - 10))))}\n" for t in times]
    (tmp_path / "Robot3_Groundtruth.dat").write_text(HEADER + "".join(rows))
    (tmp_path / "Landmark_Groundtruth.dat").write_text(HEADER + "7 1.0 2.0 0.1 0.1\n8 3.0 4.0 0.1 0.1\n")
    return tmp_path


def captured(*times):
    names = [*(f"3@{t}" for t in times), "north", "12.0"]
    return bearslam.Problem(bearslam.Sightings([0], [0], [0.1]), names, ["8", "9", "7"])


def test_motion_capture_is_interpolated(folder):
    times = (9.99, 10.0, 11.43, 11.2, 11.8, 12.345, 13.0, 13.01)
    truth = load_truth(folder, captured(*times))
    known = [1, 3, 4, 5, 6]
    assert np.flatnonzero(np.isfinite(truth.poses).all(axis=1)).tolist() == known
    for i in known:
        t = times[i] - 10
        np.testing.assert_allclose(truth.poses[i], [t, 2 * t, np.angle(np.exp(1j * (3.0 + 0.1 * t)))], atol=1e-9)
    np.testing.assert_array_equal(truth.landmarks, [[3, 4], [np.nan, np.nan], [1, 2]])


def test_headings_go_the_shorter_way(folder):
    (folder / "Robot3_Groundtruth.dat").write_text("10.0 0 0 3.1\n10.2 0 0 -3.1\n")
    pose = load_truth(folder, captured(10.1)).poses[0]
    assert abs(pose[2]) == pytest.approx(np.pi)


def test_a_single_true_pose(folder):
    (folder / "Robot3_Groundtruth.dat").write_text("10.0 1 2 3\n")
    truth = load_truth(folder, captured(10.0, 10.1))
    np.testing.assert_array_equal(truth.poses[0], [1, 2, 3])
    assert np.isnan(truth.poses[1]).all()


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("Robot3_Groundtruth.dat", "10.0 1 2 3\n9.0 1 2 3\n", "dat:2: expected a time no earlier than"),
        ("Robot3_Groundtruth.dat", "10.0 1 2\n", "dat:1: expected 4 numbers (time, x, y, orientation), got '10.0 1 2'"),
        ("Landmark_Groundtruth.dat", "7 1 2 0.1 0.1\n7 1 2 0.1 0.1\n", "dat:2: expected every subject once, got 7"),
        ("Landmark_Groundtruth.dat", "7.5 1 2 0.1 0.1\n", "dat:1: expected a whole number as subject, got 7.5"),
        ("Landmark_Groundtruth.dat", None, "expected a file Landmark_Groundtruth.dat"),
        ("Robot3_Groundtruth.dat", None, "expected a file Robot3_Groundtruth.dat"),
    ],
)
def test_damaged_folder(folder, name, text, message):
    if text is None:
        (folder / name).unlink()
    else:
        (folder / name).write_text(text)
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        load_truth(folder, captured(10.0))


@pytest.mark.parametrize("suffix", [".json", ".csv"])
def test_command_line(tmp_path, monkeypatch, capsys, suffix):
    monkeypatch.chdir(tmp_path)
    truth = f"truth{suffix}"
    assert main(["simulate", "enclosed", "6", "9", "--seed", "2", "-o", "scene.csv", "--truth", truth]) == 0
    assert main(["solve", "scene.csv", "--truth", truth, "--plot", "map.svg", "-o", "map.json"]) == 0
    printed = capsys.readouterr().out
    problem = bearslam.load("scene.csv")
    found = compare(bearslam.solve(problem), load_truth(truth, problem))
    line = next(line for line in printed.splitlines() if line.startswith("errors"))
    assert f"9 landmarks {found.landmark:.4g} rms ({100 * found.landmark / found.radius:.2g} % of the radius" in line
    assert f"6 positions {found.position:.4g} rms" in line
    assert f"headings {np.degrees(found.heading):.4g} deg rms" in line
    assert main(["solve", "scene.csv", "--plot", "alone.svg", "-o", "map.json"]) == 0
    assert (tmp_path / "map.svg").read_text().count("<path") > (tmp_path / "alone.svg").read_text().count("<path")


def test_command_line_with_too_little_truth(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "enclosed", "6", "9", "--seed", "2", "-o", "scene.csv"]) == 0
    (tmp_path / "truth.csv").write_text("kind,id,x,y,theta\nlandmark,0,1,2,\n")
    assert main(["solve", "scene.csv", "--truth", "truth.csv"]) == 1
    assert "expected the positions of at least two views or landmarks of the map, got 1" in capsys.readouterr().err


def test_what_the_truth_does_not_have_is_not_named(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "enclosed", "6", "9", "--seed", "2", "-o", "scene.csv"]) == 0
    (tmp_path / "truth.csv").write_text("kind,id,x,y,theta\nview,0,1,2,\nview,1,2,2,\n")
    assert main(["solve", "scene.csv", "--truth", "truth.csv"]) == 0
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("errors"))
    assert re.fullmatch(r"errors after alignment with the truth: 2 positions \S+ rms", line)


def test_vertices_alone_and_compressed(scene, tmp_path):
    lines = [f"VERTEX_SE2 {i} {x!r} {y!r} {a!r}" for i, (x, y, a) in enumerate(scene.poses.tolist())]
    lines += [
        f"VERTEX_XY {100 + j} {x!r} {y!r}  # bearslam name {j}" for j, (x, y) in enumerate(scene.landmarks.tolist())
    ]
    path = tmp_path / "truth.g2o"
    path.write_text("\n".join(lines) + "\n")
    (tmp_path / "truth.g2o.gz").write_bytes(gzip.compress(path.read_bytes()))
    for one in (path, tmp_path / "truth.g2o.gz"):
        truth = bearslam.load_truth(one, scene.bearings)
        np.testing.assert_array_equal(truth.poses, scene.poses)
        np.testing.assert_array_equal(truth.landmarks, scene.landmarks)


def test_a_mirrored_map_is_told_from_a_wrong_one(scene, tmp_path, capsys):
    truth = tmp_path / "truth.json"
    save_truth(scene, truth)
    for name, bearings, mirrored in (
        ("right", scene.bearings, False),
        ("clockwise", -scene.bearings, True),
        ("wrong", bearslam.simulate("enclosed", 6, 9, noise=NOISE, seed=3).bearings, False),
    ):
        path = tmp_path / f"{name}.csv"
        bearslam.save(bearings, path)
        assert main(["solve", str(path), "--truth", str(truth)]) == 0
        assert ("the mirror image of the map fits the truth" in capsys.readouterr().err) == mirrored
