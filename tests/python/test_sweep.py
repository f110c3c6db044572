# SPDX-License-Identifier: MIT OR Apache-2.0
"""Monte-Carlo sweeps: what is counted, and that it does not matter how."""

import math
import pickle
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

import bearslam
from bearslam import InvalidInputError, SweepResult, _core
from bearslam.montecarlo import ledger
from bearslam.montecarlo.grid import Chunk, Grid, chunk_size, cut
from bearslam.montecarlo.statistics import Total
from bearslam.montecarlo.tally import COUNTS, Tally

GRID = {"layout": ["mixed", "enclosed"], "views": [4, 6], "landmarks": [7, 9], "noise": np.radians([0.1, 0.5])}
FAST = {**GRID, "trials": 20, "starts": ("projective", "solve")}


@pytest.fixture(scope="session")
def result():
    return bearslam.sweep(**GRID, trials=30)


@pytest.fixture(scope="session")
def fast():
    return bearslam.sweep(**FAST, threads=1)


def test_solve_does_not_fail_where_random_starts_do(result):
    assert result.complete
    assert result.start == ("random", "projective", "solve")
    assert result.total("solve").failures == 0
    assert result.total("random").failure_rate > 0.4
    assert result.total("random").failures > result.total("projective").failures > 0
    assert 0.8 < result.total("solve").position_ratio < 1.2
    assert result.total("random").mean_iterations > result.total("solve").mean_iterations > 1
    assert all((seconds > 0).all() for seconds in result.mean_seconds.values())


def test_times_are_seconds():
    start = time.perf_counter()
    sweep = bearslam.sweep("mixed", 6, 9, 0.01, trials=100, threads=1)
    passed = time.perf_counter() - start
    # The rest is for drawing scenes and judging.
    assert 0.2 * passed < sum(100 * sweep.total(one).mean_seconds for one in sweep.start) < passed


def test_shapes_follow_the_layout(result):
    assert result.failure_rate["solve"].shape == (2, 2, 2, 2)
    assert result.failure_interval()["solve"].shape == (2, 2, 2, 2, 2)
    assert result.done.tolist() == np.full((2, 2, 2, 2), 30).tolist()
    one = bearslam.sweep("enclosed", 4, [7, 9], np.radians([0.1, 0.5]), trials=30)
    assert one.failures["random"].shape == (2, 1, 2)
    for start in one.start:
        assert one.failures[start].tolist() == result.failures[start][1, :, :1].tolist()
        assert one.heading_p90[start].tolist() == result.heading_p90[start][1, :, :1].tolist()


@pytest.mark.parametrize("how", [{"threads": 2}, {"chunk": 1}, {"chunk": 7, "threads": 2}, {"chunk": 1000}])
def test_pieces_and_threads_do_not_matter(fast, how):
    assert bearslam.sweep(**FAST, **how).identical(fast)


def test_other_seeds_give_other_scenes(fast):
    assert not bearslam.sweep(**FAST, seed=1).identical(fast)


def test_what_is_counted_can_be_drawn_and_solved_again():
    sweep = bearslam.sweep("enclosed", 5, 8, 0.02, trials=40, starts="solve", seed=2**64 - 1)
    position, heading = [], []
    for trial in range(40):
        scene = sweep.scene(trial, layout="enclosed", noise=0.02, views=5, landmarks=8)
        found = bearslam.solve(scene.bearings, sigma=0.02)
        points = [np.concatenate([one.poses[:, :2], one.landmarks]) for one in (found, scene)]
        similarity = bearslam.align(*points)
        position.append(math.sqrt(((similarity.apply(points[0]) - points[1]) ** 2).sum(axis=1).mean()))
        turned = similarity.apply_poses(found.poses)[:, 2] - scene.poses[:, 2]
        heading.append(math.sqrt((np.angle(np.exp(1j * turned)) ** 2).mean()))
    _, quantity, place, size = sweep.tally.bins().T
    for index, values in enumerate((position, heading)):
        own = quantity == index
        # A value on the border of two bins may fall to either side.
        binned = np.repeat(place[own], size[own])
        assert np.abs(binned - np.sort(np.floor(64 * np.log2(values)))).max() <= 1
    for q in (0.0, 0.5, 0.9, 1.0):
        exact = np.sort(heading)[math.floor(39 * q)]
        assert sweep.quantile("heading", q)["solve"].item() == pytest.approx(exact, rel=0.02)


