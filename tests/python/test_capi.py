# SPDX-License-Identifier: MIT OR Apache-2.0
"""The C interface: its example, compiled by the system's C compiler, has the numbers of the Python package."""

import shutil
import subprocess

import numpy as np
import pytest

from bearslam import RefineOptions, refine, resect, three_view, triangulate

VIEWS, LANDMARKS, HIDDEN = 4, 8, 7
SIGMA = 0.001
STRICT = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]


@pytest.fixture(scope="module")
def program(repository, tmp_path_factory):
    """The example, linked with the static library."""
    missing = [tool for tool in ("make", "cargo", "cc") if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"the C example cannot be built without {' and '.join(missing)}")
    subprocess.run(["make", "--silent", "capi"], cwd=repository, check=True)
    program = tmp_path_factory.mktemp("capi") / "three_views"
    source = repository / "examples" / "three_views.c"
    library = repository / "target" / "capi" / "release" / "libbearslam_c.a"
    command = ["cc", *STRICT, f"-I{repository / 'include'}", source, library, "-lm", "-o", program]
    subprocess.run(command, check=True)
    return program


@pytest.fixture(scope="module")
def printed(program):
    """What the example prints: the lines of each name."""
    ran = subprocess.run([program], check=True, capture_output=True, text=True)
    lines: dict[str, list[np.ndarray]] = {}
    for line in ran.stdout.splitlines():
        name, *numbers = line.split()
        lines.setdefault(name, []).append(np.array(numbers, dtype=float))
    return lines


def agree(found, expected):
    np.testing.assert_allclose(found.reshape(np.shape(expected)), expected, rtol=1e-12, atol=1e-12)


def test_numbers_are_those_of_python(printed):
    bearings = printed["bearings"][0].reshape(VIEWS, LANDMARKS)
    assert np.flatnonzero(np.isnan(bearings)).tolist() == [HIDDEN]

    solutions = three_view(bearings[:3, :HIDDEN])
    assert len(solutions) == len(printed["poses"]) == 2
    for k, solution in enumerate(solutions):
        agree(printed["poses"][k], solution.poses)
        landmarks = printed["landmarks"][k].reshape(LANDMARKS, 2)
        agree(landmarks[:HIDDEN], solution.landmarks)
        assert np.isnan(landmarks[HIDDEN]).all()
        assert printed["inconsistent"][k] == solution.inconsistent

    best = solutions[0]
    resected = resect(best.landmarks, bearings[3, :HIDDEN])
    agree(printed["resected"][0], resected)
    poses = np.vstack([best.poses, resected])
    triangulated = triangulate(poses, bearings[:, HIDDEN:])
    agree(printed["triangulated"][0], triangulated)

    start = poses, np.vstack([best.landmarks, triangulated])
    refined = refine(bearings, start, sigma=SIGMA, refinement=RefineOptions(tolerance=0.0))
    agree(printed["refined_poses"][0], refined.poses)
    agree(printed["refined_landmarks"][0], refined.landmarks)
    agree(printed["cost"][0], [refined.cost])


def test_refinement_moves_the_map(printed):
    start, refined = printed["poses"][0].reshape(3, 3), printed["refined_poses"][0].reshape(VIEWS, 3)
    assert np.abs(np.sin(refined[:3, 2] - start[:, 2])).max() > 1e-6


def test_no_panic_is_linked(program):
    if shutil.which("nm") is None:
        pytest.skip("the symbols of the C example cannot be listed without nm")
    symbols = subprocess.run(["nm", program], check=True, capture_output=True, text=True).stdout
    assert "bearslam_refine" in symbols
    assert "panic" not in symbols


def test_cpp_takes_the_header(repository, tmp_path):
    compiler = shutil.which("c++")
    if compiler is None:
        pytest.skip("the header cannot be tried without a C++ compiler")
    source = tmp_path / "header.cpp"
    source.write_text('#include "bearslam.h"\nint main() { return bearslam_refine_size(17, 1) == 0 ? 0 : 1; }\n')
    subprocess.run([compiler, "-fsyntax-only", "-Wall", f"-I{repository / 'include'}", source], check=True)
