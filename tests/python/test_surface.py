# SPDX-License-Identifier: MIT OR Apache-2.0
"""What a user sees of the package: the public names, and nothing else."""

import importlib
import importlib.metadata
import importlib.util
import inspect
import pkgutil
import pydoc
import re

import pytest

import bearslam
from bearslam.cli.main import main

SUBPACKAGES = {"cli", "data", "io", "montecarlo", "plotting", "verbs"}


def test_dir_shows_what_a_user_calls():
    assert dir(bearslam) == sorted(bearslam.__all__)
    assert not [name for name in dir(bearslam) if inspect.ismodule(getattr(bearslam, name))]


def test_the_root_holds_subpackages_and_little_else():
    found = {name for _, name, _ in pkgutil.iter_modules(bearslam.__path__)}
    assert found == SUBPACKAGES | {"__main__", "_core", "errors", "progress", "reconstruction"}


def test_no_module_has_the_name_of_a_function():
    for name in bearslam.__all__:
        assert importlib.util.find_spec(f"bearslam.{name}") is None, name
        with pytest.raises(ImportError):
            importlib.import_module(f"bearslam.{name}")
    for part in SUBPACKAGES:
        package = importlib.import_module(f"bearslam.{part}")
        for _, name, _ in pkgutil.iter_modules(package.__path__):
            assert inspect.ismodule(getattr(package, name, package)), f"{part}.{name}"


def test_the_command_is_an_entry_point():
    (entry,) = importlib.metadata.entry_points(group="console_scripts", name="bearslam")
    assert entry.load() is main


def test_help_lists_no_internals():
    text = pydoc.plain(pydoc.render_doc(bearslam))
    contents = re.search(r"PACKAGE CONTENTS\n((?: .*\n)+)", text)
    assert {line.split()[0] for line in contents[1].splitlines()} <= SUBPACKAGES | {
        "__main__",
        "_core",
        "errors",
        "progress",
        "reconstruction",
    }
    assert "SUBMODULES" not in text
    functions = re.search(r"^FUNCTIONS\n(.*?)^[A-Z]", text, re.MULTILINE | re.DOTALL)
    assert set(re.findall(r"^    (\w+)\(", functions[1], re.MULTILINE)) == {
        name for name in bearslam.__all__ if inspect.isroutine(getattr(bearslam, name))
    }
