# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command line."""

import dataclasses
import io
import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import bearslam
from bearslam.cli.main import main
from bearslam.cli.report import describe
from bearslam.cli.warnings import warnings as reasons
from bearslam.progress import ProgressLine

from .test_files import BAD


@pytest.fixture
def scene(tmp_path):
    """A file of bearings."""
    path = tmp_path / "scene.csv"
    bearslam.save(bearslam.simulate("mixed", 4, 9, noise=0.02, seed=1).bearings, path)
    return path


def run(*arguments, stdin=b"", **options):
    return subprocess.run(
        [sys.executable, "-m", "bearslam", *map(str, arguments)],
        input=stdin,
        capture_output=True,
        check=False,
        **options,
    )


def complaint(capsys):
    """The one line on standard error."""
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    assert line.startswith("bearslam: error: ")
    return line.removeprefix("bearslam: error: ")


def test_solve_prints_the_map(scene, capsys):
    assert main(["solve", str(scene)]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    lines = captured.out.splitlines()
    assert lines[0] == "4 views, 9 landmarks, 36 sightings"
    assert lines[1].startswith("residual rms ")
    assert "heading [deg]" in captured.out


def test_solve_writes_map_and_picture(scene, tmp_path, capsys):
    for suffix in (".json", ".csv"):
        out = tmp_path / f"map{suffix}"
        picture = tmp_path / "map.png"
        assert main(["solve", str(scene), "-o", str(out), "--plot", str(picture), "--sigma-deg", "1"]) == 0
        assert out.stat().st_size
        assert picture.read_bytes().startswith(b"\x89PNG")
        assert "heading" not in capsys.readouterr().out
    saved = json.loads((tmp_path / "map.json").read_text())
    expected = bearslam.solve(bearslam.load(scene), sigma=3.141592653589793 / 180)
    assert saved["cost"] == pytest.approx(expected.cost, rel=1e-12)
    assert {type(view["id"]) for view in saved["views"]} == {str}


def test_options_reach_the_solver(scene, tmp_path):
    out = tmp_path / "map.json"
    assert main(["solve", str(scene), "-o", str(out), "--method", "projective", "--max-iterations", "1"]) == 0
    assert json.loads(out.read_text())["iterations"] <= 1


@pytest.mark.parametrize("arguments", [["--loss", "truncated", "--loss-scale", "6"], ["--robust"]])
def test_outliers_are_named(tmp_path, capsys, arguments):
    seen = bearslam.simulate("enclosed", 8, 15, noise=0.002, seed=1).sightings
    bearing = seen.bearing.copy()
    bearing[19] += 0.2  # of the fifth landmark, by the second view
    path, out = tmp_path / "scene.csv", tmp_path / "map.json"
    sightings = bearslam.Sightings(seen.view, seen.landmark, bearing, 0.002)
    names = [f"robot {i}" for i in range(8)], [f"mark {j}" for j in range(15)]
    bearslam.save(bearslam.Problem(sightings, *names), path)
    assert main(["solve", str(path), *arguments, "-o", str(out)]) == 0
    text = capsys.readouterr().out
    assert "1 outlier among the bearings:\n  view robot 1 of landmark mark 4: -11." in text
    saved = json.loads(out.read_text())
    assert [k for k, inlier in enumerate(saved["sightings"]["inlier"]) if not inlier] == [19]


def test_more_outliers_than_fit_are_counted():
    scene = bearslam.simulate("enclosed", 8, 15, noise=0.002, seed=1)
    result = bearslam.solve(scene.bearings, sigma=0.002)
    text = describe(dataclasses.replace(result, inliers=np.zeros((8, 15), dtype=bool)))
    lines = text.splitlines()
    assert "120 outliers among the bearings:" in lines
    assert sum(line.startswith("  view ") for line in lines) == 20
    assert "  ... and 100 more" in lines


@pytest.mark.parametrize("arguments", [["--loss", "huber"], ["--robust"]])
def test_what_tells_outliers_needs_a_standard_deviation(scene, capsys, arguments):
    assert main(["solve", str(scene), *arguments]) == 1
    assert complaint(capsys) == (
        f"{' '.join(arguments)}: needs the standard deviation of the bearings: --sigma-deg, or a column sigma"
    )


@pytest.mark.parametrize(
    ("arguments", "frame"), [(["--covariance"], "first_view"), (["--covariance", "free_network"], "free_network")]
)
def test_covariances_are_asked_for(scene, tmp_path, capsys, arguments, frame):
    out = tmp_path / "map.json"
    assert main(["solve", str(scene), "--sigma-deg", "1", *arguments, "-o", str(out)]) == 0
    assert f"covariances in the frame {frame} (" in capsys.readouterr().out
    saved = json.loads(out.read_text())
    assert saved["covariance_frame"] == frame
    expected = bearslam.solve(bearslam.load(scene), sigma=3.141592653589793 / 180, covariance=frame)
    assert saved["landmarks"][3]["covariance"] == expected.landmark_covariance[3].tolist()


def test_a_frame_that_nothing_fixes_is_an_error(scene, capsys):
    assert main(["solve", str(scene), "--covariance", "priors"]) == 1
    assert "odometry and priors leave free" in complaint(capsys)


def test_lines_instead_of_rays(tmp_path, capsys):
    scene, path = bearslam.simulate("mixed", 6, 10, noise=0.002, seed=3), tmp_path / "lines.csv"
    bearings = scene.bearings.copy()
    bearings[1::2, ::3] += 3.141592653589793
    bearslam.save(bearings, path)
    assert main(["solve", str(path), "--sigma-deg", "0.1", "--unoriented"]) == 0
    text = capsys.readouterr().out
    assert "every heading is known modulo 180 deg" in text
    assert float(text.split("residual rms ")[1].split()[0]) < 0.2


def test_outliers_are_simulated_by_kind(tmp_path):
    path = tmp_path / "scene.csv"
    arguments = ["--noise-deg", "1", "--seed", "3", "--outliers", "0.4", "--outlier-kind", "exchanged"]
    assert main(["simulate", "mixed", "6", "9", *arguments, "-o", str(path)]) == 0
    options = {"noise": np.radians(1), "seed": 3, "outliers": 0.4, "outlier_kind": "exchanged"}
    scene = bearslam.simulate("mixed", 6, 9, **options)
    np.testing.assert_allclose(bearslam.load(path).sightings.bearing, scene.bearings.ravel(), rtol=0, atol=1e-12)


def test_standard_input_and_output_make_a_pipe():
    made = run("simulate", "enclosed", 4, 9, "--noise-deg", 1, "--seed", 3)
    assert made.returncode == 0
    solved = run("solve", "-", stdin=made.stdout)
    assert solved.returncode == 0, solved.stderr
    assert solved.stdout.startswith(b"4 views, 9 landmarks, 36 sightings")


def test_a_reader_that_stops_is_no_failure_worth_words(scene):
    command = f"{sys.executable} -m bearslam simulate mixed 400 400 | head -n 1"
    done = subprocess.run(command, shell=True, capture_output=True, check=False)
    assert done.stdout == b"view,landmark,bearing\n"
    assert done.stderr == b""


def test_simulate_writes_scene_and_truth(tmp_path):
    scene, truth = tmp_path / "scene.csv", tmp_path / "truth.json"
    assert main(["simulate", "mixed", "4", "9", "--noise-deg", "0", "-o", str(scene), "--truth", str(truth)]) == 0
    saved = json.loads(truth.read_text())
    expected = bearslam.simulate("mixed", 4, 9, noise=0.0, seed=0)
    assert [saved["landmarks"][3][key] for key in "xy"] == expected.landmarks[3].tolist()
    assert bearslam.load(scene).sightings.bearing.tolist() == expected.bearings.ravel().tolist()
    assert main(["simulate", "mixed", "4", "9", "-o", str(scene), "--truth", str(tmp_path / "truth.csv")]) == 0


@pytest.mark.parametrize(("text", "message"), BAD)
def test_a_bad_file_is_one_line_with_its_place(text, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.csv").write_text(text)
    (tmp_path / "map.json").write_text("old")
    assert main(["solve", "bad.csv", "-o", "map.json"]) == 1
    assert complaint(capsys).startswith(message)
    assert (tmp_path / "map.json").read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 2


def test_names_do_not_reach_the_terminal_as_commands(tmp_path, capsys):
    path, picture = tmp_path / "scene.csv", tmp_path / "map.png"
    scene = bearslam.simulate("mixed", 4, 9, noise=0.02, seed=1)
    names = ["red \x1b[31m", "$x_{", "\u540d", "x" * 10_000]
    problem = bearslam.Problem(scene.sightings, names, map(str, range(9)))
    bearslam.save(problem, path)
    assert main(["solve", str(path), "--plot", str(picture), "-o", str(tmp_path / "map.json")]) == 0
    saved = json.loads((tmp_path / "map.json").read_text())
    assert [view["id"] for view in saved["views"]] == names
    assert main(["solve", str(path)]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    assert "red \\x1b[31m" in captured.out
    assert max(map(len, captured.out.splitlines())) < 120


def test_letters_that_a_terminal_has_not_are_spelt_out(tmp_path):
    path = tmp_path / "scene.csv"
    scene = bearslam.simulate("mixed", 4, 9, noise=0.02, seed=1)
    bearslam.save(bearslam.Problem(scene.sightings, "\u03b1\u03b2\u03b3\u03b4", map(str, range(9))), path)
    done = run("solve", path, env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert done.returncode == 0, done.stderr
    assert b"\n\\u03b1 " in done.stdout


@pytest.mark.skipif(os.name == "nt", reason="closes descriptors as a shell does")
def test_closed_streams(scene, tmp_path):
    command = f"exec {sys.executable} -m bearslam solve"
    closed_input = subprocess.run(f"{command} - <&-", shell=True, capture_output=True, check=False)
    assert (closed_input.returncode, closed_input.stderr) == (1, b"bearslam: error: -: standard input is closed\n")
    closed_output = subprocess.run(
        f"{command} '{scene}' -o '{tmp_path}/map.json' >&-", shell=True, stderr=subprocess.PIPE, check=False
    )
    assert (closed_output.returncode, closed_output.stderr) == (0, b"")
    assert (tmp_path / "map.json").stat().st_size


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_cannot_be_written_to(scene, tmp_path, capsys):
    (tmp_path / "locked").mkdir(mode=0o555)
    assert main(["solve", str(scene), "-o", str(tmp_path / "locked" / "map.json")]) == 1
    assert complaint(capsys) == f"{tmp_path}/locked/map.json: Permission denied"


LOADED = """\
import signal, sys
import bearslam.cli.input, bearslam.cli.main

# If the tests run in the background, the signal is ignored from the start.
signal.signal(signal.SIGINT, signal.default_int_handler)

def load(path, load=bearslam.cli.input.load, **options):
    problem = load(path, **options)
    print("loaded", flush=True)
    return problem

bearslam.cli.input.load = load
sys.exit(bearslam.cli.main.main(sys.argv[1:]))
"""


@pytest.mark.skipif(os.name == "nt", reason="needs SIGINT")
def test_ctrl_c_ends_a_long_solve_at_once(tmp_path):
    path, out = tmp_path / "scene.csv", tmp_path / "map.json"
    bearslam.save(bearslam.simulate("mixed", 500, 500, noise=0.02, seed=1).bearings, path)
    command = [sys.executable, "-c", LOADED, "solve", str(path), "-o", str(out)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"loaded\n"
        time.sleep(0.3)
        start = time.monotonic()
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    # Within a second, which a person perceives as immediate; the machine may be busy.
    assert time.monotonic() - start < 3.0
    assert (process.returncode, err) == (130, b"bearslam: interrupted\n")
    assert not out.exists()


def test_a_bad_line_on_standard_input_has_its_number():
    done = run("solve", "-", stdin=b"view,landmark,bearing\na,b,north\n")
    assert done.returncode == 1
    assert done.stderr == b"bearslam: error: <stdin>:2: expected a finite number as bearing, got 'north'\n"
    assert done.stdout == b""


HALF_A_TURN = "expected a number of at least 0 and at most 180"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["solve", "none.csv"], "none.csv: No such file or directory"),
        (["solve", "."], ".: expected a file Barcodes.dat or Barcodes.dat.gz, as a UTIAS MRCLAM data set has"),
        (
            ["solve", "scene.csv", "-o", "map.txt"],
            "path: expected a name that ends in .json or .csv or .g2o or .tum, got",
        ),
        (["solve", "scene.csv", "-o", "none/map.csv"], "none/map.csv: there is no folder 'none'"),
        (["solve", "scene.csv", "--plot", "map.gif"], "path: expected a name that ends in .png or .svg or .pdf, got"),
        (["solve", "scene.csv", "--sigma-deg", "0"], "--sigma-deg: expected a number above 0, got 0"),
        (["solve", "scene.csv", "--sigma-deg", "nan"], "--sigma-deg: expected a number above 0, got nan"),
        (["solve", "scene.csv", "--triples", "0"], "triples: expected an integer from 1"),
        (["solve", "scene.csv", "--damping", "-1"], "damping: expected a number of at least 0, got -1.0"),
        (["solve", "few.csv"], ""),
        (["solve", "scene.csv", "-o", "scene.csv"], "scene.csv: the map would overwrite the bearings it is made"),
        (["solve", "scene.csv", "-o", "./alias.csv"], "./alias.csv: the map would overwrite the bearings"),
        (["simulate", "mixed", "4", "9", "-o", "a.csv", "--truth", "./a.csv"], "./a.csv: bearings and truth would"),
        (["simulate", "mixed", "1000000", "1000000"], "views: expected at most"),
        (["demo", "-o", "scene.csv"], "scene.csv: File exists"),
        (["solve", "strange.csv"], "strange.csv:1: expected a header of view,"),
        (["simulate", "mixed", "0", "9"], "views: expected an integer from 1"),
        (["simulate", "mixed", "4", "9", "--noise-deg", "-1"], "--noise-deg: expected a number of at least 0"),
        (["simulate", "mixed", "4", "9", "--noise-deg", "200"], f"--noise-deg: {HALF_A_TURN}, got 200"),
        (["sweep", "mixed", "--noise-deg", "200"], f"--noise-deg: {HALF_A_TURN}, got 200"),
        (["simulate", "mixed", "4", "9", "-o", "scene.json"], "path: expected a name that ends in .csv"),
    ],
)
def test_what_goes_wrong_is_one_line(arguments, message, scene, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "few.csv").write_text("view,landmark,bearing\na,b,0.5\n")
    (tmp_path / "alias.csv").symlink_to("scene.csv")
    (tmp_path / "strange.csv").write_bytes(bytes(10**6))
    before = sorted(path.name for path in tmp_path.iterdir())
    assert main(arguments) == 1
    line = complaint(capsys)
    assert line.startswith(message)
    assert len(line) < 1000
    assert sorted(path.name for path in tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["fly"],
        ["solve"],
        ["solve", "a.csv", "--method", "magic"],
        ["solve", "a.csv", "--seed", "x"],
        ["simulate", "mixed"],
    ],
)
def test_wrong_usage_is_one_line(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    assert "--help" in complaint(capsys)


@pytest.mark.parametrize("arguments", [["--help"], ["solve", "--help"], ["simulate", "--help"], ["demo", "--help"]])
def test_help_helps(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 0
    assert "usage: bearslam" in capsys.readouterr().out


def test_version(capsys):
    with pytest.raises(SystemExit):
        main(["--version"])
    assert capsys.readouterr().out == f"bearslam {bearslam.__version__}\n"


def test_degenerate_geometry_is_one_line(tmp_path, capsys):
    path = tmp_path / "turning.csv"
    rows = [f"{view},{mark},{mark - 0.3 * view}" for view in range(4) for mark in range(6)]
    path.write_text("view,landmark,bearing\n" + "\n".join(rows))
    assert main(["solve", str(path)]) == 1
    assert complaint(capsys)


def test_a_map_that_did_not_converge_comes_with_a_warning(tmp_path, capsys):
    path = tmp_path / "scene.csv"
    bearslam.save(bearslam.simulate("mixed", 8, 12, noise=0.1, seed=1).bearings, path)
    assert main(["solve", str(path), "--max-iterations", "1", "--tolerance", "0"]) == 0
    assert capsys.readouterr().err == "bearslam: warning: not converged (max iterations): raise max_iterations\n"


def test_a_map_that_the_bearings_hardly_determine_comes_with_a_warning(tmp_path, capsys):
    path, out = tmp_path / "scene.csv", tmp_path / "map.json"
    bearslam.save(bearslam.simulate("enclosed", 3, 6, noise=0.02, seed=1).bearings, path)
    assert main(["solve", str(path), "-o", str(out)]) == 0
    captured = capsys.readouterr()
    *_, line = captured.err.splitlines()
    assert line.startswith("bearslam: warning: the bearings hardly determine this map: ")
    assert "add sightings" in line
    saved = json.loads(out.read_text())
    assert saved["uncertainty"] > 0.5
    assert f"uncertainty {100 * saved['uncertainty']:.0f} % of the map's size" in captured.out


def test_one_view_that_is_badly_held_is_named():
    scene = bearslam.simulate("mixed", 12, 15, noise=0.01, seed=3)
    result = bearslam.solve(scene.bearings, sigma=0.01)
    kind, index = result.worst
    assert f"of {kind} {index} most" in describe(result)
    assert result.expected_error < 0.1
    loose = dataclasses.replace(result, uncertainty=0.35, worst=("view", 4))
    (line,) = reasons(loose, robust=False)
    assert re.match(r"view 4 is badly held: .* by 35 % of the size of the map, but the landmarks by [\d.]+ % on", line)
    unknown = dataclasses.replace(loose, worst=None)
    assert reasons(unknown, robust=False)[0].startswith("the bearings hardly determine this map")


def test_a_file_that_cannot_be_written_is_left_as_it_was(scene, tmp_path, monkeypatch, capsys):
    out = tmp_path / "map.json"
    out.write_text("old")

    def full(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    assert main(["solve", str(scene), "-o", str(out)]) == 1
    assert complaint(capsys) == "No space left on device"
    assert out.read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.json", "scene.csv"]


def test_without_matplotlib_a_picture_is_refused_before_the_work(scene, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.delitem(sys.modules, "bearslam.plotting.map", raising=False)
    out = tmp_path / "map.json"
    assert main(["solve", str(scene), "-o", str(out), "--plot", str(tmp_path / "map.png")]) == 1
    assert complaint(capsys) == 'pictures need matplotlib: pip install "bearslam[plot]"'
    assert not out.exists()
    assert main(["solve", str(scene), "-o", str(out)]) == 0


def test_an_interruption_is_one_line(scene, monkeypatch, capsys):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("bearslam.cli.input.load", interrupted)
    assert main(["solve", str(scene)]) == 130
    assert capsys.readouterr().err == "bearslam: interrupted\n"


class Terminal(io.StringIO):
    """A stream that claims to be a terminal."""

    def isatty(self):
        return True


def test_progress_is_shown_on_a_terminal_after_a_while_and_wiped():
    stream = Terminal()
    with ProgressLine(stream, patience=0.0) as progress:
        progress("triples", 3, 24)
    assert stream.getvalue() == "\rtriples 3/24\r            \r"


def test_short_work_and_files_get_no_progress():
    for stream, patience in ((Terminal(), 60.0), (io.StringIO(), 0.0)):
        with ProgressLine(stream, patience) as progress:
            progress("triples", 3, 24)
        assert stream.getvalue() == ""


def test_demo_reports_and_draws(tmp_path, capsys):
    folder = tmp_path / "pictures"
    assert main(["demo", "-o", str(folder)]) == 0
    out = capsys.readouterr().out
    assert "Four robots among nine landmarks, in an arena of 7 x 5 m: 36 bearings with 2.23 deg noise" in out
    assert "Four robots ringed by nine landmarks, in an arena of 7 x 5 m: 36 bearings with 1.53 deg noise" in out
    assert all(len(line) <= 110 for line in out.splitlines() if str(tmp_path) not in line)
    assert sorted(path.name for path in folder.iterdir()) == [
        f"figure_{number}.{suffix}" for number in (10, 9) for suffix in ("png", "svg")
    ]


def test_many_that_are_undetermined_are_not_all_listed(tmp_path, capsys):
    scene = bearslam.simulate("enclosed", 4, 6, noise=0.01, seed=1)
    rows = [f"{i},{j},{scene.bearings[i, j]:.17g}" for i in range(4) for j in range(6)]
    rows += [f"0,once {k},0.1" for k in range(30)]
    path = tmp_path / "scene.csv"
    path.write_text("view,landmark,bearing\n" + "\n".join(rows) + "\n")
    assert main(["solve", str(path)]) == 0
    said = capsys.readouterr().out
    assert said.count("undetermined: landmark once") == 20
    assert "undetermined: ... and 10 more" in said


def test_residuals_that_are_too_large_are_told(tmp_path, capsys):
    scene = bearslam.simulate("enclosed", 8, 12, noise=0.01, seed=1)
    path = tmp_path / "scene.csv"
    bearslam.save(scene.bearings, path)
    assert main(["solve", str(path), "--sigma-deg", "0.1"]) == 0
    assert re.search(r"warning: the residuals are [56]\.\d+ times as large", capsys.readouterr().err)
    assert main(["solve", str(path), "--sigma-deg", "0.57"]) == 0
    assert capsys.readouterr().err == ""


def test_sigma0_counts_odometry_and_priors():
    noise, sigma = 0.01, (0.02, 0.02, 0.01)
    scene = bearslam.simulate("trajectory", 60, 30, noise=noise, seed=4, sight=2.5)
    odometry = scene.odometry(sigma, seed=1)
    known = bearslam.PosePriors([0], scene.poses[:1], [0.1, 0.1, np.inf])
    beacons = bearslam.LandmarkPriors([3], scene.landmarks[3:4], 0.01)
    result = bearslam.solve(scene.bearings, sigma=noise, odometry=odometry, pose_priors=known, landmark_priors=beacons)
    assert result.sigma0 == pytest.approx(1.0, abs=0.1)
    assert 0.001 < result.p_value < 0.999
    assert np.isnan(bearslam.solve(scene.bearings).p_value)


@pytest.mark.skipif(os.name == "nt", reason="needs a shell of POSIX")
def test_a_closed_standard_error_changes_neither_exit_code_nor_output(tmp_path):
    path = tmp_path / "scene.csv"
    bearslam.save(bearslam.simulate("mixed", 4, 9, noise=0.01, seed=1).bearings, path)
    for arguments, code in (
        (f"solve {path} --sigma-deg 0.6", 0),
        (f"diagnose {path}", 0),
        ("solve none.csv", 1),
        ("solve", 2),
    ):
        command = f"{sys.executable} -m bearslam {arguments}"
        whole, closed = (
            subprocess.run(["sh", "-c", f"{command} {end}"], capture_output=True, check=False, cwd=tmp_path)
            for end in ("", "2>&-")
        )
        assert (closed.returncode, closed.stdout) == (whole.returncode, whole.stdout), arguments
        assert closed.returncode == code
        out = tmp_path / "map.json"
    done = subprocess.run(
        ["sh", "-c", f"{sys.executable} -m bearslam solve {path} -o {out} 2>&-"], capture_output=True, check=False
    )
    assert done.returncode == 0
    assert out.read_text().startswith("{")
