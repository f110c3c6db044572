# SPDX-License-Identifier: MIT OR Apache-2.0
"""Numbers have a range at the door, and angles are within one turn: what is beyond is refused by name."""

import io
import re

import numpy as np
import pytest

import bearslam
from bearslam import InvalidInputError, LandmarkPriors, Odometry, PosePriors, Sightings

SCENE = bearslam.simulate("enclosed", 4, 8, noise=0.01, seed=1)

DATA = [
    ("odometry: delta", {"odometry": lambda x: Odometry([0, 1], [1, 2], [[1, 0, 0], [0, x, 0]], [0.1, 0.1, 0.1])}),
    ("pose priors: pose", {"pose_priors": lambda x: PosePriors([0, 1], [[0, 0, 0], [x, 0, 0]], [0.1, 0.1, 0.1])}),
    ("landmark priors: position", {"landmark_priors": lambda x: LandmarkPriors([0, 1], [[0, 0], [x, 0]], 0.1)}),
]
SIGMAS = [
    ("odometry: sigma", {"odometry": lambda s: Odometry([0, 1], [1, 2], np.eye(2, 3), [[0.1] * 3, [0.1, s, 0.1]])}),
    (
        "pose priors: sigma",
        {"pose_priors": lambda s: PosePriors([0, 1], np.eye(2, 3), [np.eye(3), np.diag([1.0, s * s, 1.0])])},
    ),
    ("landmark priors: sigma", {"landmark_priors": lambda s: LandmarkPriors([0, 1], np.eye(2), [[0.1] * 2, [0.1, s]])}),
]


@pytest.mark.parametrize(("name", "given"), DATA + SIGMAS)
@pytest.mark.parametrize("verb", [bearslam.solve, bearslam.diagnose])
def test_numbers_beyond_the_range_are_refused_by_name(name, given, verb):
    ((argument, make),) = given.items()
    exponent = 30 if "sigma" in name else 60
    for outside in (f"5e-{exponent + 1}", f"2e{exponent}"):
        with pytest.raises(InvalidInputError) as caught:
            verb(SCENE.bearings, sigma=0.01, **{argument: make(float(outside))})
        pattern = (
            rf"{name}: expected magnitudes from 1e-{exponent} to 1e{exponent}, got \S+ at index 1; choose other units"
        )
        assert re.fullmatch(pattern, str(caught.value))


def test_bearings_and_their_sigmas_have_the_range():
    for bearing, sigma, message in (
        (1e-70, 0.1, "bearing: expected magnitudes from 1e-60 to 1e60, got 1e-70 at index 1"),
        (0.1, 1e-31, "sigma: expected magnitudes from 1e-30 to 1e30, got 1e-31 at index 1"),
        (0.1, 1e31, "sigma: expected magnitudes from 1e-30 to 1e30, got 1e31 at index 1"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            bearslam.solve(Sightings([0, 0], [0, 1], [0.1, bearing], [0.1, sigma]))
    with pytest.raises(InvalidInputError, match="bearing: expected magnitudes"):
        bearslam.solve(bearslam.load(io.BytesIO(b"view,landmark,bearing\na,b,1e-70\n")))


def test_given_maps_are_in_the_range_but_may_be_near_zero():
    poses = SCENE.poses.copy()
    poses[2, 1] = 2e60
    for call in (bearslam.refine, bearslam.diagnose):
        with pytest.raises(InvalidInputError, match=r"poses: expected magnitudes from .* to 1e60, got 2e60 at index 2"):
            call(SCENE.bearings, (poses, SCENE.landmarks))
    poses[2, 1] = 1e-200
    bearslam.diagnose(SCENE.bearings, (poses, SCENE.landmarks))


DEGREES = np.degrees(SCENE.bearings)
HEADED = SCENE.poses * [1, 1, 0] + [0, 0, 1] * np.array([[0.0], [120.0], [0.0], [80.0]])


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("bearings", lambda: bearslam.solve(DEGREES)),
        ("bearings", lambda: bearslam.initialize(DEGREES)),
        ("bearings", lambda: bearslam.refine(DEGREES, SCENE)),
        ("bearings", lambda: bearslam.diagnose(DEGREES)),
        ("bearing", lambda: Sightings([0, 0], [0, 1], [0.5, 45.0])),
        ("bearings", lambda: bearslam.three_view(DEGREES[:3])),
        ("bearings", lambda: bearslam.three_view_batch(DEGREES[None, :3])),
        ("bearings", lambda: bearslam.trifocal_tensor(DEGREES[:3])),
        ("bearings", lambda: bearslam.triangulate(SCENE.poses, DEGREES)),
        ("bearings", lambda: bearslam.resect(SCENE.landmarks, DEGREES)),
        (r"delta\[1, 2\]", lambda: Odometry([0, 1], [1, 2], [[1, 0, 0.1], [1, 0, -90]], [0.1, 0.1, 0.1])),
        (r"pose\[0, 2\]", lambda: PosePriors([0], [[1, 0, 90]], [np.inf, np.inf, 0.02])),
        (r"poses\[1, 2\]", lambda: bearslam.triangulate(HEADED, SCENE.bearings)),
        (r"start: poses\[1, 2\]", lambda: bearslam.refine(SCENE.bearings, (HEADED, SCENE.landmarks))),
        (r"reconstruction: poses\[1, 2\]", lambda: bearslam.diagnose(SCENE.bearings, (HEADED, SCENE.landmarks))),
        (
            r"start: poses\[1, 2\]",
            lambda: bearslam.Problem(SCENE.sightings, "abcd", "efghijklm", start=(HEADED, SCENE.landmarks)),
        ),
        (r"poses\[1, 2\]", lambda: bearslam.Similarity(1.0, 0.0, np.zeros(2)).apply_poses(HEADED)),
    ],
)
def test_degrees_are_refused(name, call):
    with pytest.raises(InvalidInputError, match=rf"^{name}.*: expected radians within one turn, got -?\d.*: degrees\?"):
        call()


