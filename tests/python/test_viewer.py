# SPDX-License-Identifier: MIT OR Apache-2.0
"""Recordings for the viewer."""

import dataclasses
import sys

import numpy as np
import pytest

import bearslam
from bearslam.cli.main import main

FLIP = [1.0, -1.0]
SCENE = bearslam.simulate("trajectory", 12, 20, noise=0.003, seed=2, sight=4.0)
NAMES = [f"L{j}" for j in range(20)]


@pytest.fixture(scope="module")
def result():
    odometry = SCENE.odometry([0.02, 0.02, 0.01], seed=1)
    return bearslam.refine(SCENE.bearings, SCENE, sigma=0.003, odometry=odometry)


@pytest.fixture
def recorded(tmp_path):
    """Write a recording and read it: for each entity the static data, and the data that change from view to view."""
    pytest.importorskip("rerun", minversion="0.24")
    chunk = pytest.importorskip("rerun.chunk", reason="this version has no reader of recordings")

    def record(result, **options):
        path = tmp_path / "map.rrd"
        result.view(path, **options)
        reader = chunk.RrdReader(path)
        assert len(reader.recordings()) == len(reader.blueprints()) == 1
        still, moving = {}, {}
        for one in reader.stream().to_chunks():
            columns = one.to_record_batch().to_pydict()
            (still if one.is_static else moving).setdefault(one.entity_path, {}).update(columns)
        return still, moving

    return record


def lines(columns):
    (strips,) = columns["LineStrips2D:strips"]
    return [np.array(strip) * FLIP for strip in strips]


def color(columns, kind):
    ((first, *_),) = columns[f"{kind}:colors"]
    return f"{first:08x}"


def test_the_map_stands_still_and_upright(result, recorded):
    named = dataclasses.replace(result, landmark_ids=tuple(NAMES), view_ids=tuple("abcdefghijkl"))
    still, _ = recorded(named)
    landmarks = still["/estimate/landmarks"]
    np.testing.assert_allclose(landmarks["Points2D:positions"][0] * np.array(FLIP), result.landmarks, atol=1e-6)
    assert landmarks["Points2D:labels"] == [NAMES]
    views = still["/estimate/views"]
    np.testing.assert_allclose(views["Arrows2D:origins"][0] * np.array(FLIP), result.poses[:, :2], atol=1e-6)
    x, y = np.transpose(views["Arrows2D:vectors"][0] * np.array(FLIP))
    np.testing.assert_allclose(np.exp(1j * np.arctan2(y, x)), np.exp(1j * result.poses[:, 2]), atol=1e-6)
    assert views["Arrows2D:labels"] == [list("abcdefghijkl")]
    (way,) = lines(still["/estimate/robots/0"])
    np.testing.assert_allclose(way, result.poses[:, :2], atol=1e-6)
    assert not [name for name in still if name.startswith("/truth")]


def test_the_truth_is_grey_and_the_map_is_laid_over_it(result, recorded):
    still, _ = recorded(result, truth=SCENE)
    np.testing.assert_allclose(
        still["/truth/landmarks"]["Points2D:positions"][0] * np.array(FLIP), SCENE.landmarks, atol=1e-6
    )
    assert color(still["/truth/landmarks"], "Points2D") == color(still["/truth/robots/0"], "LineStrips2D") == "404040ff"
    (way,) = lines(still["/truth/robots/0"])
    np.testing.assert_allclose(way, SCENE.poses[:, :2], atol=1e-6)
    (own,) = lines(still["/estimate/robots/0"])
    assert np.abs(own - way).max() < 0.1


def test_each_view_has_its_own_bearings(result, recorded):
    _, moving = recorded(result)
    assert moving["/now/bearings"]["view"] == list(range(12))
    for view, rays in enumerate(moving["/now/bearings"]["LineStrips2D:strips"]):
        seen = np.flatnonzero(np.isfinite(SCENE.bearings[view]))
        assert len(rays) == len(seen)
        start, end = (np.array(rays) * FLIP).transpose(1, 0, 2)
        np.testing.assert_allclose(start, np.tile(result.poses[view, :2], (len(seen), 1)), atol=1e-6)
        np.testing.assert_allclose(end, result.landmarks[seen], atol=0.05)
    for view, origin in enumerate(moving["/now/robot"]["Arrows2D:origins"]):
        np.testing.assert_allclose(origin[0] * np.array(FLIP), result.poses[view, :2], atol=1e-6)
    assert all(rays == [] for rays in moving["/now/outliers"]["LineStrips2D:strips"])


def test_outliers_have_a_colour_of_their_own(result, recorded):
    inliers = result.inliers.copy()
    first = int(np.flatnonzero(inliers[5])[0])
    inliers[5, first] = False
    still, moving = recorded(dataclasses.replace(result, inliers=inliers))
    (line,) = lines(still["/outliers"])
    np.testing.assert_allclose(line, [result.poses[5, :2], result.landmarks[first]], atol=0.05)
    counts = [len(rays) for rays in moving["/now/outliers"]["LineStrips2D:strips"]]
    assert counts == [int(view == 5) for view in range(12)]
    assert len(moving["/now/bearings"]["LineStrips2D:strips"][5]) == inliers[5].sum()
    colors = {color(still[name], "LineStrips2D") for name in ("/outliers", "/now/outliers", "/now/bearings")}
    assert colors == {"cc79a7ff", "56b4e9ff"}


