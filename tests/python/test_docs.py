# SPDX-License-Identifier: MIT OR Apache-2.0
"""Every example that is printed runs: in docstrings, in README.md and in docs/."""

import doctest
import importlib
import importlib.util
import pkgutil
import re
import shlex
from pathlib import Path

import pytest

import bearslam
from bearslam.cli.main import main

FLAGS = doctest.ELLIPSIS | doctest.FAIL_FAST
REPOSITORY = Path(__file__).parents[2]
PAGES = [REPOSITORY / "README.md", *sorted(REPOSITORY.glob("docs/**/*.md"))]
FENCE = re.compile(r"^```(\w+)[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
MODULES = [
    importlib.import_module(found.name)
    for found in pkgutil.walk_packages(bearslam.__path__, "bearslam.")
    if found.name not in ("bearslam.__main__", "bearslam._core")
    and (found.name != "bearslam.plotting.viewer" or importlib.util.find_spec("rerun") is not None)
]


@pytest.mark.parametrize("module", [bearslam, *MODULES], ids=lambda module: module.__name__)
def test_docstrings(module):
    outcome = doctest.testmod(module, optionflags=FLAGS)
    assert outcome.failed == 0


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages(page, tmp_path, monkeypatch, capsys):
    """Blocks of a page are one session, in a folder of its own: python runs, console calls the command line."""
    monkeypatch.chdir(tmp_path)
    text = page.read_text()
    names = {"__name__": "page"}
    for match in FENCE.finditer(text):
        language, code = match.groups()
        above = text.count("\n", 0, match.start(2))
        if language == "python" and ">>>" in code:
            test = doctest.DocTestParser().get_doctest(code, names, page.name, str(page), above)
            runner = doctest.DocTestRunner(optionflags=FLAGS)
            runner.run(test, clear_globs=False)
            names.update(test.globs)
            assert runner.summarize().failed == 0, capsys.readouterr().out
        elif language == "python":
            exec(compile("\n" * above + code, str(page), "exec"), names)
        elif language == "console":
            for line in code.splitlines():
                if line.startswith("$ bearslam "):
                    assert main(shlex.split(line)[2:]) == 0, line


@pytest.mark.parametrize("name", [name for name in bearslam.__all__ if not name.startswith("_")])
def test_everything_public_is_described(name):
    thing = getattr(bearslam, name)
    assert thing.__doc__
    if callable(thing) and not isinstance(thing, type):
        for section in ("Parameters", "Returns" if name != "save" else "Raises", "Raises", "Examples"):
            assert f"\n    {section}\n    ---" in thing.__doc__, section
