# SPDX-License-Identifier: MIT OR Apache-2.0
"""Files by their endings and contents, compressed files, and the commands that read and write them."""

import gzip
import io
import json
import math
import tracemalloc

import numpy as np
import pytest
from hypothesis import given

import bearslam
from bearslam import InvalidInputError, Problem, Sightings
from bearslam.cli.main import main

from .test_cli import complaint, run
from .test_g2o import assert_same, problems

CSV = b"view,landmark,bearing,sigma\na,b,0.5,0.01\na,c,-0.25,0.01\n"
G2O = b"VERTEX_SE2 0 1 2 0.5\nEDGE_SE2 0 1 1 0 0 100 0 0 100 0 400\nEDGE_BEARING_SE2_XY 0 7 0.5 10000\n"
GRAPH = b"ODOMETRY 0 1 1 0 0 0.01 0 0 0.01 0 0.0025\nLANDMARK 0 0 5 2 0.01 0 0.01\nLANDMARK 1 0 4 2 0.01 0 0.01\n"


@pytest.mark.parametrize(
    ("name", "content", "kind"),
    [
        ("a.csv", CSV, "csv"),
        ("a.g2o", G2O, "g2o"),
        ("a.graph", GRAPH, "graph"),
        ("a.toro", GRAPH, "graph"),
        ("a.G2O", G2O, "g2o"),
        ("a.txt", CSV, "csv"),
        ("a.txt", b"# a comment, with a comma\n\n" + G2O, "g2o"),
        ("a.txt", b"\xef\xbb\xbf" + GRAPH, "graph"),
        ("a", G2O, "g2o"),
        ("a", CSV, "csv"),
    ],
)
@pytest.mark.parametrize("compress", [False, True])
def test_the_ending_or_the_content_tells_the_format(tmp_path, name, content, kind, compress):
    path = tmp_path / (f"{name}.gz" if compress else name)
    path.write_bytes(gzip.compress(content) if compress else content)
    problem = bearslam.load(path)
    assert (problem.odometry is None) == (kind == "csv")
    assert (problem.offsets is None) == (kind != "graph")
    assert_same(bearslam.load(path, format=kind), problem)
    with path.open("rb") as file:
        assert_same(bearslam.load(file), problem)


def test_the_format_that_is_given_counts(tmp_path):
    (tmp_path / "a.csv").write_bytes(G2O)
    assert bearslam.load(tmp_path / "a.csv", format="g2o").odometry is not None
    with pytest.raises(InvalidInputError, match="a.csv:1: expected a header of view, landmark, bearing"):
        bearslam.load(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        (
            "a.txt",
            b"1 2 3\n",
            "{}: expected a CSV header, or lines of a graph such as VERTEX_SE2 or ODOMETRY; if it is",
        ),
        (
            "a.txt",
            b"",
            "{}: expected a CSV header, or lines of a graph such as VERTEX_SE2 or ODOMETRY; if it is one of",
        ),
        ("a", b"1 2 3\n", "{}:1: expected a header of view, landmark, bearing"),
        ("a.g2o.gz", G2O, "{}: expected a whole gzip file: Not a gzipped file"),
        ("a.g2o.gz", gzip.compress(G2O)[:-9], "{}: expected a whole gzip file: "),
        ("a.g2o.gz", gzip.compress(G2O) + b"more", "{}: expected a whole gzip file: "),
        ("a.g2o.gz", gzip.compress(G2O)[:30] + b"\0\0\0" + gzip.compress(G2O)[33:], "{}: expected a whole gzip file: "),
        ("a.g2o.gz", gzip.compress(gzip.compress(G2O)), "{}:1: expected text in UTF-8, got byte 0x8b"),
        ("a.g2o", b"", "{}: no EDGE_BEARING_SE2_XY or EDGE_SE2_XY: bearslam needs bearings"),
    ],
)
def test_what_is_no_such_file_is_refused(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InvalidInputError) as caught:
        bearslam.load(path)
    assert str(caught.value).startswith(message.format(path))


def test_a_bomb_does_not_go_off(tmp_path, monkeypatch):
    monkeypatch.setattr("bearslam.io.bounded.LARGEST_FILE", 10**5)
    assert len(bearslam.load(io.BytesIO(gzip.compress(CSV))).sightings) == 2
    bomb = gzip.compress(CSV + b"#" * 5 * 10**7)
    tracemalloc.start()
    with pytest.raises(InvalidInputError, match="^<file>: expected at most 100000 bytes when decompressed, got more"):
        bearslam.load(io.BytesIO(bomb))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 10**7


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"format": "toro"}, "format: expected 'csv' or 'g2o' or 'graph', got 'toro'"),
        ({"noise": "information"}, "noise: expected 'auto' or 'toro'"),
        ({"sensor": (1, 2)}, "sensor: expected ranges with all 2 bearings"),
    ],
)
def test_options_that_are_none(options, message):
    with pytest.raises(InvalidInputError, match=f"^{message}"):
        bearslam.load(io.BytesIO(CSV), **options)


