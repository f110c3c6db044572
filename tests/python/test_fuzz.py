# SPDX-License-Identifier: MIT OR Apache-2.0
"""A short run of the fuzzer of the many-view API, and proof that it finds what it looks for."""

import dataclasses
import signal
import time

import numpy as np
import pytest
from tests.fuzz import calls, inputs, kept, maps, measure, minimum, runner, shrink, worker
from tests.fuzz.ledger import Ledger, merged

import bearslam

SECONDS, SEEDS = 30.0, 2000
OPEN: dict[int, str] = {}
"""Seeds below these with a fault that is known and not yet mended."""


def test_thirty_seconds_of_inputs_without_a_failure(tmp_path):
    ledger = Ledger(tmp_path / "fuzz.jsonl")
    failures = runner.run(ledger, SECONDS, seeds=(0, SEEDS), tell=lambda line: None)
    found = [
        f"{one.seed} {one.verb}: {one.faults}"
        for one in failures
        if {kind for kind, _ in one.faults} - {OPEN.get(one.seed)}
    ]
    assert found == []
    assert ledger.ranges()[0][0] == 0
    assert ledger.failures().keys() == {one.seed for one in failures}


KEPT = sorted(kept.FOLDER.glob("*.json"))
"""Inputs that have failed, each named by what was wrong with the answer."""


@pytest.mark.parametrize("path", KEPT, ids=[path.stem for path in KEPT])
def test_what_has_failed_does_not_fail_again(path):
    kind = path.stem.split("-")[0]
    assert kind not in {found for found, _ in worker.run(kept.read(path)).faults}


def test_kept_inputs_come_back_bit_for_bit(tmp_path):
    for seed in range(200):
        given = inputs.make(seed)
        if any(change.endswith("type") for change in given.wild):
            continue
        kept.write(given, tmp_path / "one.json")
        read = kept.read(tmp_path / "one.json")
        assert (read.seed, read.verb, read.wild) == (given.seed, given.verb, given.wild)
        assert calls.digest(read.arguments) == calls.digest(given.arguments)


def test_a_seed_is_one_input():
    for seed in range(20):
        assert calls.digest(inputs.make(seed).arguments) == calls.digest(inputs.make(seed).arguments)


def seed_of(verb, *names, without=(), complete=False):
    """The first seed of a plausible input of a verb with all of these arguments, and an answer."""
    for seed in range(5000):
        given = inputs.make(seed)
        if given.verb == verb and not given.wild and set(names) <= set(given.arguments):
            if set(without) & set(given.arguments):
                continue
            outcome = worker.run(given)
            if outcome.ending == "answered" and not (complete and calls.call(given, 1).undetermined):
                return given
    raise AssertionError(f"no seed calls {verb} with {names}")


@pytest.fixture(scope="module")
def solved():
    given = seed_of("solve", "odometry", "pose_priors", without=("robust", "loss", "start"), complete=True)
    request = measure.Request.of(given.arguments, joint=True)
    return request, calls.call(given, 1)


@pytest.mark.parametrize(
    ("field", "change", "kind"),
    [
        ("cost", lambda cost: cost * 1.0001 + 1e-6, "cost"),
        ("rms", lambda rms: rms * 1.01 + 1e-6, "rms"),
        ("freedom", lambda freedom: freedom + 1, "freedom"),
        ("residuals", lambda residuals: residuals + 1e-6, "residuals"),
        ("inliers", lambda inliers: ~inliers, "inliers"),
        ("landmarks", lambda landmarks: np.full_like(landmarks, np.nan), "undetermined"),
        ("converged", lambda converged: not converged, "termination"),
    ],
)
def test_a_wrong_number_is_found(solved, field, change, kind):
    request, result = solved
    assert list(maps.check(request, result, refined=True)) == []
    wrong = dataclasses.replace(result, **{field: change(getattr(result, field))})
    assert kind in {found for found, _ in maps.check(request, wrong, refined=True)}


def test_a_wrong_prior_is_found(solved):
    request, result = solved
    kind, place, value, root = request.priors[0]
    moved = dataclasses.replace(request, priors=[(kind, place, value + 1.0, root), *request.priors[1:]])
    assert "cost" in {found for found, _ in maps.check(moved, result, refined=True)}


def test_a_map_that_is_no_minimum_is_found(solved):
    request, result = solved
    assert minimum.decrease(request, result, maps.LEAST) < maps.LEAST
    given = seed_of("refine", "start", without=("loss", "oriented"))
    given.arguments["refinement"] = {"max_iterations": 1}
    request, result = measure.Request.of(given.arguments, joint=True), calls.call(given, 1)
    assert "minimum" not in {kind for kind, _ in maps.check(request, result, refined=True)}
    early = dataclasses.replace(result, converged=True, termination="converged")
    assert "minimum" in {kind for kind, _ in maps.check(request, early, refined=True)}
    assert minimum.decrease(request, result, 1.0) <= minimum.gain(request, result, 0.0) + 1.0


