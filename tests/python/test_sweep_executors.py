# SPDX-License-Identifier: MIT OR Apache-2.0
"""Sweeps run by executors: processes, threads, clusters, and all the ways in which they fail."""

import os
import signal
import subprocess
import sys
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import bearslam
from bearslam import ExecutorError, InvalidInputError
from bearslam.montecarlo.executors import RETRIES

ARGUMENTS = {
    "layout": "mixed",
    "views": [4, 6],
    "landmarks": [7, 9],
    "noise": np.radians([0.1, 0.5]),
    "trials": 20,
    "chunk": 2,
    "starts": ("projective", "solve"),
    "seed": 5,
}
CHUNKS = 80


@pytest.fixture(scope="module")
def expected():
    return bearslam.sweep(**ARGUMENTS)


class Here(Executor):
    """Runs tasks at once, in this thread."""

    def __init__(self):
        self.seen = []

    def submit(self, function, /, *arguments, **options):
        self.seen.append(arguments[0])
        future = Future()
        try:
            future.set_result(self.run(function, *arguments))
        except (OSError, InvalidInputError) as error:
            future.set_exception(error)
        return future

    def run(self, function, *arguments):
        return function(*arguments)


class Flaky(Here):
    """Fails the first times that it sees a chunk."""

    def __init__(self, times, error=None):
        super().__init__()
        self.times, self.error = times, error or OSError("lost")

    def run(self, function, chunk, *arguments):
        if self.seen.count(chunk) <= self.times:
            raise self.error
        return function(chunk, *arguments)


@pytest.mark.parametrize("start", ["spawn", "fork"])
def test_processes_find_the_same(expected, start):
    if start not in __import__("multiprocessing").get_all_start_methods():
        pytest.skip("not on this system")
    with ProcessPoolExecutor(2, get_context(start)) as pool:
        assert bearslam.sweep(**ARGUMENTS, executor=pool).identical(expected)


def test_threads_find_the_same(expected):
    with ThreadPoolExecutor(2) as pool:
        assert bearslam.sweep(**ARGUMENTS, executor=pool).identical(expected)


def test_loky_finds_the_same(expected):
    loky = pytest.importorskip("loky")
    pool = loky.ProcessPoolExecutor(2)
    try:
        assert bearslam.sweep(**ARGUMENTS, executor=pool).identical(expected)
    finally:
        pool.shutdown()


def test_a_killed_process_ends_the_pool_but_not_the_result(expected):
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        victims = [pool.submit(os.getpid).result()]

        def progress(stage, done, total):
            if done >= 60 and victims:
                os.kill(victims.pop(), signal.SIGKILL)

        with pytest.raises(ExecutorError, match="executor: the executor is broken: BrokenProcessPool") as caught:
            bearslam.sweep(**ARGUMENTS, executor=pool, progress=progress)
        part = caught.value.result
        assert not part.complete
        assert 60 <= part.done.sum() < 160
        assert part.failures["solve"].sum() == 0
        with pytest.raises(ExecutorError, match="takes no more chunks: BrokenProcessPool") as caught:
            bearslam.sweep(**ARGUMENTS, executor=pool)
        assert caught.value.result.done.sum() == 0


def test_a_pool_that_is_shut_down_meanwhile(monkeypatch):
    monkeypatch.setattr("bearslam.montecarlo.executors.WINDOW", 4)
    with ThreadPoolExecutor(2) as pool:
        with pytest.raises(ExecutorError, match="takes no more chunks: RuntimeError: cannot schedule") as caught:
            bearslam.sweep(**ARGUMENTS, executor=pool, progress=lambda *_: pool.shutdown(wait=False))
        assert 0 < caught.value.result.done.sum() < 160


def test_chunks_that_somebody_else_cancels_are_run_again(expected):
    class Cancelling(Here):
        def submit(self, function, /, *arguments, **options):
            if arguments[0] in self.seen:
                return super().submit(function, *arguments)
            self.seen.append(arguments[0])
            future = Future()
            future.cancel()
            future.set_running_or_notify_cancel()
            return future

    assert bearslam.sweep(**ARGUMENTS, executor=Cancelling()).identical(expected)


