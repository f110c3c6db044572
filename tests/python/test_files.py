# SPDX-License-Identifier: MIT OR Apache-2.0
"""Sightings and maps in files."""

import csv
import dataclasses
import io
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bearslam
from bearslam import InvalidInputError, Problem, Sightings
from bearslam.cli.report import describe
from bearslam.io.sightings_csv import parse, render

GOOD = """\
# the kitchen, on a Tuesday
landmark, bearing_deg ,view,sigma_deg

door,90,robot 1,2
"window, left",-45.5,robot 1,2
   # seen from the other side
door,1e1,7,0.5
"""


def test_columns_in_any_order_comments_and_any_names():
    problem = parse(GOOD.encode(), "kitchen.csv")
    assert problem.view_ids == ("robot 1", "7")
    assert problem.landmark_ids == ("door", "window, left")
    seen = problem.sightings
    assert seen.view.tolist() == [0, 0, 1]
    assert seen.landmark.tolist() == [0, 1, 0]
    np.testing.assert_allclose(seen.bearing, np.radians([90, -45.5, 10]))
    np.testing.assert_allclose(seen.sigma, np.radians([2, 2, 0.5]))


@pytest.mark.parametrize(
    "change", [lambda t: "\ufeff" + t, lambda t: t.replace("\n", "\r\n"), lambda t: t.rstrip("\n")]
)
def test_files_of_other_systems(change):
    again = parse(change(GOOD).encode(), "kitchen.csv")
    assert again.landmark_ids == ("door", "window, left")
    assert len(again.sightings) == 3


BAD = [
    ("", "bad.csv: expected sightings, got an empty file"),
    ("# nothing\n\n", "bad.csv: expected sightings, got an empty file"),
    ("view,landmark,bearing\n", "bad.csv: expected sightings below the header, got none"),
    ("a,b,0.5\n", "bad.csv:1: expected a header of view, landmark, bearing (or bearing_deg)"),
    ("view;landmark;bearing\na;b;0.5\n", "bad.csv:1: expected a header of view, landmark, bearing (or bearing_deg)"),
    ("view,landmark,bearing,time\na,b,0.5,3\n", "bad.csv:1: expected a header of view, landmark, bearing (or"),
    ("view,bearing\na,0.5\n", "bad.csv:1: expected a column landmark, got 'view,bearing'"),
    ("view,landmark\na,b\n", "bad.csv:1: expected one column bearing or bearing_deg, got 'view,landmark'"),
    ("view,landmark,bearing,bearing_deg\n", "bad.csv:1: expected one column bearing or bearing_deg"),
    ("view,landmark,bearing,sigma,sigma_deg\n", "bad.csv:1: expected one column sigma or sigma_deg"),
    ("view,view,landmark,bearing\n", "bad.csv:1: expected every column once"),
    ("view,landmark,bearing\na,b\n", "bad.csv:2: expected 3 values (view, landmark, bearing), got 2"),
    ("view,landmark,bearing\na,b,0.5,\n", "bad.csv:2: expected 3 values (view, landmark, bearing), got 4"),
    ("view,landmark,bearing\n\n# x\na,b,left\n", "bad.csv:4: expected a finite number as bearing, got 'left'"),
    ("view,landmark,bearing\na,b,\n", "bad.csv:2: expected a finite number as bearing, got ''"),
    ("view,landmark,bearing\na,b,nan\n", "bad.csv:2: expected a finite number as bearing, got 'nan'"),
    ("view,landmark,bearing\na,b,1e999\n", "bad.csv:2: expected a finite number as bearing, got '1e999'"),
    ("view,landmark,bearing\na,b,1_0\n", "bad.csv:2: expected a finite number as bearing, got '1_0'"),
    ("view,landmark,bearing\na,b,0x1\n", "bad.csv:2: expected a finite number as bearing, got '0x1'"),
    ("view,landmark,bearing\na,b,90\n", "bad.csv:2: expected radians (a column bearing_deg holds degrees) within one"),
    ("view,landmark,bearing_deg\na,b,400\n", "bad.csv:2: expected degrees within one turn as bearing_deg, got 400"),
    ("view,landmark,bearing\n,b,0.5\n", "bad.csv:2: expected the name of a view, got nothing"),
    ("view,landmark,bearing\na, ,0.5\n", "bad.csv:2: expected the name of a landmark, got nothing"),
    ("view,landmark,bearing,sigma\na,b,0.5,0\n", "bad.csv:2: expected a number above 0 as sigma, got 0"),
    (
        "view,landmark,bearing,sigma_deg\na,b,0.5,1e200\n",
        "bad.csv:2: expected radians from 1e-100 to 1e+100 as sigma_d",
    ),
    (
        "view,landmark,bearing,sigma\na,b,0.5,5e-324\n",
        "bad.csv:2: expected radians from 1e-100 to 1e+100 as sigma, got",
    ),
    ("view,landmark,bearing,sigma\na,b,0.5,inf\n", "bad.csv:2: expected a finite number as sigma, got 'inf'"),
    ("view,landmark,bearing\na,b,0.5\nc,b,0.5\na,b,0.6\n", "bad.csv:4: view 'a' sees landmark 'b' a second time; the"),
    ('view,landmark,bearing\n"a,b,0.5\nc,d,0.5\n', "bad.csv:2: unexpected end of data"),
    ('view,landmark,bearing\n"a"x,b,0.5\n', "bad.csv:2: "),
]


