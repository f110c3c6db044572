# SPDX-License-Identifier: MIT OR Apache-2.0
"""The Python package is built in layers: no circle of modules."""

import ast
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__, "../../../python/bearslam").resolve()

CYCLES = {
    "cli.report",
    "data.align",
    "data.checks",
    "data.maps",
    "data.priors",
    "data.problem",
    "data.request",
    "errors",
    "io.compression",
    "io.files",
    "io.g2o",
    "io.graph_builder",
    "io.gtsam",
    "io.map_file",
    "io.mrclam",
    "io.sensor_pose",
    "io.sightings_csv",
    "io.text",
    "io.text_graph",
    "io.tum",
    "montecarlo.csv_file",
    "montecarlo.files",
    "montecarlo.grid",
    "montecarlo.npz_file",
    "montecarlo.plot",
    "montecarlo.result",
    "montecarlo.statistics",
    "montecarlo.table",
    "montecarlo.tally",
    "plotting.ellipses",
    "plotting.geometry",
    "plotting.map",
    "plotting.odometry_chains",
    "plotting.rays",
    "plotting.trajectories",
    "plotting.viewer",
    "reconstruction",
    "verbs.diagnose",
    "verbs.simulate",
}
"""Modules that are part of a circle. This list may only shrink."""


def module_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def imported(path: Path) -> Iterator[str]:
    """Modules of the package that a file imports: on top, under TYPE_CHECKING, or inside a function."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names = [f"{node.module}.{name.name}" for name in node.names]
        elif isinstance(node, ast.Import):
            names = [name.name for name in node.names]
        else:
            continue
        for name in names:
            root, _, rest = name.partition(".")
            if root != "bearslam":
                continue
            if rest.startswith("_core"):  # the compiled core imports nothing
                continue
            # `from bearslam.errors import BearslamError` is about the module, not about what it holds.
            yield rest if rest in MODULES else rest.rpartition(".")[0]


IMPORTS = {module: set(imported(path)) - {module} for module, path in MODULES.items()}


def in_a_circle(imports: dict[str, set[str]]) -> set[str]:
    """All modules that import themselves by way of others."""
    found = set()
    for module in imports:
        reached: set[str] = set()
        waiting = set(imports[module])
        while waiting:
            one = waiting.pop()
            reached.add(one)
            waiting |= imports[one] - reached
        if module in reached:
            found.add(module)
    return found


def test_no_circle():
    assert in_a_circle(IMPORTS) == CYCLES


def test_a_circle_is_seen():
    assert in_a_circle({"below": set(), "one": {"two", "below"}, "two": {"one"}}) == {"one", "two"}