@pytest.mark.parametrize("times", [1, RETRIES])
def test_a_chunk_that_fails_is_run_again(expected, times):
    executor = Flaky(times)
    assert bearslam.sweep(**ARGUMENTS, executor=executor).identical(expected)
    assert len(executor.seen) == (times + 1) * CHUNKS


def test_a_chunk_that_fails_again_and_again_ends_the_sweep():
    class OneBad(Flaky):
        def run(self, function, chunk, *arguments):
            return super().run(function, chunk, *arguments) if chunk[4] == 10 else function(chunk, *arguments)

    message = r"executor: the executor failed 4 times at the same chunk, \('mixed', .*, 10, 12\): OSError: lost"
    with pytest.raises(ExecutorError, match=message) as caught:
        bearslam.sweep(**ARGUMENTS, executor=OneBad(RETRIES + 1))
    assert isinstance(caught.value.__cause__, OSError)
    # All finished chunks are in the result, including those not collected yet.
    assert caught.value.result.done.sum() == 160 - 2 * 8


def test_wrong_input_is_not_tried_again():
    executor = Flaky(1, InvalidInputError("noise: expected less"))
    with pytest.raises(InvalidInputError, match="noise: expected less"):
        bearslam.sweep(**ARGUMENTS, executor=executor)
    assert len(set(executor.seen)) == len(executor.seen)


def test_an_interrupted_task_is_an_interruption():
    class Interrupting(Here):
        def submit(self, function, /, *arguments, **options):
            future = super().submit(function, *arguments)
            if len(self.seen) == 10:
                future = Future()
                future.set_exception(KeyboardInterrupt())
            return future

    part = bearslam.sweep(**ARGUMENTS, executor=Interrupting())
    assert not part.complete
    assert part.done.sum() == 158


def test_few_tasks_wait_at_a_time(monkeypatch, expected):
    monkeypatch.setattr("bearslam.montecarlo.executors.WINDOW", 5)
    waiting = []

    class Counting(ThreadPoolExecutor):
        def submit(self, *arguments, **options):
            future = super().submit(*arguments, **options)
            waiting.append(future)
            assert sum(not one.done() for one in waiting) <= 5
            return future

    with Counting(2) as pool:
        assert bearslam.sweep(**ARGUMENTS, executor=pool).identical(expected)
    assert len(waiting) == CHUNKS


def test_threads_are_not_for_executors():
    with pytest.raises(InvalidInputError, match="threads: expected 0 with an executor, .* got 2"):
        bearslam.sweep(**ARGUMENTS, executor=Here(), threads=2)


CLUSTER = """\
import os, signal, sys
import numpy as np
import bearslam
from distributed import Client, LocalCluster

def kill(stage, done, total):
    if done > 40 and victims:
        os.kill(victims.pop(), signal.SIGKILL)

if __name__ == "__main__":
    arguments = dict(
        layout="mixed", views=[4, 6], landmarks=[7, 9], noise=np.radians([0.1, 0.5]), trials=20, chunk=2,
        starts=("projective", "solve"), seed=5,
    )
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster,
        Client(cluster) as client,
    ):
        victims = [next(iter(client.run(os.getpid).values()))]
        result = bearslam.sweep(**arguments, executor=client.get_executor(), progress=kill)
    result.save(sys.argv[1])
    sys.exit(len(victims))
"""


def test_a_dask_cluster_that_loses_a_worker_finds_the_same(expected, tmp_path):
    pytest.importorskip("distributed")
    # In a process of its own, so that what a cluster leaves behind does not affect other tests.
    script, out = tmp_path / "script.py", tmp_path / "result.npz"
    script.write_text(CLUSTER)
    subprocess.run([sys.executable, script, out], check=True, timeout=100, capture_output=True, cwd=tmp_path)
    assert bearslam.SweepResult.load(out).identical(expected)
