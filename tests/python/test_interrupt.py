# SPDX-License-Identifier: MIT OR Apache-2.0
"""Ctrl-C ends long calls within a second, and calls that use threads work in a child of `fork`."""

import multiprocessing
import os
import signal
import time
from contextlib import contextmanager

import numpy as np
import pytest

import bearslam

pytestmark = pytest.mark.skipif(os.name == "nt", reason="needs SIGALRM and fork")


@contextmanager
def interrupted(after):
    """Whatever is called inside must be ended by a signal within a second of it."""

    def end(number, frame):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, after)
    start = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            yield
        # A second, and two more for a busy machine.
        assert time.monotonic() - start < after + 3.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


TRIPLES = np.stack([bearslam.simulate("mixed", 3, 9, noise=0.01, seed=seed).bearings for seed in range(8)])


@pytest.mark.parametrize("verb", [bearslam.three_view, bearslam.trifocal_tensor])
@pytest.mark.parametrize("landmarks", [9, 8])
def test_a_signal_ends_many_reweights(verb, landmarks):
    with interrupted(0.3):
        verb(TRIPLES[0][:, :landmarks], reweights=10**12)


def test_a_signal_ends_a_long_batch():
    with interrupted(0.3):
        bearslam.three_view_batch(np.tile(TRIPLES, (200_000, 1, 1)), reweights=30)
    with interrupted(0.3):
        bearslam.three_view_batch(TRIPLES, reweights=10**12)


def test_a_signal_ends_a_long_covariance():
    scene = bearslam.simulate("mixed", 150, 8000, noise=0.002, seed=1)
    # One step: what follows is the covariance.
    seen = []

    def progress(stage, done, total):
        seen.append(stage)
        if stage == "covariance":
            signal.setitimer(signal.ITIMER_REAL, 0.05)
            seen.append(time.monotonic())

    start = signal.signal(signal.SIGALRM, lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
    try:
        with pytest.raises(KeyboardInterrupt):
            bearslam.refine(scene.bearings, scene, sigma=0.002, covariance=True, progress=progress)
        last = [entry for entry in seen if not isinstance(entry, str)][-1]
        assert time.monotonic() - last < 3.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, start)


def scene_of(views, landmarks):
    return bearslam.simulate("mixed", views, landmarks, noise=0.0005, seed=1).bearings


LONG = {
    "solve many views": (lambda: scene_of(10_000, 4), lambda seen: bearslam.solve(seen, sigma=0.0005)),
    "solve many landmarks": (lambda: scene_of(3, 100_000), lambda seen: bearslam.solve(seen, sigma=0.0005)),
    "diagnose": (lambda: scene_of(3, 200_000), lambda seen: bearslam.diagnose(seen, sigma=0.0005)),
    "triangulate": (
        lambda: np.random.default_rng(0).uniform(-3, 3, (10, 1_000_000)),
        lambda seen: bearslam.triangulate(np.random.default_rng(1).uniform(-3, 3, (10, 3)), seen, details=True),
    ),
    "resect": (
        lambda: np.random.default_rng(0).uniform(-3, 3, (1_000_000, 10)),
        lambda seen: bearslam.resect(np.random.default_rng(1).uniform(-3, 3, (10, 2)), seen, details=True),
    ),
    "simulate": (lambda: None, lambda _: bearslam.simulate("trajectory", 5000, 10_000, noise=0.01, seed=1)),
    "simulate one view": (lambda: None, lambda _: bearslam.simulate("mixed", 1, 2**26, noise=0.01, seed=1)),
}


@pytest.mark.parametrize("name", LONG)
def test_a_signal_ends_a_long_call(name):
    prepare, call = LONG[name]
    given = prepare()
    with interrupted(0.3):
        call(given)


def _batch():
    found = bearslam.three_view_batch(np.tile(TRIPLES, (100, 1, 1)))
    return np.nan_to_num(found.poses).tobytes()


def _sweep():
    result = bearslam.sweep("mixed", noise=[0.01], views=[4], landmarks=[7], trials=20, seed=1, progress=False)
    return b"".join(values.tobytes() for values in result.failures.values())


def _answer(work, pipe):
    pipe.send_bytes(work())


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
@pytest.mark.parametrize("work", [_batch, _sweep])
def test_threads_work_in_a_child_of_fork(work):
    expected = work()  # with threads that the child will not have
    fork = multiprocessing.get_context("fork")
    ours, theirs = fork.Pipe()
    child = fork.Process(target=_answer, args=(work, theirs))
    child.start()
    try:
        assert ours.poll(60), "the child hangs"
        assert ours.recv_bytes() == expected
        child.join(60)
        assert child.exitcode == 0
    finally:
        child.kill()
        child.join()


def test_a_batch_is_the_same_on_any_number_of_threads(monkeypatch):
    expected = _batch()
    for threads in ("1", "3"):
        monkeypatch.setenv("RAYON_NUM_THREADS", threads)
        assert _batch() == expected
