# SPDX-License-Identifier: MIT OR Apache-2.0
"""Checkpoints: nothing is done twice, nothing is lost, and nothing else is taken for one."""

import os
import random
import signal
import sqlite3
import subprocess
import sys
import time

import numpy as np
import pytest

import bearslam
from bearslam import InvalidInputError, _core
from bearslam.montecarlo import checkpoint

ARGUMENTS = {
    "layout": "mixed",
    "views": [4, 6],
    "landmarks": [7, 9],
    "noise": np.radians([0.1, 0.5]),
    "trials": 20,
    "chunk": 2,
    "starts": ("projective", "solve"),
}
SCENES = 160


@pytest.fixture(scope="module")
def expected():
    return bearslam.sweep(**ARGUMENTS)


@pytest.fixture
def work(monkeypatch):
    """Scenes requested from the core, call by call."""
    asked = []
    run = _core.sweep

    def counting(chunks, *others):
        asked.append(sum(end - first for *_, first, end in chunks))
        return run(chunks, *others)

    monkeypatch.setattr(_core, "sweep", counting)
    return asked


def stop_after(scenes, error):
    def progress(stage, done, total):
        if done >= scenes:
            raise error

    return progress


def test_an_interrupted_sweep_goes_on_where_it_was(tmp_path, expected, work):
    path = tmp_path / "sweep.db"
    part = bearslam.sweep(**ARGUMENTS, checkpoint=path, progress=stop_after(50, KeyboardInterrupt), threads=1)
    assert not part.complete
    seen = []
    again = bearslam.sweep(**ARGUMENTS, checkpoint=path, progress=lambda *told: seen.append(told))
    assert again.identical(expected)
    assert work == [SCENES, SCENES - part.done.sum()]
    assert seen[0] == ("scenes", part.done.sum() + 2, SCENES)


def test_errors_do_not_cost_what_is_done(tmp_path, expected, work):
    path = tmp_path / "sweep.db"
    with pytest.raises(ZeroDivisionError):
        bearslam.sweep(**ARGUMENTS, checkpoint=path, progress=stop_after(50, ZeroDivisionError), threads=1)
    assert bearslam.sweep(**ARGUMENTS, checkpoint=str(path)).identical(expected)
    assert work == [SCENES, SCENES - 50]


def test_a_finished_sweep_does_no_work(tmp_path, expected, work):
    path = tmp_path / "sweep.db"
    first = bearslam.sweep(**ARGUMENTS, checkpoint=path)
    again = bearslam.sweep(**{**ARGUMENTS, "chunk": 7}, checkpoint=path)
    assert again.identical(expected)
    assert again.identical(first, times=True)
    assert work[1:] in ([], [0])


def test_trials_may_grow_but_not_shrink(tmp_path, work):
    path = tmp_path / "sweep.db"
    bearslam.sweep(**ARGUMENTS, checkpoint=path)
    more = {**ARGUMENTS, "trials": 30, "chunk": 3}
    assert bearslam.sweep(**more, checkpoint=path).identical(bearslam.sweep(**more))
    assert work == [SCENES, SCENES / 2, 3 * SCENES / 2]
    with pytest.raises(InvalidInputError, match="trials: expected at least the 30 in the checkpoint, got 20"):
        bearslam.sweep(**ARGUMENTS, checkpoint=path)


KILLED = """\
import sys, time
import numpy as np
import bearslam

def progress(stage, done, total):
    print(done, flush=True)
    if done == 10:
        time.sleep(100)

bearslam.sweep(
    "mixed", [4, 6], [7, 9], np.radians([0.1, 0.5]), trials=20, chunk=2, starts=("projective", "solve"),
    checkpoint=sys.argv[1], progress=progress, threads=1,
)
"""


def test_a_killed_process_loses_half_a_second(tmp_path, expected, work):
    path = tmp_path / "sweep.db"
    with subprocess.Popen([sys.executable, "-c", KILLED, path], stdout=subprocess.PIPE) as process:
        assert b"10\n" in iter(process.stdout.readline, b"")
        time.sleep(1.0)  # commits are half a second apart, and the machine may be busy
        process.kill()
    assert process.returncode == -signal.SIGKILL
    assert bearslam.sweep(**ARGUMENTS, checkpoint=path).identical(expected)
    assert work == [SCENES - 10]


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"seed": 1}, "seed '0' instead of '1'"),
        ({"views": [4, 8]}, "views '4 6' instead of '4 8'"),
        ({"landmarks": 7}, "landmarks '7 9' instead of '7'"),
        ({"noise": [0.1]}, "noise '0.0017453292519943296 0.008726646259971648' instead of '0.1'"),
        ({"layout": "enclosed"}, "layout 'mixed' instead of 'enclosed'"),
        ({"starts": "solve"}, "starts 'projective solve' instead of 'solve'"),
    ],
)
def test_a_checkpoint_of_another_sweep_is_refused(tmp_path, other, message):
    path = tmp_path / "sweep.db"
    few = {**ARGUMENTS, "trials": 1}
    bearslam.sweep(**few, checkpoint=path)
    before = path.read_bytes()
    with pytest.raises(InvalidInputError, match=f"sweep.db belongs to another sweep: {message}"):
        bearslam.sweep(**{**few, **other}, checkpoint=path)
    assert path.read_bytes() == before


