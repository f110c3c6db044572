# SPDX-License-Identifier: MIT OR Apache-2.0
"""The Python package is built in layers: every module imports only those below it, so that there is no cycle."""

import ast
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__, "../../../python/bearslam").resolve()

ORDER = """
    errors progress

    data.checks data.align data.fix data.maps data.priors
    data.sightings data.problem data.normalize data.options data.request
    data.finding data.certificate data.estimate data.doubts

    io.atomic io.bounded io.compression io.endings io.text io.view_names io.information
    io.number_table io.dead_reckoning io.edge_noise
    io.sensor_pose io.graph_builder io.sightings_csv io.g2o io.text_graph io.mrclam io.tum io.gtsam
    io.map_file io.truth io.files

    plotting.style plotting.geometry plotting.odometry_chains plotting.legend
    plotting.ellipses plotting.rays plotting.trajectories plotting.map plotting.viewer

    reconstruction

    verbs.three_view verbs.resect verbs.triangulate verbs.simulate verbs.diagnose verbs.solve
    verbs.relabel

    montecarlo.grid montecarlo.tally montecarlo.statistics montecarlo.result
    montecarlo.table montecarlo.plot montecarlo.files montecarlo.sweep_result
    montecarlo.executors montecarlo.ledger montecarlo.checkpoint

    verbs.sweep

    cli.console cli.report cli.warnings cli.input
    cli.solve cli.simulate cli.diagnose cli.convert cli.sweep cli.demo
    cli.main
""".split()  # noqa: SIM905 - a list would take a line for each
"""From the bottom up: a module may import only those listed before it."""
OPTIONAL = {"dask", "gtsam", "matplotlib", "pandas", "rerun", "tqdm", "xarray"}
"""Optional packages: modules that import them may only be imported inside functions."""
ROOT = {"", "__main__"}
"""They re-export what stands below and are imported by none of it."""


def module_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def names_imported(path: Path, *, top: bool) -> Iterator[str]:
    """Dotted names of all that a file imports, or with `top` only of what it imports at module level."""
    waiting: list[ast.AST] = [ast.parse(path.read_bytes())]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield from (f"{node.module}.{name.name}" for name in node.names)
        elif isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif not (top and (isinstance(node, ast.FunctionDef) or is_for_types(node))):
            waiting += ast.iter_child_nodes(node)


def is_for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def inside(path: Path, *, top: bool) -> Iterator[str]:
    """Modules of the package that a file imports; the compiled core imports nothing and is left out."""
    for name in names_imported(path, top=top):
        root, _, rest = name.partition(".")
        if root == "bearslam" and not rest.startswith("_core"):
            # `from bearslam.errors import BearslamError` counts as the module, not as the name in it.
            yield rest if rest in MODULES else rest.rpartition(".")[0]


def outside(path: Path, *, top: bool) -> Iterator[str]:
    """Other packages that a file imports."""
    return (name.partition(".")[0] for name in names_imported(path, top=top))


IMPORTS = {module: set(inside(path, top=False)) - {module} for module, path in MODULES.items()}
IMPORTS_ON_TOP = {module: set(inside(path, top=True)) - {module} for module, path in MODULES.items()}


def in_a_circle(imports: dict[str, set[str]]) -> set[str]:
    """All modules that import themselves through others."""
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


def test_every_module_has_its_place():
    packages = {module for module, path in MODULES.items() if path.name == "__init__.py"}
    assert sorted(ORDER) == sorted(MODULES.keys() - packages - ROOT)
    assert len(set(ORDER)) == len(ORDER)


def test_modules_import_only_what_stands_below():
    place = {module: index for index, module in enumerate(ORDER)}
    wrong = [
        f"{module} imports {other}"
        for module in ORDER
        for other in sorted(IMPORTS[module])
        if place.get(other, len(ORDER)) >= place[module]
    ]
    assert not wrong


def test_subpackages_re_export_nothing():
    """Except for the package itself and the command."""
    assert not {module for module, path in MODULES.items() if path.name == "__init__.py" and IMPORTS[module]} - ROOT


def test_no_circle():
    assert not in_a_circle(IMPORTS)


def test_a_circle_is_seen():
    assert in_a_circle({"below": set(), "one": {"two", "below"}, "two": {"one"}}) == {"one", "two"}


def test_late_imports_are_for_optional_packages():
    needs_them = {module for module in MODULES if any(one in OPTIONAL for one in outside(MODULES[module], top=True))}
    for module in ORDER:  # from the bottom up, so that indirect needs are known
        if IMPORTS_ON_TOP[module] & needs_them:
            needs_them.add(module)
    assert not [
        f"{module} imports {other}"
        for module in MODULES
        for other in sorted(IMPORTS[module] - IMPORTS_ON_TOP[module])
        if other not in needs_them
    ]