def test_several_robots_and_a_closure(result, recorded):
    start, end = [0, 1, 2, 4, 5, 6, 7, 8, 9, 10, 2], [1, 2, 3, 5, 6, 7, 8, 9, 10, 11, 8]
    odometry = bearslam.Odometry(start, end, np.zeros((11, 3)), [0.02, 0.02, 0.01])
    still, _ = recorded(dataclasses.replace(result, odometry=odometry))
    assert [len(lines(still[f"/estimate/robots/{number}"])[0]) for number in (0, 1)] == [4, 8]
    (closure,) = lines(still["/estimate/closures"])
    np.testing.assert_allclose(closure, result.poses[[2, 8], :2], atol=1e-6)
    ((*shades,),) = still["/estimate/views"]["Arrows2D:colors"]
    assert len(set(shades[:4])) == len(set(shades[4:])) == 1
    assert shades[0] != shades[4]


def test_what_is_undetermined_is_left_out(result, recorded):
    poses, landmarks = result.poses.copy(), result.landmarks.copy()
    poses[4], landmarks[7] = np.nan, np.nan
    names = tuple(NAMES)
    still, moving = recorded(dataclasses.replace(result, poses=poses, landmarks=landmarks, landmark_ids=names))
    assert [len(one) for one in lines(still["/estimate/robots/0"])] == [4, 7]
    assert still["/estimate/landmarks"]["Points2D:labels"] == [NAMES[:7] + NAMES[8:]]
    assert len(still["/estimate/views"]["Arrows2D:origins"][0]) == 11
    assert moving["/now/robot"]["Arrows2D:origins"][4] == moving["/now/bearings"]["LineStrips2D:strips"][4] == []
    seen = np.isfinite(SCENE.bearings) & np.isfinite(poses[:, :1]) & np.isfinite(landmarks[:, 0])
    assert [len(rays) for rays in moving["/now/bearings"]["LineStrips2D:strips"]] == seen.sum(axis=1).tolist()


def test_a_map_of_nothing_is_recorded(result, recorded):
    nothing = {"poses": np.full((12, 3), np.nan), "landmarks": np.full((20, 2), np.nan)}
    still, moving = recorded(dataclasses.replace(result, **nothing))
    assert still["/estimate/landmarks"]["Points2D:positions"] == [[]]
    assert all(rays == [] for rays in moving["/now/bearings"]["LineStrips2D:strips"])


def test_the_viewer_is_opened_where_there_is_no_path(result, monkeypatch):
    rerun = pytest.importorskip("rerun", minversion="0.24")
    calls = []
    monkeypatch.setattr(rerun.RecordingStream, "spawn", lambda _, **options: calls.append(options))
    monkeypatch.setattr(rerun.RecordingStream, "flush", lambda _: calls.append("flush"))
    result.view()
    assert [sorted(calls[0]), calls[1]] == [["default_blueprint"], "flush"]


def test_a_viewer_that_does_not_open_is_an_error(result, monkeypatch):
    rerun = pytest.importorskip("rerun", minversion="0.24")

    def spawn(_, **options):
        raise RuntimeError("no screen")

    monkeypatch.setattr(rerun.RecordingStream, "spawn", spawn)
    with pytest.raises(OSError, match="the viewer cannot be opened: no screen"):
        result.view()


def test_other_names_and_truths_are_refused(result, tmp_path):
    pytest.importorskip("rerun", minversion="0.24")
    with pytest.raises(bearslam.InvalidInputError, match="path: expected a name that ends in .rrd, got"):
        result.view(tmp_path / "map.json")
    with pytest.raises(bearslam.InvalidInputError, match="truth: poses"):
        result.view(tmp_path / "map.rrd", truth=(SCENE.poses[:3], SCENE.landmarks))
    with pytest.raises(FileNotFoundError):
        result.view(tmp_path / "none" / "map.rrd")
    assert list(tmp_path.iterdir()) == []


def test_the_command_line_writes_a_recording(tmp_path, capsys):
    pytest.importorskip("rerun", minversion="0.24")
    bearslam.save(SCENE.bearings, tmp_path / "scene.csv")
    path = tmp_path / "map.rrd"
    assert main(["solve", str(tmp_path / "scene.csv"), "--view", str(path)]) == 0
    assert path.read_bytes().startswith(b"RRF2")
    assert main(["solve", str(tmp_path / "scene.csv"), "--view", str(tmp_path / "map.png")]) == 1
    assert "expected a name that ends in .rrd" in capsys.readouterr().err


def test_the_command_line_opens_the_viewer(tmp_path, monkeypatch):
    pytest.importorskip("rerun", minversion="0.24")
    bearslam.save(SCENE.bearings, tmp_path / "scene.csv")
    opened = []
    monkeypatch.setattr(bearslam.Reconstruction, "view", lambda _, path, truth: opened.append((path, truth)))
    assert main(["solve", str(tmp_path / "scene.csv"), "--view"]) == 0
    assert opened == [(None, None)]


def test_without_rerun_the_viewer_is_refused_before_the_work(result, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rerun", None)
    monkeypatch.delitem(sys.modules, "bearslam.plotting.viewer", raising=False)
    with pytest.raises(ImportError, match="bearslam\\[viewer\\]"):
        result.view(tmp_path / "map.rrd")
    bearslam.save(SCENE.bearings, tmp_path / "scene.csv")
    out = tmp_path / "map.json"
    assert main(["solve", str(tmp_path / "scene.csv"), "-o", str(out), "--view"]) == 1
    assert 'the viewer needs rerun-sdk: pip install "bearslam[viewer]"' in capsys.readouterr().err
    assert not out.exists()