def test_a_whole_turn_is_allowed():
    turned = np.where(SCENE.bearings < 0, SCENE.bearings + 2 * np.pi, SCENE.bearings)
    assert bearslam.refine(turned, SCENE).cost == pytest.approx(bearslam.refine(SCENE.bearings, SCENE).cost)
    Odometry([0], [1], [[1, 0, -2 * np.pi]], [0.1, 0.1, 0.1])
    poses = SCENE.poses + np.where(SCENE.poses[:, 2:] < 0, [0, 0, 2 * np.pi], 0)
    np.testing.assert_allclose(
        bearslam.triangulate(poses, SCENE.bearings), bearslam.triangulate(SCENE.poses, SCENE.bearings)
    )


@pytest.mark.parametrize(
    ("name", "call"),
    [
        (r"sigma\[2\]: expected radians", lambda: Odometry([0], [1], [[1, 0, 0]], [0.1, 0.1, 5])),
        (r"sigma\[1, 2\]: expected radians", lambda: PosePriors([0, 1], np.zeros((2, 3)), [[1, 1, np.inf], [1, 1, 5]])),
        (
            r"sigma\[0, 2, 2\]: expected at most the variance",
            lambda: PosePriors([0], [[0, 0, 0]], np.diag([1, 1, 25.0])[None]),
        ),
        (r"sigma\[2\]: expected radians", lambda: SCENE.odometry([0.1, 0.1, 5], seed=1)),
    ],
)
def test_deviations_of_headings_in_degrees_are_refused(name, call):
    with pytest.raises(InvalidInputError, match=rf"^{name}.* half a turn.*, got \d+: degrees\?"):
        call()


def test_half_a_turn_and_nothing_known_are_allowed():
    PosePriors([0, 1], np.zeros((2, 3)), [[500, 1, np.pi], [1, 1, np.inf]])
    Odometry([0], [1], [[1, 0, 0]], np.diag([100, 100, 9.8])[None])


@pytest.mark.parametrize(
    "line",
    [
        "EDGE_SE2 0 1 1 0 90 1 0 0 1 0 1",
        "EDGE_PRIOR_SE2 0 1 0 90 1 0 0 1 0 1",
        "EDGE_BEARING_SE2_XY 0 9 90 100",
    ],
)
def test_degrees_in_a_graph_are_refused_by_line(line):
    text = f"VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 0 0 0\n{line}\n".encode()
    with pytest.raises(
        InvalidInputError, match=r":3: expected a (heading|bearing) in radians within one turn, got 90: d"
    ):
        bearslam.load(io.BytesIO(text), format="g2o")


def test_a_vertex_of_a_graph_may_have_turned_often():
    text = b"VERTEX_SE2 0 1 2 20\nFIX 0\nVERTEX_XY 1 3 3\nEDGE_BEARING_SE2_XY 0 1 0.5 100\n"
    problem = bearslam.load(io.BytesIO(text), format="g2o")
    np.testing.assert_allclose(problem.known_poses().pose, [[1, 2, 20 - 6 * np.pi]])


@pytest.mark.parametrize("line", ["EDGE_SE2 0 1 1 0 0 1 0 0 1 0 0.04", "EDGE_PRIOR_SE2 0 1 0 0 1 0.1 0 1 0 0.04"])
def test_deviations_in_degrees_in_a_graph_are_refused_by_line(line):
    text = f"VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 0 0 0\n{line}\n".encode()
    with pytest.raises(InvalidInputError, match=r":3: expected a heading with a standard deviation .*, got 5: degrees"):
        bearslam.load(io.BytesIO(text), format="g2o")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("map.csv", "kind,id,x,y,theta\nview,0,1,2,90\n"),
        ("map.json", '{"views": [{"id": 0, "x": 1, "y": 2, "theta": 90}], "landmarks": []}'),
    ],
)
def test_degrees_in_a_map_are_refused(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InvalidInputError, match=r"expected a heading in radians within one turn, got 90: degrees\?"):
        bearslam.load_truth(path, SCENE.bearings)
