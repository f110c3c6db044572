# SPDX-License-Identifier: MIT OR Apache-2.0
"""The command `bearslam sweep`."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import bearslam
from bearslam import SweepResult
from bearslam.cli.main import main
from bearslam.cli.sweep import _pool

SMALL = ["sweep", "mixed", "--views", "4", "6", "--landmarks", "7", "--noise-deg", "0.1", "0.5", "--trials", "10"]


@pytest.fixture(scope="module")
def expected():
    return bearslam.sweep(["mixed"], [4, 6], 7, np.radians([0.1, 0.5]), trials=10)


def test_a_sweep_is_printed_saved_and_drawn(tmp_path, capsys, expected):
    for suffix in (".csv", ".npz"):
        out, failures, errors = (tmp_path / name for name in (f"out{suffix}", "failures.png", "errors.svg"))
        files = ["-o", str(out), "--plot", str(failures), "--plot-errors", str(errors)]
        assert main([*SMALL, *files, "--checkpoint", str(tmp_path / "sweep.db")]) == 0
        if suffix == ".npz":
            assert SweepResult.load(out).identical(expected)
        else:
            assert sum(not line.startswith("#") for line in out.read_text().splitlines()) == 1 + 4 * 3
        assert failures.read_bytes().startswith(b"\x89PNG")
        assert errors.read_bytes().startswith(b"<?xml")
        captured = capsys.readouterr()
        assert captured.err == ""
        first, _, *table = captured.out.splitlines()
        assert first == "40 of 40 scenes, 4, 6 views, 7 landmarks"
        assert max(map(len, table)) < 140
        assert [line.split()[:4] for line in table[2:]] == [
            ["mixed", noise, "deg", start] for noise in ("0.1", "0.5") for start in ("random", "projective", "solve")
        ]
        total = expected.total("random", noise=np.radians(0.5))
        low, high = total.failure_interval()
        cells = table[5].split()[4:]
        assert cells[:5] == [
            "20",
            f"{100 * total.failure_rate:.3g}",
            f"{100 * low:.3g}",
            "to",
            f"{100 * high:.3g}",
        ]
        assert float(cells[7]) == pytest.approx(np.degrees(total.heading_median), rel=0.01)
        assert len(cells) == 13


def test_options_reach_the_sweep(tmp_path):
    out = tmp_path / "out.npz"
    options = ["--starts", "solve", "calibrated", "--seed", "7", "--chunk", "3", "--threads", "1"]
    assert main([*SMALL, *options, "-o", str(out)]) == 0
    wanted = bearslam.sweep(
        ["mixed"], [4, 6], 7, np.radians([0.1, 0.5]), trials=10, starts=("solve", "calibrated"), seed=7
    )
    assert SweepResult.load(out).identical(wanted)


def test_the_defaults_are_those_of_the_paper(monkeypatch):
    seen = {}

    def sweep(*arguments, **options):
        seen.update(options, arguments=arguments)
        return bearslam.sweep("mixed", 4, 7, 0.1, trials=1)

    monkeypatch.setattr("bearslam.cli.sweep.sweep", sweep)
    assert main(["sweep"]) == 0
    layouts, views, landmarks, noise = seen["arguments"]
    assert layouts == ["mixed", "enclosed"]
    assert (views, landmarks) == ([4, 6, 8, 10, 12], [7, 9, 11, 13, 15])
    assert noise == pytest.approx(np.radians([0.1, 0.5, 1.0]))
    assert (seen["trials"], seen["starts"], seen["seed"]) == (50, ["random", "projective", "solve"], 0)


def test_processes_find_the_same(tmp_path, expected):
    out = tmp_path / "out.npz"
    before = signal.getsignal(signal.SIGINT)
    assert main([*SMALL, "--workers", "2", "-o", str(out)]) == 0
    assert SweepResult.load(out).identical(expected)
    assert signal.getsignal(signal.SIGINT) is before


GOING = """\
import signal, sys
import bearslam.cli.main, bearslam.cli.sweep

def sweep(*arguments, sweep=bearslam.cli.sweep.sweep, **options):
    options["progress"] = lambda stage, done, total: print("going", flush=True) if done < 20 else None
    return sweep(*arguments, **options)

if __name__ == "__main__":
    # If the tests run in the background, the signal is ignored from the start.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    bearslam.cli.sweep.sweep = sweep
    sys.exit(bearslam.cli.main.main(sys.argv[1:]))
"""


def left_behind(group, patience):
    """The group if it still has processes after so many seconds."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return None
        time.sleep(0.05)
    return group