@pytest.mark.parametrize(("text", "message"), BAD)
def test_a_bad_line_is_named(text, message):
    with pytest.raises(InvalidInputError) as caught:
        parse(text.encode(), "bad.csv")
    assert str(caught.value).startswith(message)


def test_what_is_no_text_is_refused_with_its_line():
    with pytest.raises(InvalidInputError, match="^bad.csv:2: expected text in UTF-8, got byte 0xff"):
        parse(b"view,landmark,bearing\na,b\xff,0.5\n", "bad.csv")


@given(st.text() | st.text(alphabet='view,landmrkbg"#\n01.-e'))
def test_any_text_is_read_or_refused(text):
    for content in (text, "view,landmark,bearing\n" + text):
        try:
            assert len(parse(content.encode("utf-8", "replace"), "any.csv").sightings)
        except InvalidInputError as error:
            assert str(error).startswith("any.csv:")


names = st.text(st.characters(exclude_categories=["Cs"]), min_size=1).filter(
    lambda name: name == name.strip() and not {"\n", "\r"} & set(name)
)


@given(
    st.lists(names, min_size=2, max_size=2, unique=True),
    st.lists(names, min_size=2, max_size=2, unique=True),
    st.lists(st.floats(-math.pi, math.pi), min_size=4, max_size=4),
    st.none() | st.lists(st.floats(1e-6, 3), min_size=4, max_size=4),
)
def test_what_is_written_is_read_again(views, landmarks, bearings, sigma):
    problem = Problem(Sightings([0, 0, 1, 1], [0, 1, 0, 1], bearings, sigma), views, landmarks)
    again = parse(render(problem).encode(), "again.csv")
    assert again.view_ids == tuple(views)
    assert again.landmark_ids == tuple(landmarks)
    assert again.sightings.bearing.tolist() == bearings
    assert (again.sightings.sigma is None) == (sigma is None)
    if sigma is not None:
        assert again.sightings.sigma.tolist() == sigma


@pytest.mark.parametrize("name", ["#3", 'the "big" one', "left, right", "a#b", "nan", "é"])
def test_names_that_look_like_something_else(name):
    problem = Problem(Sightings([0], [0], [0.5]), [name], [name])
    again = parse(render(problem).encode(), "again.csv")
    assert again.view_ids == again.landmark_ids == (name,)


def test_a_table_is_written_with_numbers_for_names(tmp_path):
    path = tmp_path / "table.csv"
    bearslam.save([[0.25, np.nan], [-0.5, 6.0]], path)
    rows = path.read_text().splitlines()
    assert rows[:3] == ["view,landmark,bearing", "0,0,0.25", "1,0,-0.5"]
    assert rows[3] == "1,1,6.0"


