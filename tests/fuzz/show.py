# SPDX-License-Identifier: MIT OR Apache-2.0
"""Inputs as Python code that repeats the call on its own."""

from __future__ import annotations

from typing import Any

import numpy as np

from .calls import MAKERS, OF_PROBLEM
from .inputs import Input


def code(given: Input) -> str:
    """A script that makes the call of an input."""
    arguments = dict(given.arguments)
    lines = ["import numpy as np", "import bearslam", "", "nan, inf = np.nan, np.inf"]
    if given.verb not in ("solve", "refine", "initialize", "diagnose", "files"):
        listed = ", ".join(f"{name}={value(one)}" for name, one in arguments.items())
        return "\n".join([*lines, f"print(bearslam.{given.verb}({listed}))"])
    form = arguments.pop("form")
    lines.append(f"bearings = {value(arguments.pop('bearings'))}")
    for name in list(arguments):
        one = arguments[name]
        if name in MAKERS and isinstance(one, dict):
            listed = ", ".join(f"{key}={value(part)}" for key, part in one.items())
            lines.append(f"{name} = bearslam.{MAKERS[name].__name__}({listed})")
        else:
            lines.append(f"{name} = {value(one)}")
    if given.verb == "diagnose" and "start" in arguments:
        arguments["reconstruction"] = arguments.pop("start")
        lines.append("reconstruction = start")
    keywords = [name for name in arguments if form != "problem" or name not in OF_PROBLEM]
    listed = "".join(f", {name}={name}" for name in keywords)
    lines.append(f"# handed over as: {form}")
    lines.append(f"print(bearslam.{given.verb}(bearings{listed}))")
    return "\n".join(lines)


def value(one: Any) -> str:
    """An argument as code, with all digits."""
    if isinstance(one, np.ndarray):
        return f"np.array({one.tolist()!r})"
    if isinstance(one, dict):
        return "dict(" + ", ".join(f"{key}={value(part)}" for key, part in one.items()) + ")"
    if isinstance(one, tuple):
        return "(" + ", ".join(map(value, one)) + ",)"
    if isinstance(one, np.generic):
        return repr(one.item())
    return repr(one)
