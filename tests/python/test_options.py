# SPDX-License-Identifier: MIT OR Apache-2.0
"""The options of `solve`: their defaults are the core's, and a map records the settings it was found with."""

import dataclasses
import json

import pytest

import bearslam
from bearslam import InvalidInputError, RefineOptions, SearchOptions, _core, simulate, solve

SCENE = simulate("mixed", 4, 9, noise=0.01, seed=1)


def test_defaults_are_those_of_the_core() -> None:
    core = _core.defaults()
    assert dataclasses.asdict(SearchOptions()) == core["search"]
    assert dataclasses.asdict(RefineOptions()) == core["refinement"]


def test_a_map_remembers_how_it_was_found(tmp_path) -> None:
    search, refinement = SearchOptions(grown=9), RefineOptions(tolerance=1e-8)
    found = solve(SCENE.bearings, sigma=0.01, search=search, refinement=refinement, seed=3)
    assert (found.settings.search, found.settings.refinement, found.settings.seed) == (search, refinement, 3)
    found.save(tmp_path / "map.json")
    written = json.loads((tmp_path / "map.json").read_text())
    assert written["bearslam"] == bearslam.__version__
    assert written["settings"]["seed"] == 3
    assert written["settings"]["search"] == dataclasses.asdict(search)
    assert written["freedom"] == found.freedom == 4 * 9 + 4 - 3 * 4 - 2 * 9


def test_options_are_checked_where_they_are_made() -> None:
    with pytest.raises(InvalidInputError, match=r"swept: expected an integer from 0"):
        SearchOptions(swept=-1)
    with pytest.raises(InvalidInputError, match=r"search: expected SearchOptions"):
        solve(SCENE.bearings, search={"grown": 3})