@given(problems())
def test_csv_holds_sightings_alone(tmp_path_factory, problem):
    """Either all of the problem comes back, in the order of its sightings, or it is refused."""
    path = tmp_path_factory.mktemp("csv") / "some.csv"
    more = any([problem.odometry, problem.pose_priors, problem.landmark_priors, problem.start, problem.offsets])
    if more or problem.others:
        with pytest.raises(InvalidInputError, match="^problem: expected sightings alone for a CSV file, got "):
            bearslam.save(problem, path)
        assert not path.exists()
    few = problem.bearings_only()
    bearslam.save(few, path)
    again = bearslam.load(path)
    mine, yours = few.sightings, again.sightings
    assert [few.view_ids[i] for i in mine.view] == [again.view_ids[i] for i in yours.view]
    assert [few.landmark_ids[j] for j in mine.landmark] == [again.landmark_ids[j] for j in yours.landmark]
    assert mine.sigma.tolist() == yours.sigma.tolist()
    whole = np.abs(mine.bearing) <= 2 * math.pi
    assert mine.bearing[whole].tolist() == yours.bearing[whole].tolist()
    np.testing.assert_allclose(np.sin((mine.bearing - yours.bearing) / 2), 0, atol=1e-9)


def test_names_that_no_text_has_are_refused(tmp_path):
    problem = Problem(Sightings([0], [0], [0.5], 0.1), ["\ud800"], ["b"])
    for name in ("a.csv", "a.g2o"):
        with pytest.raises(InvalidInputError, match="^path: expected names that UTF-8 can encode, got"):
            bearslam.save(problem, tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a file of each format."""
    monkeypatch.chdir(tmp_path)
    for name, content in (
        ("a.csv", CSV),
        ("a.g2o", G2O),
        ("a.graph", GRAPH),
        ("odd.g2o", G2O + b"EDGE_X 1\nEDGE_X 2\n"),
    ):
        (tmp_path / name).write_bytes(content)
    return tmp_path


def test_convert(folder, capsys):
    assert main(["convert", "a.graph", "b.g2o"]) == 0
    assert_same(bearslam.load("b.g2o"), bearslam.load("a.graph"))
    assert main(["convert", "a.graph", "c.g2o", "--sensor", "1", "0.5", "90", "--noise", "cov"]) == 0
    moved = bearslam.load("a.graph", sensor=(1, 0.5, math.pi / 2))
    assert_same(bearslam.load("c.g2o"), moved)
    assert moved.sightings.bearing[0] == pytest.approx(math.atan2(1.5, 4) - math.pi / 2)
    assert main(["convert", "a.g2o", "d.csv", "--bearings-only"]) == 0
    assert bearslam.load("d.csv").sightings.bearing.tolist() == [0.5]
    assert capsys.readouterr() == ("", "")


def test_sigma_overrides_that_of_the_file(folder):
    assert main(["convert", "a.csv", "b.csv", "--sigma-deg", "2"]) == 0
    assert bearslam.load("b.csv").sightings.sigma.tolist() == [math.radians(2)] * 2
    # The covariance of a range would contradict that standard deviation.
    assert main(["convert", "a.graph", "b.g2o", "--sigma-deg", "2"]) == 0
    problem = bearslam.load("b.g2o")
    assert problem.offsets is None
    assert problem.sightings.sigma.tolist() == [math.radians(2)] * 2
    assert problem.sightings.bearing.tolist() == bearslam.load("a.graph").sightings.bearing.tolist()


def test_what_is_not_used_is_told(folder, capsys):
    assert main(["convert", "odd.g2o", "b.g2o"]) == 0
    assert capsys.readouterr().err == "bearslam: note: 2 lines EDGE_X kept but not used\n"
    assert "EDGE_X 1\nEDGE_X 2\n" in (folder / "b.g2o").read_text()
    assert main(["diagnose", "odd.g2o"]) == 0
    assert capsys.readouterr().err.startswith("bearslam: note: 2 lines EDGE_X kept but not used\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["convert", "a.g2o", "b.csv"],
            "problem: expected sightings alone for a CSV file, got odometry, start as well; a",
        ),
        (["convert", "a.g2o", "b.json"], "path: expected a name that ends in .csv or .g2o, got 'b.json'"),
        (["convert", "a.g2o", "a.g2o"], "a.g2o: the result would overwrite the file it is made from"),
        (["convert", "a.g2o", "none/b.g2o"], "none/b.g2o: there is no folder 'none'"),
        (["convert", "none.g2o", "b.g2o"], "none.g2o: No such file or directory"),
        (["convert", "a.g2o", "b.g2o", "--sensor", "1"], "--sensor: expected X Y or X Y DEG, got 1 numbers"),
        (["convert", "a.g2o", "b.g2o", "--sensor", "1", "2"], "sensor: expected ranges with all 1 bearings, got 0"),
        (["convert", "a.g2o", "b.g2o", "--sigma-deg", "0"], "--sigma-deg: expected a number above 0, got 0"),
        (["convert", "a.g2o", "b.csv", "--format", "csv"], "a.g2o:1: expected a header of view, landmark, bearing"),
        (["solve", "a.graph", "--noise", "toro"], "a.graph:1: expected information that is positive definite"),
        (["diagnose", "a.g2o", "--sigma-deg", "-1"], "--sigma-deg: expected a number above 0, got -1"),
    ],
)
def test_what_goes_wrong_is_one_line(folder, capsys, arguments, message):
    before = sorted(path.name for path in folder.iterdir())
    assert main(arguments) == 1
    assert complaint(capsys).startswith(message)
    assert sorted(path.name for path in folder.iterdir()) == before


@pytest.fixture
def scene():
    return bearslam.simulate("trajectory", 12, 10, noise=0.01, seed=4, sight=3.0)


@pytest.fixture
def trip(tmp_path, scene):
    """A file of g2o with odometry, in metres."""
    seen = scene.sightings
    problem = Problem(
        Sightings(seen.view, seen.landmark, seen.bearing, 0.01),
        [f"stop {i}" for i in range(12)],
        [f"tree {j}" for j in range(10)],
        odometry=scene.odometry([0.01, 0.01, 0.01], seed=1),
    )
    bearslam.save(problem, tmp_path / "trip.g2o")
    return tmp_path / "trip.g2o"


def test_solve_reads_and_writes_g2o(trip, scene, tmp_path, capsys):
    out = tmp_path / "map.g2o"
    assert main(["solve", str(trip), "-o", str(out)]) == 0
    assert capsys.readouterr().err == ""
    problem = bearslam.load(out)
    assert problem.view_ids == tuple(f"stop {i}" for i in range(12))
    length = np.linalg.norm(problem.start.poses[-1, :2] - problem.start.poses[0, :2])
    assert length == pytest.approx(np.linalg.norm(scene.poses[-1, :2] - scene.poses[0, :2]), rel=0.1)
    expected = bearslam.solve(bearslam.load(trip))
    np.testing.assert_array_equal(problem.start.poses, expected.poses)
    assert main(["solve", str(trip), "--bearings-only", "-o", str(tmp_path / "few.json")]) == 0
    saved = json.loads((tmp_path / "few.json").read_text())
    places = np.array([[view["x"], view["y"]] for view in saved["views"]], dtype=float)
    assert np.sqrt(np.nanmean((places[1:] ** 2).sum(axis=1))) == pytest.approx(1)


def test_standard_input_has_a_format_too(trip, tmp_path):
    content = trip.read_bytes()
    for arguments in ((), ("--format", "g2o")):
        done = run("solve", "-", *arguments, stdin=gzip.compress(content))
        assert done.returncode == 0, done.stderr
        assert done.stdout.startswith(b"12 views, 10 landmarks, ")
    done = run("diagnose", "-", "--format", "csv", stdin=content)
    assert done.stderr.startswith(b"bearslam: error: <stdin>:1: expected a header of view, landmark, bearing")


def test_diagnose_takes_lines_for_rays(trip, capsys):
    problem = bearslam.load(trip).bearings_only()
    seen = problem.sightings
    flipped = Sightings(
        seen.view, seen.landmark, seen.bearing + np.where(np.arange(len(seen)) % 3, 0, math.pi), seen.sigma
    )
    path = trip.with_name("lines.csv")
    bearslam.save(Problem(flipped, problem.view_ids, problem.landmark_ids), path)
    assert main(["diagnose", str(path), "--unoriented"]) == 0
    lines = capsys.readouterr().out
    expected = bearslam.diagnose(bearslam.load(path), oriented=False)
    assert lines.startswith(str(expected))
