# SPDX-License-Identifier: MIT OR Apache-2.0
"""Numbers have a range at the door, and angles are within one turn: what is beyond is refused by name."""

import io
import re

import numpy as np
import pytest

import bearslam
from bearslam import InvalidInputError, LandmarkPriors, Odometry, PosePriors, Sightings

SCENE = bearslam.simulate("enclosed", 4, 8, noise=0.01, seed=1)
SCENE_OF_ONE = (SCENE.landmarks, SCENE.bearings[0])

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


FAR = np.where(np.arange(8)[:, None] == 2, 2e60, SCENE.landmarks)
FAR_POSES = np.where(np.arange(4)[:, None] == 2, [[0.0, -2e60, 0.0]], SCENE.poses)
UNIT = bearslam.Similarity(1.0, 0.0, np.zeros(2))


@pytest.mark.parametrize(
    ("name", "call"),
    [
        (r"landmarks\[2, 0\]: .* 1e\+60, got 2e\+60", lambda: bearslam.resect(FAR, SCENE.bearings)),
        (r"poses\[2, 1\]: .* 1e\+60, got -2e\+60", lambda: bearslam.triangulate(FAR_POSES, SCENE.bearings)),
        (r"source\[2, 0\]: .*, got 2e\+60", lambda: bearslam.align(FAR, SCENE.landmarks)),
        (r"target\[2, 0\]: .*, got 2e\+60", lambda: bearslam.align(SCENE.landmarks, FAR)),
        (r"points\[2, 0\]: .*, got 2e\+60", lambda: UNIT.apply(FAR)),
        (r"poses\[2, 1\]: .*, got -2e\+60", lambda: UNIT.apply_poses(FAR_POSES)),
        ("width: .* 1e60, got 1e-61", lambda: bearslam.simulate("mixed", 4, 9, noise=0.1, seed=1, width=1e-61)),
        ("width: .*, got 1e\\+61", lambda: bearslam.simulate("mixed", 4, 9, noise=0.1, seed=1, width=1e61)),
        ("height: .*, got 1e\\+61", lambda: bearslam.simulate("mixed", 4, 9, noise=0.1, seed=1, height=1e61)),
        ("sigma: .* 1e30, got 1e61 at index 1", lambda: SCENE.odometry([0.1, 1e61, 0.1], seed=1)),
        ("sigma: .* 1e30, got 1e-31 at index 0", lambda: SCENE.odometry([1e-31, 0.1, 0.1], seed=1)),
        ("sigma: .* 1e30, got 1e-31", lambda: bearslam.resect(*SCENE_OF_ONE, sigma=1e-31, details=True)),
    ],
)
def test_other_verbs_have_the_range_too(name, call):
    with pytest.raises(InvalidInputError, match=f"^{name}"):
        call()


def test_given_points_may_be_near_zero():
    points = SCENE.landmarks.copy()
    points[1] = 1e-200
    bearslam.align(points, SCENE.landmarks)
    UNIT.apply(points)
    bearslam.resect(points, SCENE.bearings)


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
        (r"poses\[1, 2\]", lambda: bearslam.Scene(HEADED, SCENE.landmarks, SCENE.bearings)),
        ("bearings", lambda: bearslam.solve(bearslam.Scene(SCENE.poses, SCENE.landmarks, DEGREES).bearings)),
        ("bearing", lambda: bearslam.Scene(SCENE.poses, SCENE.landmarks, DEGREES).sightings),
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
        ("sigma: expected radians", lambda: Sightings([0, 0], [0, 1], [0.1, 0.2], 5)),
        (r"sigma\[1\]: expected radians", lambda: Sightings([0, 0], [0, 1], [0.1, 0.2], [1, 5])),
        ("sigma: expected radians", lambda: bearslam.solve(SCENE.bearings, sigma=5)),
        ("sigma: expected radians", lambda: bearslam.resect(*SCENE_OF_ONE, sigma=57, details=True)),
        ("sigma: expected radians", lambda: bearslam.triangulate(SCENE.poses, SCENE.bearings, sigma=5, details=True)),
        ("noise: expected radians", lambda: bearslam.simulate("mixed", 4, 9, noise=4, seed=1)),
        (r"noise\[1\]: expected radians", lambda: bearslam.sweep("mixed", [4], [9], noise=[0.1, 4], trials=1)),
    ],
)
def test_deviations_of_angles_in_degrees_are_refused(name, call):
    with pytest.raises(InvalidInputError, match=rf"^{name}.* half a turn.*, got \d+: degrees\?"):
        call()


def test_half_a_turn_and_nothing_known_are_allowed():
    PosePriors([0, 1], np.zeros((2, 3)), [[500, 1, np.pi], [1, 1, np.inf]])
    Odometry([0], [1], [[1, 0, 0]], np.diag([100, 100, 9.8])[None])
    bearslam.simulate("mixed", 4, 9, noise=np.pi, seed=1)
    Sightings([0, 0], [0, 1], [0.1, 0.2], [np.pi, 2])
    # A range may say less about the bearing than nothing.
    assert bearslam.Offsets([0], [[0.01, 0]], [0.1, 0.1]).bearing_sigma == np.pi


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
    "text",
    [
        b"VERTEX_SE2 0 0 0 0\nEDGE_BEARING_SE2_XY 0 9 0.5 0.04\n",
        b"view,landmark,bearing,sigma\na,b,0.5,5\n",
        b"view,landmark,bearing,sigma_deg\na,b,0.5,200\n",
    ],
)
def test_deviations_of_bearings_in_degrees_are_refused_by_line(text):
    with pytest.raises(InvalidInputError, match=r":2: expected .* within half a turn.*, got (5|200): degrees\?"):
        bearslam.load(io.BytesIO(text))


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