def test_load_reads_paths_and_streams(tmp_path):
    path = tmp_path / "kitchen.csv"
    path.write_text(GOOD)
    assert len(bearslam.load(path).sightings) == len(bearslam.load(str(path)).sightings) == 3
    assert len(bearslam.load(io.BytesIO(GOOD.encode())).sightings) == 3
    with pytest.raises(FileNotFoundError):
        bearslam.load(tmp_path / "none.csv")


@pytest.fixture
def result():
    scene = bearslam.simulate("mixed", 5, 9, noise=0.01, seed=1)
    bearings = scene.bearings.copy()
    bearings[1:, 8] = np.nan
    table = Sightings(*np.nonzero(np.isfinite(bearings)), bearings[np.isfinite(bearings)], 0.01)
    return bearslam.solve(Problem(table, [f"robot {i}" for i in range(5)], [f"mark, {j}" for j in range(9)]))


def test_a_map_as_json_has_everything(result, tmp_path):
    path = tmp_path / "map.json"
    result.save(path)
    saved = json.loads(path.read_text(), parse_constant=pytest.fail)
    assert saved["cost"] == result.cost
    assert saved["rms"] == result.rms
    assert [saved[name] for name in ("sensitivity", "uncertainty")] == [result.sensitivity, result.uncertainty]
    assert [other["uncertainty"] for other in saved["alternatives"]] == [None] * len(result.alternatives)
    assert saved["converged"] is True
    assert [view["id"] for view in saved["views"]] == list(result.view_ids)
    np.testing.assert_array_equal([[view["x"], view["y"], view["theta"]] for view in saved["views"]], result.poses)
    assert saved["landmarks"][8] == {"id": "mark, 8", "x": None, "y": None}
    assert saved["undetermined"][0]["id"] == "mark, 8"
    assert saved["sightings"]["bearing"] == result.sightings.bearing.tolist()
    assert saved["sightings"]["residual"].count(None) == 1
    assert len(saved["alternatives"]) == len(result.alternatives)


def test_covariances_and_outliers_are_saved(tmp_path):
    scene = bearslam.simulate("enclosed", 6, 10, noise=0.002, seed=8)
    bearings = scene.bearings.copy()
    bearings[1:, 9] = np.nan
    bearings[2, 3] += 0.2
    result = bearslam.refine(
        bearings,
        scene,
        sigma=0.002,
        loss="truncated",
        refinement=bearslam.RefineOptions(loss_scale=5.0),
        covariance=True,
    )
    path = tmp_path / "map.json"
    result.save(path)
    saved = json.loads(path.read_text(), parse_constant=pytest.fail)
    assert saved["covariance_frame"] == "first_view"
    assert saved["oriented"] is True
    assert [view["covariance"] for view in saved["views"]] == result.pose_covariance.tolist()
    assert saved["landmarks"][4]["covariance"] == result.landmark_covariance[4].tolist()
    assert saved["landmarks"][9]["covariance"] == [[None, None], [None, None]]
    seen = saved["sightings"]
    wrong = [k for k, inlier in enumerate(seen["inlier"]) if not inlier]
    # One bearing is of a landmark that nothing else sees, the other is wrong.
    assert [(seen["view"][k], seen["landmark"][k]) for k in wrong] == [(0, 9), (2, 3)]
    assert saved["components"] == []


def test_components_are_saved_and_told(result, tmp_path):
    poses = np.vstack([np.full((4, 3), np.nan), [[0, 0, 0]]])
    piece = dataclasses.replace(result, poses=poses, landmarks=np.full((9, 2), np.nan))
    both = dataclasses.replace(result, components=(piece,))
    both.save(tmp_path / "map.json")
    saved = json.loads((tmp_path / "map.json").read_text())
    assert [view["x"] for view in saved["components"][0]["views"]] == [None] * 4 + [0.0]
    assert "separate map: 1 views, 0 landmarks" in describe(both)