def test_results_of_another_version_are_not_mixed_in(tmp_path, monkeypatch):
    path = tmp_path / "sweep.db"
    few = {**ARGUMENTS, "trials": 1}
    bearslam.sweep(**few, checkpoint=path)
    monkeypatch.setattr(checkpoint, "__version__", "99.0")
    with pytest.raises(InvalidInputError, match=f"bearslam '{bearslam.__version__}' instead of '99.0'"):
        bearslam.sweep(**few, checkpoint=path)


def other_database(path):
    with sqlite3.connect(path) as file:
        file.execute("CREATE TABLE chunk (cell)")
    file.close()


def newer_format(path):
    bearslam.sweep(**{**ARGUMENTS, "trials": 1}, checkpoint=path)
    with sqlite3.connect(path) as file:
        file.execute("PRAGMA user_version = 7")
    file.close()


def lost_pages(path):
    """A corrupt list of free pages: the recorded chunks are intact, but new ones would be lost."""
    bearslam.sweep(**{**ARGUMENTS, "trials": 1}, checkpoint=path)
    data = bytearray(path.read_bytes())
    data[32:40] = (999_999).to_bytes(4, "big") + (5).to_bytes(4, "big")
    path.write_bytes(data)


def statement(text):
    def spoil(path):
        bearslam.sweep(**{**ARGUMENTS, "trials": 1}, checkpoint=path)
        with sqlite3.connect(path) as file:
            file.execute(text)
        file.close()

    return spoil


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (
            lambda path: path.write_text("view,landmark,bearing\n" * 100),
            "expected a checkpoint of a sweep, got another",
        ),
        (other_database, "expected a checkpoint of a sweep, got another file"),
        (lost_pages, "is damaged"),
        (newer_format, "expected format 1, got 7"),
        (statement("UPDATE chunk SET tally = x'00' WHERE cell = 1"), "is damaged: .*; delete it to begin anew"),
        (statement("UPDATE chunk SET tally = 'text'"), "is damaged"),
        (statement("UPDATE chunk SET tally = (SELECT tally || tally FROM chunk)"), "is damaged"),
        (statement('UPDATE chunk SET "end" = 5'), "is damaged: a chunk with implausible counts"),
        (statement("UPDATE chunk SET cell = cell + 1000"), "is damaged: a chunk from 0 to 1 in cell 1000"),
        (statement("UPDATE chunk SET cell = 'a' WHERE cell = 3"), "is damaged"),
        (statement('UPDATE chunk SET "end" = 0'), "is damaged: a chunk from 0 to 0"),
        (statement("INSERT INTO chunk SELECT cell, -1, 1, tally FROM chunk"), "is damaged: a chunk from -1"),
        (statement("DROP TABLE chunk"), "is damaged"),
        (statement("DELETE FROM design"), "belongs to another sweep: bearslam None instead of"),
    ],
)
def test_damaged_and_foreign_files_are_refused(tmp_path, spoil, message):
    path = tmp_path / "sweep.db"
    spoil(path)
    before = path.read_bytes()
    with pytest.raises(InvalidInputError, match=f"checkpoint: .*sweep.db:? {message}"):
        bearslam.sweep(**{**ARGUMENTS, "trials": 1}, checkpoint=path)
    assert path.read_bytes() == before


def test_no_damage_gets_another_error_or_another_result(tmp_path, expected):
    path = tmp_path / "sweep.db"
    bearslam.sweep(**ARGUMENTS, checkpoint=path)
    whole = path.read_bytes()
    dice = random.Random(1)
    refused = 0
    for trial in range(60):
        spoiled = bytearray(whole)
        if trial % 2:
            del spoiled[dice.randrange(len(whole)) :]
        else:
            for _ in range(dice.choice([1, 100])):
                spoiled[dice.randrange(len(whole))] = dice.randrange(256)
        path.write_bytes(spoiled)
        try:
            result = bearslam.sweep(**ARGUMENTS, checkpoint=path)
        except InvalidInputError as error:
            assert str(error).startswith("checkpoint: ")
            refused += 1
        else:
            assert result.identical(expected)
    assert refused > 20


def test_two_sweeps_do_not_write_to_one_file(tmp_path):
    path = tmp_path / "sweep.db"

    def progress(stage, done, total):
        with pytest.raises(InvalidInputError, match="sweep.db is in use by another sweep"):
            bearslam.sweep(**ARGUMENTS, checkpoint=path)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        bearslam.sweep(**ARGUMENTS, checkpoint=path, progress=progress)


def test_a_full_disk_is_an_error_that_leaves_a_good_file(tmp_path, expected, monkeypatch):
    path = tmp_path / "sweep.db"
    first = bearslam.sweep(**ARGUMENTS, checkpoint=path, progress=stop_after(50, KeyboardInterrupt), threads=1)
    commit = checkpoint.Checkpoint._commit

    def full(self):
        (pages,) = self._file.execute("PRAGMA page_count").fetchone()
        self._file.execute(f"PRAGMA max_page_count = {pages}")
        commit(self)

    monkeypatch.setattr(checkpoint.Checkpoint, "_commit", full)
    with pytest.raises(OSError, match="full") as caught:
        bearslam.sweep(**ARGUMENTS, checkpoint=path)
    assert caught.value.filename == str(path)
    monkeypatch.undo()
    again = bearslam.sweep(**ARGUMENTS, checkpoint=path)
    assert again.identical(expected)
    assert first.done.sum() > 0


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_cannot_be_written_to(tmp_path):
    (tmp_path / "locked").mkdir(mode=0o555)
    with pytest.raises(PermissionError):
        bearslam.sweep(**ARGUMENTS, checkpoint=tmp_path / "locked" / "sweep.db")