def test_quantiles_and_roots_are_those_of_the_values():
    values = np.random.default_rng(1).lognormal(size=1001)
    place = np.floor(64 * np.log2(values)).astype(int)
    rows = np.stack([np.zeros_like(place), np.full_like(place, 2), place, np.ones_like(place)], axis=1)
    counts = np.array([[1001, 0, 0, 0, 0, 0]] * 2)
    total = Total(Tally.empty(2).plus([(0, counts, rows[:400]), (0, 0 * counts, rows[400:])]))
    for q in (0.0, 0.1, 0.5, 0.999, 1.0):
        exact = np.sort(values)[math.floor(1000 * q)]
        assert total.quantile("position_ratio", q) == pytest.approx(exact, rel=0.0055)
    assert total.position_ratio == pytest.approx(math.sqrt((values**2).mean()), rel=0.002)
    assert math.isnan(total.heading_ratio)
    assert math.isnan(total.position_median)


@pytest.mark.parametrize(
    ("failures", "trials", "low", "high"),
    # Newcombe, Statistics in Medicine 17, 1998, table I, method 3.
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_intervals_are_those_of_wilson(failures, trials, low, high):
    counts = np.array([[trials, failures, 0, 0, 0, 0], [trials, trials - failures, 0, 0, 0, 0]])
    tally = Tally(counts, np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
    ours, mirrored = tally.failure_interval(0.95)
    assert ours == pytest.approx([low, high], abs=5e-5)
    assert mirrored == pytest.approx([1 - high, 1 - low], abs=5e-5)
    assert ours[0] == 0.0 or failures > 0
    theirs = binomtest(failures, trials).proportion_ci(0.7, method="wilson")
    assert tally.failure_interval(0.7)[0] == pytest.approx([theirs.low, theirs.high], rel=1e-12, abs=1e-15)


def test_totals_are_sums_of_cells(result):
    index = {"layout": "enclosed", "noise": np.radians(0.5), "views": 6}
    total = result.total("random", **index)
    assert total.trials == 60
    assert total.failures == result.failures["random"][1, 1, 1].sum()
    assert total.incomplete == result.incomplete["random"][1, 1, 1].sum()
    one = result.total("random", **index, landmarks=9)
    assert one.failure_rate == result.failure_rate["random"][1, 1, 1, 1]
    assert one.heading_median == result.heading_median["random"][1, 1, 1, 1]
    assert one.position_ratio == result.position_ratio["random"][1, 1, 1, 1]
    assert one.failure_interval(0.9) == tuple(result.failure_interval(0.9)["random"][1, 1, 1, 1])
    assert "failures in 30 trials" in repr(one)


def test_sweeps_with_other_seeds_can_be_merged(fast):
    other = bearslam.sweep(**FAST, seed=1)
    both = fast.merge(other)
    assert (both.trials, both.seeds, both.complete) == (40, (0, 1), True)
    for start in both.start:
        assert (both.failures[start] == fast.failures[start] + other.failures[start]).all()
    assert both.identical(SweepResult(other.grid, 40, (0, 1), other.merge(fast).tally))
    assert both.scene(3, layout="mixed", noise=FAST["noise"][0], views=4, landmarks=7, seed=1).bearings.shape == (4, 7)
    for twin, message in [
        (fast, "other: expected a sweep with another seed, got 0 again"),
        (bearslam.sweep(**{**FAST, "views": [4, 8]}, seed=1), r"same kinds of scenes, got views \(4, 8\) instead of"),
        (bearslam.sweep(**{**FAST, "starts": ("solve",)}, seed=1), "got start"),
        (3, "other: expected the result of a sweep, got 3"),
    ]:
        with pytest.raises(InvalidInputError, match=message):
            fast.merge(twin)


def test_without_noise_there_is_no_bound():
    sweep = bearslam.sweep("mixed", 4, 9, [0.0, 0.01], trials=10, starts="solve")
    assert sweep.failures["solve"].tolist() == [[[0]], [[0]]]
    assert (sweep.position_median["solve"] > 0).all()
    assert np.isnan(sweep.heading_ratio["solve"][0])
    assert np.isfinite(sweep.heading_ratio["solve"][1])
    assert sweep.total("solve").heading_ratio == sweep.heading_ratio["solve"][1]


def test_too_few_landmarks_are_failures():
    sweep = bearslam.sweep("trajectory", 3, 4, 0.01, trials=10, starts=("projective", "calibrated", "solve"))
    for start in sweep.start:
        total = sweep.total(start)
        assert (total.failures, total.without_map, total.failure_rate) == (10, 10, 1.0)
        assert math.isnan(total.heading_median)


def test_progress_counts_scenes():
    calls = []
    bearslam.sweep(**FAST, progress=lambda *arguments: calls.append(arguments))
    assert [call[1] for call in calls] == sorted(call[1] for call in calls)
    assert {(stage, total) for stage, _, total in calls} == {("scenes", 320)}
    assert calls[-1] == ("scenes", 320, 320)


@pytest.mark.parametrize("progress", [True, False])
def test_a_bar_is_shown_on_terminals_only(progress, capsys):
    bearslam.sweep(**FAST, progress=progress)
    assert capsys.readouterr().err == ""


def test_a_bar_is_shown_on_terminals(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    bearslam.sweep(**FAST, progress=True)
    shown = capsys.readouterr().err
    assert "320/320" in shown
    assert "scenes/s" in shown


def test_an_interruption_returns_what_is_done():
    def stop(stage, done, total):
        if done >= 100:
            raise KeyboardInterrupt

    part = bearslam.sweep(**FAST, progress=stop, threads=1)
    assert not part.complete
    assert 100 <= part.done.sum() < 320
    untouched = bearslam.sweep(**FAST, progress=lambda *_: (_ for _ in ()).throw(KeyboardInterrupt), threads=1)
    cells = untouched.done == 0
    assert cells.any()
    for numbers in (
        untouched.failure_rate,
        untouched.heading_median,
        untouched.position_ratio,
        untouched.mean_seconds,
        untouched.mean_iterations,
        {start: ends[..., 0] for start, ends in untouched.failure_interval().items()},
    ):
        assert np.isnan(numbers["solve"][cells]).all()
        assert np.isfinite(numbers["solve"][~cells]).all()


def test_errors_in_progress_come_out():
    with pytest.raises(ZeroDivisionError):
        bearslam.sweep(**FAST, progress=lambda *_: 1 / 0)


INTERRUPTED = """\
import os, signal, sys, threading, time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
import bearslam

def fire():
    global start
    start = time.monotonic()
    os.kill(os.getpid(), signal.SIGINT)

def progress(stage, done, total):
    global timer
    if timer is None:
        timer = threading.Timer(0.2, fire)
        timer.start()

if __name__ == "__main__":
    # If the tests run in the background, the signal is ignored from the start.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = None
    pool = ProcessPoolExecutor(2, get_context("spawn")) if sys.argv[1] == "pool" else None
    # Chunks of one scene, and scenes that take long: an interruption has to stop the work inside them.
    result = bearslam.sweep("mixed", [8, 60], [15, 60], 0.02, trials=10**4, chunk=1, executor=pool, progress=progress)
    print(time.monotonic() - start, int(result.done.sum()), result.complete, flush=True)
    if pool is not None:
        pool.shutdown(cancel_futures=True)
"""


@pytest.mark.parametrize("where", ["here", "pool"])
def test_ctrl_c_returns_within_a_second(where, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(INTERRUPTED)
    done = subprocess.run([sys.executable, script, where], capture_output=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (0, b"")
    seconds, scenes, complete = done.stdout.split()
    assert float(seconds) < 1.0
    assert int(scenes) > 0
    assert complete == b"False"


@pytest.mark.parametrize("rows", [1, 10**6])
def test_a_chunk_counts_once_however_often_it_is_entered(monkeypatch, rows):
    monkeypatch.setattr(ledger, "ROWS", rows)  # added up at every step, or at the end
    grid = Grid.of("mixed", 4, [7, 9], 0.01, ("projective", "solve"))
    book = ledger.Ledger(grid)
    parts = {}
    raw = [grid.raw(Chunk(cell, 0, 5)) for cell in (0, 1)]
    _core.sweep(raw, grid.start, 0, 1, lambda cell, *arrays: parts.update({Chunk(cell, 0, 5): arrays}))
    for repeat in range(3):
        for chunk, arrays in parts.items():
            assert book.enter(chunk, *arrays) == (repeat == 0)
    assert book.tally().counts[:, 0].tolist() == [5, 5, 5, 5]
    once = bearslam.sweep("mixed", 4, [7, 9], 0.01, trials=5, starts=("projective", "solve"))
    assert SweepResult(grid, 5, (0,), book.tally()).identical(once)


def test_chunks_cover_what_is_missing_once():
    grid = Grid.of("mixed", [4, 5, 6], 7, 0.1, "solve")
    done = {0: [(0, 5), (8, 10)], 2: [(0, 25)]}
    chunks = cut(grid, 25, 4, done)
    assert chunks[0] == Chunk(1, 0, 4)
    assert all(0 < chunk.end - chunk.first <= 4 for chunk in chunks)
    covered = sorted((chunk.cell, trial) for chunk in chunks for trial in range(chunk.first, chunk.end))
    assert covered == [(0, t) for t in range(25) if 5 <= t < 8 or t >= 10] + [(1, t) for t in range(25)]
    assert [chunk.first for chunk in chunks] == sorted(chunk.first for chunk in chunks)


@pytest.mark.parametrize(
    ("scenes", "size"), [(1, 10), (7500, 10), (20_000, 10), (20_001, 11), (10**6, 500), (10**9, 10_000)]
)
def test_sizes_of_chunks(scenes, size):
    assert chunk_size(scenes) == size


def test_results_can_be_sent_to_other_processes(fast):
    assert pickle.loads(pickle.dumps(fast)).identical(fast, times=True)
    error = bearslam.ExecutorError("gone", result=fast)
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again)) == (bearslam.ExecutorError, "gone")
    assert again.result.identical(fast)
    assert issubclass(bearslam.ExecutorError, (bearslam.BearslamError, RuntimeError))


def test_results_are_not_changed_by_accident(fast):
    with pytest.raises(ValueError, match="read-only"):
        fast.tally.counts[0, 0] = 1
    fast.failures["solve"][...] = 7
    assert fast.total("solve").failures == 0


def test_what_a_result_says_of_itself(fast):
    assert repr(fast) == "<SweepResult: 2 layouts, 2 noises, 2 views, 2 landmarks, 2 starts; 320 of 320 scenes>"
    assert fast.noise.tolist() == FAST["noise"].tolist()
    assert (fast.views.tolist(), fast.landmarks.tolist()) == ([4, 6], [7, 9])
    assert set(COUNTS) > {"failures", "without_map"}


GOOD = {"layout": "mixed", "views": 4, "landmarks": 7, "noise": 0.01, "trials": 1}
WRONG = [
    ({"layout": "ring"}, "layout: expected 'mixed' or 'enclosed' or 'trajectory', got 'ring'"),
    ({"layout": ["mixed", "ring"]}, r"layout\[1\]: expected 'mixed' or"),
    ({"layout": []}, "layout: expected at least one value, got none"),
    ({"layout": ["mixed", "mixed"]}, "layout: expected every value once, got 'mixed' again"),
    ({"layout": 3}, "layout: expected 'mixed' or"),
    ({"views": 2}, "views: expected an integer from 3"),
    ({"views": [4, 2]}, r"views\[1\]: expected an integer from 3"),
    ({"views": range(0)}, "views: expected at least one value, got none"),
    ({"views": [4, 4]}, "views: expected every value once, got 4 again"),
    ({"views": "46"}, "views: expected an integer, got '46'"),
    ({"views": range(3, 10**9)}, "views: expected at most 10000 values, got more"),
    ({"views": 10**6, "landmarks": 10**6}, "views: expected at most 134217728 pairs with landmarks"),
    ({"landmarks": [3]}, r"landmarks\[0\]: expected an integer from 4"),
    ({"landmarks": 7.5}, "landmarks: expected an integer, got 7.5"),
    ({"noise": -0.1}, "noise: expected a number of at least 0, got -0.1"),
    ({"noise": [0.1, np.nan]}, r"noise\[1\]: expected a number of at least 0, got"),
    ({"noise": np.inf}, "noise: expected a number"),
    ({"noise": [0.0, -0.0]}, "noise: expected every value once, got 0.0 again"),
    ({"noise": np.linspace(0, 1, 1001), "views": range(3, 1003)}, "noise: expected at most 1000000 kinds of scenes"),
    ({"trials": 0}, "trials: expected an integer from 1"),
    ({"trials": 10**12, "chunk": 1}, "chunk: expected a size that makes at most 10000000 chunks, got 1"),
    ({"starts": []}, "starts: expected at least one value, got none"),
    ({"starts": ["solve", "magic"]}, r"starts\[1\]: expected 'random' or 'projective' or 'calibrated' or 'solve'"),
    ({"starts": ["solve", "solve"]}, "starts: expected every value once, got 'solve' again"),
    ({"seed": -1}, "seed: expected an integer from 0"),
    ({"seed": 2**64}, "seed: expected an integer from 0 to 18446744073709551615"),
    ({"chunk": 0}, "chunk: expected an integer from 1"),
    ({"threads": -1}, "threads: expected an integer from 0"),
    ({"progress": 3}, "progress: expected True, False or a function"),
    ({"executor": 3}, "executor: expected None or an executor with a method submit, got 3"),
    ({"executor": __import__("concurrent.futures").futures.ProcessPoolExecutor}, "executor: expected None or"),
    ({"checkpoint": 3}, "checkpoint: expected None or a path, got 3"),
    ({"checkpoint": "none/sweep.db"}, "checkpoint: there is no folder 'none'"),
    ({"checkpoint": "."}, "checkpoint: expected a file, got the folder"),
]


@pytest.mark.parametrize(("wrong", "message"), WRONG)
def test_a_wrong_argument_is_named_before_any_work(wrong, message, monkeypatch):
    monkeypatch.setattr(_core, "sweep", lambda *_: pytest.fail("there was work"))
    with pytest.raises(InvalidInputError, match=message):
        bearslam.sweep(**{**GOOD, **wrong})


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda one: one.quantile("angle", 0.5), "quantity: expected 'position' or 'heading' or"),
        (lambda one: one.quantile("heading", 1.5), "q: expected a number of at least 0 and at most 1, got 1.5"),
        (lambda one: one.failure_interval(0.0), "confidence: expected a number above 0"),
        (lambda one: one.failure_interval(1.0), "confidence: expected a number below 1"),
        (lambda one: one.total("random"), "start: expected 'projective' or 'solve', got 'random'"),
        (lambda one: one.total("solve", views=5), r"views: expected one of the sweep, \(4, 6\), got 5"),
        (lambda one: one.total("solve", noise=0.1), "noise: expected one of the sweep"),
        (lambda one: one.scene(0, layout="mixed", noise=0.1, views=4, landmarks=7), "noise: expected one of the sweep"),
        (lambda one: one.plot("lines"), "kind: expected 'failures' or 'errors', got 'lines'"),
    ],
)
def test_wrong_questions_are_refused(fast, call, message):
    with pytest.raises(InvalidInputError, match=message):
        call(fast)


anything = st.recursive(
    st.none() | st.booleans() | st.integers(max_value=100) | st.floats() | st.text(max_size=5) | st.complex_numbers(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=2),
    max_leaves=5,
)


@given(anything)
def test_no_object_whatever_gets_another_error(value):
    for name in ("layout", "noise", "trials", "starts", "seed", "chunk", "threads", "executor"):
        try:
            bearslam.sweep(**{**GOOD, "starts": "solve", "threads": 1, name: value})
        except InvalidInputError as error:
            assert str(error).startswith(name)


def test_signals_are_as_they_were():
    before = signal.getsignal(signal.SIGINT)
    bearslam.sweep(**GOOD)
    assert signal.getsignal(signal.SIGINT) is before