def test_a_map_without_covariances_says_nothing_of_them(result, tmp_path):
    result.save(tmp_path / "map.json")
    saved = json.loads((tmp_path / "map.json").read_text())
    assert saved["covariance_frame"] is None
    assert set(saved["views"][0]) == {"id", "x", "y", "theta"}


def test_a_map_as_csv_has_poses_and_landmarks(result, tmp_path):
    path = tmp_path / "map.csv"
    bearslam.save(result, path)
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["kind"] for row in rows] == ["view"] * 5 + ["landmark"] * 9
    assert rows[1]["id"] == "robot 1"
    assert [float(rows[1][key]) for key in ("x", "y", "theta")] == result.poses[1].tolist()
    assert rows[-1] == {"kind": "landmark", "id": "mark, 8", "x": "nan", "y": "nan", "theta": ""}


def test_residuals_of_a_table_are_saved_sighting_by_sighting(tmp_path):
    scene = bearslam.simulate("mixed", 4, 9, noise=0.01, seed=1)
    result = bearslam.solve(scene.bearings)
    result.save(tmp_path / "map.json")
    saved = json.loads((tmp_path / "map.json").read_text())
    assert saved["sightings"]["residual"] == result.residuals.ravel().tolist()
    assert saved["views"][2]["id"] == 2


@pytest.mark.parametrize("name", ["map.txt", "map", "map.json.gz"])
def test_other_endings_are_refused(result, tmp_path, name):
    with pytest.raises(
        InvalidInputError, match="^path: expected a name that ends in .json or .csv or .g2o or .tum, got"
    ):
        result.save(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_sightings_are_csv_or_g2o(tmp_path):
    with pytest.raises(InvalidInputError, match="^path: expected a name that ends in .csv or .g2o or .tum, got"):
        bearslam.save([[0.1]], tmp_path / "table.json")
    with pytest.raises(InvalidInputError, match="^bearings: "):
        bearslam.save("sightings", tmp_path / "table.csv")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("what", "got"), [(None, "NoneType"), (5, "int"), (io.StringIO("view,landmark,bearing\na,b,1\n"), "str")]
)
def test_what_cannot_be_read(what, got):
    with pytest.raises(InvalidInputError, match=f"^path: expected a path or a file opened in binary mode, got {got}"):
        bearslam.load(what)


class Endless:
    """A file of one line without an end."""

    name = "endless.txt"
    given = 0

    def read(self, size):
        self.given += size
        return b"x" * size


def test_a_line_without_an_end_is_refused_before_memory_is_taken(tmp_path, monkeypatch):
    monkeypatch.setattr("bearslam.io.bounded.LONGEST_LINE", 10**6)
    file = Endless()
    with pytest.raises(
        InvalidInputError, match=r"^endless.txt:1: expected lines of at most 1000000 bytes, got one that"
    ):
        bearslam.load(file)
    assert file.given < 10**7
    path = tmp_path / "long.csv"
    path.write_bytes(b"view,landmark,bearing\na,b,0.5\n" + b"#" * 2 * 10**6)
    with pytest.raises(InvalidInputError, match=r"long.csv:3: expected lines of at most 1000000 bytes"):
        bearslam.load(path)
    path.write_bytes(b"view,landmark,bearing\na,b,0.5\n" + (b"#" * 9 * 10**5 + b"\r") * 5)
    assert len(bearslam.load(path).sightings) == 1


def test_a_file_has_a_largest_size(tmp_path, monkeypatch):
    monkeypatch.setattr("bearslam.io.bounded.LARGEST_FILE", 10**6)
    path = tmp_path / "large.csv"
    path.write_bytes(b"view,landmark,bearing\n" + b"#\n" * 10**6)
    with pytest.raises(
        InvalidInputError, match=r"large.csv: expected at most 1000000 bytes when decompressed, got more"
    ):
        bearslam.load(path)