def test_a_half_turn_costs_one_of_two():
    root = np.linalg.inv(np.linalg.cholesky([[1.0, 0.2, 0.3], [0.2, 1.0, 0.1], [0.3, 0.1, 0.5]]))
    costs = []
    for half in (np.pi, -np.pi + 1e-15, np.pi - 1e-3):
        prior = ("pose", (0,), np.array([1.0, 2.0, -half]), root)
        table = {"bearings": np.array([[0.1]])}
        request = dataclasses.replace(measure.Request.of(table, joint=True), priors=[prior])
        costs.append(measure.cost_of_priors(request, np.zeros((1, 3)), np.zeros((1, 2))))
    (left, loose), (right, _), (_, tight) = costs
    assert abs(left - right) > 0.1
    assert np.isclose(loose, abs(left - right), rtol=1e-9)
    assert tight < 1e-9


def test_other_exceptions_are_faults(monkeypatch):
    given = seed_of("align")
    monkeypatch.setattr(bearslam, "align", lambda **_: 1 / 0)
    assert worker.run(given).faults[0][0] == "exception"


def test_answers_that_change_are_found(monkeypatch):
    given, count = seed_of("simulate"), iter(range(100))
    monkeypatch.setattr(bearslam, "simulate", lambda **_: next(count))
    given.seed = worker.REPEATED
    assert worker.run(given).faults == [("bits", "a second call gives other bits")]


class Dead(runner.Worker):
    """A worker whose process ends by itself."""

    def __init__(self, script):
        super().__init__(1)
        self.script = script

    def command(self):
        return ["python", "-c", self.script]


@pytest.mark.parametrize(
    ("ending", "kind"), [("os.abort()", "abort"), ("os.kill(os.getpid(), signal.SIGPROF)", "hang")]
)
def test_processes_that_die_are_noticed(ending, kind):
    dead = Dead(f"import os, signal; signal.signal(signal.SIGPROF, signal.SIG_DFL); input(); {ending}")
    outcome = dead.run(7)
    assert (outcome.seed, outcome.ending, outcome.faults[0][0]) == (7, "failed", kind)
    assert dead.process is None


def test_a_call_that_does_not_end_is_ended(monkeypatch):
    ended = []
    monkeypatch.setattr(worker, "SECONDS", 0.2)
    monkeypatch.setattr(bearslam, "align", lambda **_: [time.process_time() for _ in range(10**8)])
    before = signal.signal(signal.SIGPROF, lambda *_: ended.append(1) or 1 / 0)
    try:
        outcome = worker.run(seed_of_align())
    finally:
        signal.signal(signal.SIGPROF, before)
    assert ended
    assert outcome.faults[0][0] == "exception"


def seed_of_align():
    return next(given for given in map(inputs.make, range(1000)) if given.verb == "align" and not given.wild)


def test_a_ledger_resumes_and_forgets_what_is_mended(tmp_path):
    path = tmp_path / "fuzz.jsonl"
    ledger = Ledger(path)
    numbers = {"calls": {"solve answered": 10}, "seconds": 1.0, "slowest": 0.1, "higher": [], "commit": "abc"}
    ledger.add(first=0, end=10, **numbers)
    ledger.add(first=20, end=30, **numbers)
    ledger.add(seed=3, verb="solve", faults=[["cost", "is wrong"]], commit="abc")
    with path.open("a") as file:
        file.write('{"first": 3')
    ledger = Ledger(path)
    assert ledger.ranges() == [(0, 10), (20, 30)]
    assert ledger.next_free(0, 200) == (10, 20)
    assert ledger.next_free(25, 200) == (30, 230)
    assert "1 cost" in ledger.summary()
    assert "20 inputs" in ledger.summary()
    ledger.add(seed=3, verb="solve", faults=[], commit="def")
    assert Ledger(path).failures() == {}


def test_ranges_that_touch_are_one():
    assert merged([(5, 9), (0, 5), (20, 30), (25, 27)]) == [(0, 9), (20, 30)]


def test_a_smaller_input_fails_in_the_same_way():
    given = seed_of("solve", "odometry", without=("robust",))
    smaller = shrink.shrink(given, lambda one: "cost" if "odometry" in one.arguments else None)
    assert set(smaller.arguments) <= {"bearings", "form", "odometry"}
    assert len(smaller.arguments["odometry"]["start"]) == 1
