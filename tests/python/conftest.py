# SPDX-License-Identifier: MIT OR Apache-2.0
"""What all tests share: reference values, pictures without a screen, fast and slow Hypothesis."""

import importlib.util
import json
import os
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import HealthCheck, settings

mpl.use("Agg")

# HYPOTHESIS_PROFILE=slow tries more; both are deterministic, so that a failure on one machine occurs on all.
settings.register_profile("fast", max_examples=50, deadline=None, derandomize=True)
settings.register_profile(
    "slow", max_examples=2000, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fast"))

REPOSITORY = Path(__file__).parents[2]
SHARED = Path(os.environ.get("BEARSLAM_SHARED", REPOSITORY / ".." / "shared"))
REFERENCES = {
    "own": REPOSITORY / "tests" / "data" / "reference.json",
    "shared": SHARED / "vectors" / "reference.json",
}


@pytest.fixture(scope="session")
def repository():
    """The root folder of the checkout."""
    return REPOSITORY


@pytest.fixture(scope="session", params=REFERENCES)
def reference(request):
    """Reference values: the project's own, and an independent set where there is one."""
    path = REFERENCES[request.param]
    if request.param == "shared" and not path.exists():
        pytest.skip(f"no reference values in {path}; BEARSLAM_SHARED names the folder above vectors/")
    return json.loads(path.read_text())


@pytest.fixture(scope="session")
def mrclam():
    """Reads scenes of real robots, UTIAS MRCLAM 7, by the name of their file: a list of dictionaries."""
    folder = SHARED / "data" / "mrclam7" / "derived"
    if not folder.exists():
        pytest.skip(f"no scenes in {folder}; BEARSLAM_SHARED names the folder above data/")

    def read(name):
        scenes = {}
        with np.load(folder / f"MRCLAM_Dataset7_{name}.npz") as file:
            for key in file.files:
                scene, _, quantity = key.partition("_")
                if scene[1:].isdigit():
                    scenes.setdefault(scene, {})[quantity] = file[key]
        return list(scenes.values())

    return read


@pytest.fixture(scope="session")
def own():
    """The project's own reference values, made by tests/data/make_reference.py."""
    return json.loads(REFERENCES["own"].read_text())


@pytest.fixture(scope="session")
def chart():
    """The error of a motion in GTSAM with bearslam's definition; see test_gtsam.py."""
    pytest.importorskip("gtsam", reason="GTSAM is not installed: pip install gtsam")
    path = REPOSITORY / "benches" / "real" / "beside_gtsam.py"
    spec = importlib.util.spec_from_file_location("beside_gtsam", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.chart


@pytest.fixture(scope="session")
def cases() -> Path:
    """Folder of small inputs that went wrong, with right answers."""
    folder = SHARED / "cases"
    if not folder.exists():
        pytest.skip(f"no cases in {folder}; BEARSLAM_SHARED names the folder above cases/")
    return folder
