# SPDX-License-Identifier: MIT OR Apache-2.0
"""A short run of the fuzzer of the loaders, and proof that it finds what it looks for."""

import importlib.util

import pytest

import bearslam

from .conftest import REPOSITORY

spec = importlib.util.spec_from_file_location("fuzz_loaders", REPOSITORY / "tests" / "fuzz_loaders.py")
fuzz = importlib.util.module_from_spec(spec)
spec.loader.exec_module(fuzz)


def test_damaged_files_are_read_whole_or_refused():
    outcomes, failures = fuzz.run(1, files=2000)
    assert failures == []
    assert outcomes.total() == 2000
    assert outcomes["read"] > 200
    assert outcomes["line named"] > 800


def test_a_folder_that_is_whole_is_read(tmp_path):
    assert fuzz.attempt_folder(tmp_path, fuzz.FOLDER) == "read"


@pytest.mark.parametrize("name", fuzz.SEEDS)
def test_files_that_are_whole_are_read(tmp_path, name):
    assert fuzz.attempt(tmp_path, name, fuzz.SEEDS[name]) == "read"


def test_a_loader_that_loses_lines_is_found(monkeypatch):
    def lossy(data, name, parse=bearslam.io.g2o.parse):
        return parse(data[: data.rindex(b"\n", 0, -1) + 1] if data.count(b"\n") > 3 else data, name)

    monkeypatch.setattr("bearslam.io.g2o.parse", lossy)
    _, failures = fuzz.run(1, files=2000, limit=100)
    assert any("sightings of" in failure for failure in failures)


def test_an_error_without_a_line_is_found(monkeypatch):
    def vague(data, name):
        raise bearslam.InvalidInputError(f"{name}: something is wrong")

    monkeypatch.setattr("bearslam.io.text_graph.parse", lambda data, name, noise: vague(data, name))
    _, failures = fuzz.run(1, files=100)
    assert any("no line in" in failure for failure in failures)