@pytest.mark.skipif(os.name == "nt", reason="needs SIGINT")
@pytest.mark.parametrize("how", [["--threads", "1"], ["--workers", "2"]])
def test_ctrl_c_prints_and_saves_what_is_done(tmp_path, how):
    script, out, saved = (tmp_path / name for name in ("script.py", "out.npz", "sweep.db"))
    script.write_text(GOING)
    command = [sys.executable, script, "sweep", "mixed", "--trials", "1000", "--chunk", "2", *how]
    command += ["-o", out, "--checkpoint", saved]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, **pipes, start_new_session=True) as process:
        try:
            assert process.stdout.readline() == b"going\n"
            time.sleep(0.3)
            start = time.monotonic()
            os.killpg(process.pid, signal.SIGINT)  # as a terminal does
            printed, err = process.communicate(timeout=60)
        finally:
            process.kill()
    # Within a second, which a person perceives as immediate; the machine may be busy.
    assert time.monotonic() - start < 3.0
    assert process.returncode == 130
    part = SweepResult.load(out)
    assert err.decode() == f"bearslam: interrupted after {part.done.sum()} of 75000 scenes\n"
    assert f"{part.done.sum()} of 75000 scenes".encode() in printed
    assert not part.complete
    assert left_behind(process.pid, patience=5.0) is None


def test_a_broken_pool_is_an_error_that_saves_what_is_done(tmp_path, monkeypatch, capsys, expected):
    out = tmp_path / "out.npz"

    def broken(*arguments, **options):
        raise bearslam.ExecutorError("executor: gone", result=expected)

    monkeypatch.setattr("bearslam.cli.sweep.sweep", broken)
    assert main([*SMALL, "-o", str(out)]) == 1
    captured = capsys.readouterr()
    assert captured.err == "bearslam: error: executor: gone\n"
    assert "40 of 40 scenes" in captured.out
    assert SweepResult.load(out).identical(expected)


def test_an_interruption_before_anything_is_done_writes_nothing(tmp_path, monkeypatch, capsys):
    out = tmp_path / "out.npz"
    out.write_text("old")

    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("bearslam._core.sweep", interrupted)
    assert main([*SMALL, "-o", str(out)]) == 130
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "bearslam: interrupted after 0 of 40 scenes\n")
    assert out.read_text() == "old"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--views", "2"], "views[0]: expected an integer from 3"),
        (["--noise-deg", "nan"], "--noise-deg: expected a number of at least 0 and at most 180, got nan"),
        (["--noise-deg", "-1"], "--noise-deg: expected a number of at least 0 and at most 180, got -1.0"),
        (["--trials", "0"], "trials: expected an integer from 1"),
        (["--starts", "solve", "solve"], "starts: expected every value once, got 'solve' again"),
        (["--workers", "-1"], "--workers: expected an integer from 0"),
        (
            ["--workers", "2", "--threads", "2"],
            "--workers: each worker has one thread; give either --workers or --threads",
        ),
        (["-o", "out.json"], "path: expected a name that ends in .npz or .csv, got 'out.json'"),
        (["-o", "none/out.csv"], "none/out.csv: there is no folder 'none'"),
        (["--plot", "out.gif"], "path: expected a name that ends in .png or .svg or .pdf"),
        (["--plot", "a.png", "--plot-errors", "./a.png"], "./a.png: two outputs would overwrite each other"),
        (["--plot", "a.png", "--plot-errors", "a.png"], "a.png: two outputs would overwrite each other"),
        (["-o", "a.csv", "--checkpoint", "a.csv"], "a.csv: two outputs would overwrite each other"),
        (["--checkpoint", "notes.txt"], "checkpoint: notes.txt: expected a checkpoint of a sweep, got another file"),
    ],
)
def test_what_goes_wrong_is_one_line(options, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "notes.txt").write_text("notes\n" * 100)
    assert main([*SMALL, *options]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"bearslam: error: {message}")
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["ring"], "argument LAYOUT: expected mixed, enclosed, trajectory, got 'ring'"),
        (["mixed", "--starts", "magic"], "argument --starts: expected random, projective, calibrated, solve, got"),
        (["mixed", "--views", "many"], "argument --views: invalid int value: 'many'"),
    ],
)
def test_wrong_usage_is_one_line(options, message, capsys):
    with pytest.raises(SystemExit) as caught:
        main(["sweep", *options])
    assert caught.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"bearslam: error: {message}")


def test_help_helps(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["sweep", "--help"])
    assert caught.value.code == 0
    text = capsys.readouterr().out
    assert "(default: 4 6 8 10 12)" in text
    assert "bearslam sweep --trials 10 -o sweep.npz --plot failures.png" in text


def test_processes_end_with_the_command_whatever_they_are_at():
    before = set(multiprocessing.active_children())
    with _pool(1) as pool:
        pool.submit(int).result()
        task = pool.submit(time.sleep, 60)
        while not task.running():
            time.sleep(0.01)
        start = time.monotonic()
    while set(multiprocessing.active_children()) - before:
        assert time.monotonic() - start < 10.0
        time.sleep(0.01)
