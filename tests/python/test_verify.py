# SPDX-License-Identifier: MIT OR Apache-2.0
"""Verified maps: `solve(..., verify=True)` and its certificate."""

import json
import math

import numpy as np
import pytest

from bearslam import Certificate, InvalidInputError, PosePriors, save, simulate, solve
from bearslam.cli.main import main

NOISE = math.radians(0.5)
SCENE = simulate("mixed", 8, 10, noise=NOISE, seed=1)


def test_a_verified_map_has_a_certificate() -> None:
    plain = solve(SCENE.bearings, sigma=NOISE)
    found = solve(SCENE.bearings, sigma=NOISE, verify=True)
    certificate = found.certificate
    assert plain.certificate is None
    assert isinstance(certificate, Certificate)
    assert certificate.verified
    assert certificate.views is not None
    assert list(certificate.views) == sorted(set(certificate.views))
    assert 0 < certificate.cone < 0.5
    assert certificate.cells >= 1
    assert str(certificate).startswith("verified: no lower cost in ")
    assert np.array_equal(found.poses, plain.poses)
    assert found.settings.verify


def test_the_cone_is_that_of_the_singular_values() -> None:
    """The bound computed with numpy: never wider than 2 R / s2, and the map itself is inside."""
    found = solve(SCENE.bearings, sigma=NOISE, verify=True)
    assert found.certificate is not None
    assert found.certificate.views is not None
    views = list(found.certificate.views)
    a, b, c = SCENE.bearings[views]
    phases = (a + b - c, a - b + c, -a + b + c)
    rows = np.stack([f(phase) for phase in phases for f in (np.cos, np.sin)], axis=1) / NOISE
    values, vectors = np.linalg.svd(rows)[1:]
    first, second = values[-1], values[-2]
    widest = math.sqrt((8 * found.cost - first**2) / (second**2 - first**2))
    assert math.sin(found.certificate.cone) <= widest
    x, y, heading = found.poses[views].T
    z, turn = x + 1j * y, np.exp(1j * heading)
    sides = np.conj([z[0] - z[1], z[2] - z[0], z[1] - z[2]])
    tensor = sides * [
        turn[0] * turn[1] / turn[2],
        turn[0] / turn[1] * turn[2],
        turn[1] * turn[2] / turn[0],
    ]
    unit = np.column_stack([tensor.real, -tensor.imag]).ravel()
    unit /= np.linalg.norm(unit)
    assert np.linalg.norm(vectors[:5] @ unit) <= math.sin(found.certificate.cone)


def test_what_cannot_be_verified_says_why() -> None:
    four = simulate("mixed", 6, 4, noise=0.002, seed=1)
    certificate = solve(four.bearings, sigma=0.002, verify=True).certificate
    assert certificate is not None
    assert not certificate.verified
    assert math.isnan(certificate.cone)
    assert certificate.message == "not verified: no three views share five landmarks"


@pytest.mark.parametrize(("options", "rival"), [({"robust": True}, "robust=True"), ({"loss": "huber"}, "loss='huber'")])
def test_other_losses_are_refused(options, rival) -> None:
    with pytest.raises(InvalidInputError, match=f"verify: expected False with {rival}"):
        solve(SCENE.bearings, sigma=NOISE, verify=True, **options)
    with pytest.raises(InvalidInputError, match="verify: expected True or False"):
        solve(SCENE.bearings, sigma=NOISE, verify=2)


def test_priors_are_part_of_the_cost() -> None:
    priors = PosePriors(view=[0, 3], pose=SCENE.poses[[0, 3]], sigma=(0.1, 0.1, 0.05))
    found = solve(SCENE.bearings, sigma=NOISE, pose_priors=priors, verify=True)
    assert found.certificate is not None
    assert found.certificate.verified


def test_files_and_the_command_tell_of_it(tmp_path, capsys) -> None:
    save(SCENE.bearings, tmp_path / "bearings.csv")
    arguments = ["solve", str(tmp_path / "bearings.csv"), "--sigma-deg", "0.5", "-o", str(tmp_path / "map.json")]
    assert main([*arguments, "--verify"]) == 0
    assert "\nverified: no lower cost in " in capsys.readouterr().out
    written = json.loads((tmp_path / "map.json").read_text())
    assert written["settings"]["verify"] is True
    certificate = written["certificate"]
    assert certificate["verified"] is True
    assert set(certificate["views"]) <= {view["id"] for view in written["views"]}
    assert main(arguments) == 0
    assert "verified" not in capsys.readouterr().out
    assert json.loads((tmp_path / "map.json").read_text())["certificate"] is None
    assert main([*arguments, "--verify", "--robust"]) == 1
    assert "verify: expected False with robust=True" in capsys.readouterr().err


def test_a_verification_can_be_stopped() -> None:
    noise = math.radians(2.0)
    scene = simulate("mixed", 12, 15, noise=noise, seed=1)

    def stop(stage: str, done: int, total: int) -> None:
        if stage == "verify":
            assert done < total
            raise KeyboardInterrupt

    # Thousands of cells take seconds.
    with pytest.raises(KeyboardInterrupt):
        solve(scene.bearings, sigma=noise, verify=True, progress=stop)
