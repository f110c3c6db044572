# SPDX-License-Identifier: MIT OR Apache-2.0
"""Text graphs of TORO and GTSAM, and sensors that sit somewhere on the vehicle."""

import io
import math
import os
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bearslam
from bearslam import InvalidInputError, LandmarkPriors, Odometry, Offsets, PosePriors, Problem, Sightings
from bearslam.io.sensor_pose import in_sensor_frame
from bearslam.io.text_graph import parse

from .conftest import REPOSITORY
from .test_g2o import assert_same

PARK = Path(os.environ.get("BEARSLAM_SHARED", REPOSITORY / ".." / "shared"), "data/victoria_park/victoria_park.txt.gz")

GTSAM = """\
# as in Victoria Park
ODOMETRY 0 1 1.0 0.5 0.25 0.01 0 0 0.04 0 0.0025
LANDMARK 1 0 3 4 0.01 0 0.04
LANDMARK 0 0 4 3 0.01 0.001 0.04
BR 1 5 0.5 10 0.02 0.3
VERTEX2 0 0 0 0
EDGE3 0 1 2
"""


def test_every_tag_is_understood():
    problem = parse(GTSAM.encode(), "park.txt")
    assert (problem.view_ids, problem.landmark_ids) == (("0", "1"), ("0", "5"))
    assert problem.odometry.delta.tolist() == [[1.0, 0.5, 0.25]]
    assert problem.odometry.sigma.tolist() == [[0.1, 0.2, 0.05]]
    seen = problem.sightings
    assert (seen.view.tolist(), seen.landmark.tolist()) == ([1, 0, 1], [0, 0, 1])
    np.testing.assert_allclose(seen.bearing, [math.atan2(4, 3), math.atan2(3, 4), 0.5], rtol=1e-15)
    np.testing.assert_allclose(seen.sigma[[0, 2]], [math.hypot(0.08, 0.12) / 5, 0.02], rtol=1e-14)
    offsets = problem.offsets
    assert offsets.position[:2].tolist() == [[3.0, 4.0], [4.0, 3.0]]
    assert offsets.sigma[1].tolist() == [[0.01, 0.001], [0.001, 0.04]]
    along = np.array([math.cos(0.5), math.sin(0.5)])
    np.testing.assert_allclose(offsets.position[2], 10 * along, rtol=1e-15)
    assert along @ offsets.sigma[2] @ along == pytest.approx(0.09, rel=1e-14)
    np.testing.assert_array_equal(problem.start.poses, [[0, 0, 0], [np.nan] * 3])
    assert problem.remarks == ("1 line EDGE3 not read",)
    assert problem.others == ()


NUMBERS = {
    "toro": "100 10 25 4 5 1",
    "g2o": "100 10 5 25 1 4",
    "graph": "100 10 25 4 5 1",
    "cov": "100 10 5 25 1 4",
}


@pytest.mark.parametrize("noise", NUMBERS)
def test_both_conventions_in_both_orders(noise):
    text = f"EDGE2 0 1 1 0 0 {NUMBERS[noise]}\nBR 0 0 0.5 10 0.02 0.3\n"
    matrix = np.array([[100, 10, 5], [10, 25, 1], [5, 1, 4.0]])
    expected = matrix if noise in ("graph", "cov") else np.linalg.inv(matrix)
    np.testing.assert_allclose(parse(text.encode(), "x", noise).odometry.sigma[0], expected, rtol=1e-14)
    with pytest.raises(InvalidInputError, match="^x:1: the numbers .* are ambiguous; state their meaning by noise: "):
        parse(text.encode(), "x")


@pytest.mark.parametrize(("numbers", "noise"), [("1 0 4 9 0 0", "graph"), ("1 0 0 4 0 9", "cov")])
def test_zeros_tell_the_order_as_in_gtsam(tmp_path, numbers, noise):
    gtsam = pytest.importorskip("gtsam")
    path = tmp_path / "small.graph"
    path.write_text(f"EDGE2 0 1 1 2 0.5 {numbers}\nBR 0 0 0.5 10 0.02 0.3\n")
    problem = bearslam.load(path)
    assert problem.odometry.sigma.tolist() == [[1.0, 2.0, 3.0]]
    assert_same(problem, bearslam.load(path, noise=noise))
    graph, _ = gtsam.load2D(str(path))
    assert graph.size() == 2
    assert graph.at(0).noiseModel().sigmas().tolist() == [1.0, 2.0, 3.0]
    measured = graph.at(1).measured()
    assert measured.bearing().theta() == pytest.approx(problem.sightings.bearing[0], rel=1e-15)
    assert measured.range() == pytest.approx(np.hypot(*problem.offsets.position[0]), rel=1e-15)


@pytest.mark.parametrize("noise", ["toro", "graph", "cov", "g2o"])
def test_gtsam_reads_the_same(tmp_path, noise):
    gtsam = pytest.importorskip("gtsam")
    path = tmp_path / "small.graph"
    path.write_text(f"VERTEX2 0 1 2 0.5\nEDGE2 0 1 1 2 0.5 {NUMBERS[noise]}\nBR 0 0 0.5 10 0.02 0.3\n")
    problem = bearslam.load(path, noise=noise)
    graph, values = gtsam.load2D(str(path), noiseFormat=getattr(gtsam.NoiseFormat, f"NoiseFormat{noise.upper()}"))
    root = graph.at(0).noiseModel().R()
    np.testing.assert_allclose(np.linalg.inv(root.T @ root), problem.odometry.sigma[0], rtol=1e-12)
    assert [values.atPose2(0).x(), values.atPose2(0).y()] == problem.start.poses[0, :2].tolist()


SEEN = "BR 0 1 0.5 10 0.02 0.3\n"
BAD = [
    ("", "bad.graph: no LANDMARK or BR: bearslam needs bearings"),
    ("EDGE2 0 1 1 0 0 1 0 4 9 0 0\n", "bad.graph: no LANDMARK or BR: bearslam needs bearings"),
    ("EDGE2 0 1 1 0 0 1 0 4 9 0\n", "bad.graph:1: expected 11 numbers after EDGE2, got 10"),
    ("LANDMARK 0 1 1 0 0 1\n", "bad.graph:1: expected 7 numbers after LANDMARK, got 6"),
    (SEEN.rstrip() + SEEN, "bad.graph:1: expected 6 numbers after BR, got 12"),
    (SEEN + "ODOMETRY 0 1 1 0 nan 1 0 4 9 0 0\n", "bad.graph:2: expected a finite number, got 'nan'"),
    (SEEN + "ODOMETRY 0 x 1 0 0 1 0 4 9 0 0\n", "bad.graph:2: expected the number of a vertex from 0, got 'x'"),
    (SEEN + "EDGE_SE2_XY 0 2 3 4 1 0 1\n", "bad.graph:2: expected tags of a text graph, got EDGE_SE2_XY of g2o; read"),
    ("BR 0 1 0.5 5e-324 0.02 0.3\n", "bad.graph:1: expected a landmark at a distance from 1e-100 to 1e+100, got 4.94"),
    (SEEN + "odometry 0 1\n", "bad.graph:2: expected a tag such as ODOMETRY, got 'odometry'"),
    (SEEN + "EDGE2 0 0 1 0 0 1 0 4 9 0 0\n", "bad.graph:2: expected an edge between two poses, got 0 twice"),
    (SEEN + "EDGE2 0 1 1 0 0 0 0 0 0 0 0\n", "bad.graph:2: the numbers 0 0 0 0 0 0 are ambiguous; state their meaning"),
    (SEEN + "EDGE2 0 1 1 0 0 -1 0 4 9 0 0\n", "bad.graph:2: expected variances above 0, got -1"),
    (SEEN + "EDGE2 0 1 1 0 0 1 0 4 9 0 0\nEDGE2 1 2 1 0 0 1 0 0 4 0 9\n", "bad.graph:3: the zeros look like those of"),
    ("LANDMARK 0 1 1 0 0 0 1\n", "bad.graph:1: expected variances above 0, got 0"),
    ("LANDMARK 0 1 1 0 1 1 1\n", "bad.graph:1: expected a positive definite matrix, got one that is nearly singular"),
    ("LANDMARK 0 1 0 0 1 0 1\n", "bad.graph:1: expected a landmark away from the pose, got one that coincides with it"),
    ("BR 0 1 0.5 0 0.02 0.3\n", "bad.graph:1: expected a range above 0, got 0"),
    ("BR 0 1 0.5 10 0 0.3\n", "bad.graph:1: expected a standard deviation above 0, got 0"),
    (
        "BR 0 1 0.5 1e200 1e200 1\n",
        "bad.graph:1: expected a range and standard deviations that doubles can hold, got 1e+200",
    ),
    (SEEN + SEEN, "bad.graph:2: pose '0' sees landmark '1' a second time; the first is on line 1"),
    (
        SEEN + "VERTEX2 0 0 0 0\nVERTEX2 0 1 0 0\n",
        "bad.graph:3: vertex 0 appears a second time; the first is on line 2",
    ),
]


@pytest.mark.parametrize(("text", "message"), BAD)
def test_a_bad_line_is_named(text, message):
    with pytest.raises(InvalidInputError) as caught:
        parse(text.encode(), "bad.graph")
    assert str(caught.value).startswith(message)


@given(st.text() | st.text(alphabet="VERTEX2 ODMYLANKBR#\n01.-e"))
def test_any_text_is_read_or_refused(text):
    try:
        assert len(parse((SEEN + text).encode("utf-8", "replace"), "any.graph").sightings)
    except InvalidInputError as error:
        assert str(error).startswith("any.graph:")


coordinate = st.floats(-10, 10)


@given(
    st.lists(
        st.tuples(st.floats(-6.0, 6.0), st.floats(0.1, 1e3), st.floats(1e-3, 1.0), st.floats(1e-3, 10.0)), min_size=1
    )
)
def test_bearings_with_ranges_come_back_from_g2o(rows):
    text = "".join(f"BR 0 {j} {' '.join(map(repr, row))}\n" for j, row in enumerate(rows))
    problem = parse(text.encode(), "some.graph")
    from bearslam.io import g2o

    assert_same(g2o.parse(g2o.render(problem).encode(), "some.g2o"), problem)


@pytest.mark.skipif(not PARK.exists(), reason=f"no data in {PARK}; BEARSLAM_SHARED names the folder above data/")
class TestVictoriaPark:
    def test_all_of_it_is_read(self):
        start = time.process_time()
        problem = bearslam.load(PARK)
        assert time.process_time() - start < 1.0
        assert (len(problem.view_ids), len(problem.landmark_ids)) == (6969, 151)
        assert (len(problem.odometry), len(problem.sightings), len(problem.offsets)) == (6968, 3640, 3640)
        assert problem.odometry.sigma[0].tolist() == [0.01, 0.002, 0.002]
        assert problem.remarks == ()

    def test_the_laser_has_seen_other_bearings(self):
        axle, laser = bearslam.load(PARK), bearslam.load(PARK, sensor=(3.78, 0.5))
        x, y = axle.offsets.position.T
        np.testing.assert_array_equal(laser.sightings.bearing, np.arctan2(y - 0.5, x - 3.78))
        assert np.degrees(np.abs(laser.sightings.bearing - axle.sightings.bearing)).max() > 5
        ahead = laser.odometry.delta[100] - axle.odometry.delta[100]
        turn = axle.odometry.delta[100, 2]
        lever = np.array([3.78, 0.5])
        rotation = [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
        np.testing.assert_allclose(ahead[:2], rotation @ lever - lever, atol=1e-12)

    @pytest.mark.parametrize("sensor", [None, (3.78, 0.5)])
    def test_it_comes_back_from_g2o(self, tmp_path, sensor):
        problem = bearslam.load(PARK, sensor=sensor)
        bearslam.save(problem, tmp_path / "park.g2o")
        start = time.process_time()
        again = bearslam.load(tmp_path / "park.g2o")
        assert time.process_time() - start < 1.0
        assert_same(again, problem)

    def test_gtsam_reads_the_same(self, tmp_path):
        gtsam = pytest.importorskip("gtsam")
        import gzip

        path = tmp_path / "park.txt"
        path.write_bytes(gzip.decompress(PARK.read_bytes()))
        graph, _ = gtsam.load2D(str(path))
        problem = bearslam.load(path)
        motions = [k for k in range(graph.size()) if isinstance(graph.at(k), gtsam.BetweenFactorPose2)]
        assert len(motions) == len(problem.odometry)
        assert graph.size() == len(problem.odometry) + len(problem.sightings)
        for row, k in enumerate(motions[::50]):
            factor, one = graph.at(k), 50 * row
            assert list(factor.keys()) == [int(problem.view_ids[problem.odometry.start[one]])] + [factor.keys()[1]]
            assert factor.measured().x() == problem.odometry.delta[one, 0]
            np.testing.assert_allclose(factor.noiseModel().sigmas(), problem.odometry.sigma[one], rtol=1e-14)


@pytest.fixture
def vehicle():
    """A problem in the frame of a vehicle, whose sensor has seen everything without error."""
    rng = np.random.default_rng(1)
    poses = np.column_stack([rng.uniform(-5, 5, (6, 2)), rng.uniform(-3, 3, 6)])
    landmarks = rng.uniform(-9, 9, (7, 2))
    view, landmark = (part.ravel() for part in np.mgrid[:6, :7])

    def local(pose, points):
        turned = points - pose[:2]
        cosine, sine = math.cos(pose[2]), math.sin(pose[2])
        return np.stack(
            [cosine * turned[..., 0] + sine * turned[..., 1], cosine * turned[..., 1] - sine * turned[..., 0]]
        )

    position = np.stack([local(poses[i], landmarks[j]) for i, j in zip(view, landmark, strict=True)])
    offsets = Offsets(range(42), position, [0.1, 0.2])
    delta = np.array([[*local(poses[i], poses[i + 1, :2]), poses[i + 1, 2] - poses[i, 2]] for i in range(5)])
    return Problem(
        Sightings(view, landmark, offsets.bearing, offsets.bearing_sigma),
        map(str, range(6)),
        map(str, range(10, 17)),
        odometry=Odometry(range(5), range(1, 6), delta, [0.1, 0.02, 0.03]),
        pose_priors=PosePriors([0, 2], poses[[0, 2]], [0.1, 0.2, 0.05]),
        landmark_priors=LandmarkPriors([1], landmarks[[1]], 0.1),
        start=(poses, landmarks),
        fixed_views=[1],
        offsets=offsets,
    )


SENSOR = (1.5, -0.5, 0.4)


def test_a_sensor_sees_what_it_should(vehicle):
    moved = in_sensor_frame(vehicle, SENSOR)
    poses, landmarks = vehicle.start
    cosine, sine = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    places = poses[:, :2] + np.column_stack([cosine * 1.5 + sine * 0.5, sine * 1.5 - cosine * 0.5])
    np.testing.assert_allclose(moved.start.poses, np.column_stack([places, poses[:, 2] + 0.4]), atol=1e-14)
    seen = moved.sightings
    ahead = landmarks[seen.landmark] - places[seen.view]
    error = seen.bearing - (np.arctan2(ahead[:, 1], ahead[:, 0]) - poses[seen.view, 2] - 0.4)
    np.testing.assert_allclose(np.sin(error / 2), 0, atol=1e-13)
    # Everything still fits: the cost at the start is zero.
    result = bearslam.refine(moved)
    assert result.cost < 1e-20
    assert result.odometry is not None


def test_covariances_are_those_of_the_sensor(vehicle):
    """Random motions and poses of the vehicle, converted to the sensor, scatter as the covariances predict."""
    moved = in_sensor_frame(vehicle, SENSOR)
    rng = np.random.default_rng(2)
    noise = rng.normal(size=(200_000, 3)) * 1e-3

    def compose(one, other):
        cosine, sine = np.cos(one[..., 2]), np.sin(one[..., 2])
        x, y = other[..., 0], other[..., 1]
        return np.stack(
            [one[..., 0] + cosine * x - sine * y, one[..., 1] + sine * x + cosine * y, one[..., 2] + other[..., 2]],
            axis=-1,
        )

    sensor = np.array(SENSOR)
    back = np.array([*(-np.array([[np.cos(0.4), np.sin(0.4)], [-np.sin(0.4), np.cos(0.4)]]) @ sensor[:2]), -0.4])
    # The error as a small motion in the frame of the measured end.
    motion = compose(compose(compose(back, vehicle.odometry.delta[1]), noise * vehicle.odometry.sigma[1]), sensor)
    mean = moved.odometry.delta[1]
    np.testing.assert_allclose(motion.mean(axis=0), mean, atol=1e-5)
    cosine, sine = math.cos(mean[2]), math.sin(mean[2])
    axes = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    scatter = np.cov(((motion - mean) @ axes).T) * 1e6
    np.testing.assert_allclose(scatter, moved.odometry.sigma[1], rtol=0.02, atol=2e-4)
    place = compose(vehicle.pose_priors.pose[1] + noise * vehicle.pose_priors.sigma[1], sensor)
    np.testing.assert_allclose(np.cov(place.T) * 1e6, moved.pose_priors.sigma[1], rtol=0.02, atol=2e-4)
    np.testing.assert_allclose(place.mean(axis=0), moved.pose_priors.pose[1], atol=1e-5)


def test_there_and_back_again(vehicle):
    cosine, sine = math.cos(0.4), math.sin(0.4)
    x, y, turn = SENSOR
    back = (-cosine * x - sine * y, sine * x - cosine * y, -turn)
    again = in_sensor_frame(in_sensor_frame(vehicle, SENSOR), back)
    np.testing.assert_allclose(again.sightings.bearing, vehicle.sightings.bearing, atol=1e-13)
    np.testing.assert_allclose(again.sightings.sigma, vehicle.sightings.sigma, rtol=1e-12)
    np.testing.assert_allclose(again.odometry.delta, vehicle.odometry.delta, atol=1e-13)
    np.testing.assert_allclose(again.odometry.sigma, [np.diag([0.1, 0.02, 0.03]) ** 2] * 5, atol=1e-15)
    np.testing.assert_allclose(again.pose_priors.sigma, [np.diag([0.1, 0.2, 0.05]) ** 2] * 2, atol=1e-15)
    np.testing.assert_allclose(again.start.poses, vehicle.start.poses, atol=1e-13)


def test_bearings_alone_can_be_turned_but_not_moved():
    problem = Problem(Sightings([0, 0], [0, 1], [0.5, -0.5], 0.1), ["a"], ["b", "c"])
    assert in_sensor_frame(problem, (0, 0, 0.25)).sightings.bearing.tolist() == [0.25, -0.75]
    with pytest.raises(InvalidInputError, match="^sensor: expected ranges with all 2 bearings, got 0: without one"):
        in_sensor_frame(problem, (1, 0))


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        ((1,), "sensor: expected x, y and, if it is rotated, theta, got 1 numbers"),
        ((1, 2, 3, 4), "sensor: expected x, y and, if it is rotated, theta, got 4 numbers"),
        ((1, np.nan), r"sensor\[1\]: expected a finite number, got nan"),
        ("ab", "sensor: expected real numbers, got an array of dtype"),
        ((3, 4), "sensor: a landmark coincides with the sensor"),
    ],
)
def test_sensors_that_are_none(sensor, message):
    problem = parse(b"LANDMARK 0 0 3 4 1 0 1\n", "one.graph")
    with pytest.raises(InvalidInputError, match=f"^{message}"):
        in_sensor_frame(problem, sensor)


def test_half_known_poses_do_not_move():
    problem = parse(b"LANDMARK 0 0 3 4 1 0 1\n", "one.graph")

    def known(sigma):
        return Problem(
            problem.sightings, "0", "1", offsets=problem.offsets, pose_priors=PosePriors([0], [[1, 2, 0.5]], sigma)
        )

    compass = in_sensor_frame(known([math.inf, math.inf, 0.02]), (1, 0)).pose_priors
    assert compass.sigma.tolist() == [[math.inf, math.inf, 0.02]]
    assert compass.pose[0, 2] == 0.5
    for sigma in ([0.1, 0.1, math.inf], [math.inf, 0.1, 0.1]):
        with pytest.raises(InvalidInputError, match="^sensor: expected priors on all coordinates of poses"):
            in_sensor_frame(known(sigma), (1, 0))
        assert in_sensor_frame(known(sigma), (0, 0, 0.5)).pose_priors.sigma.tolist() == [sigma]


def test_views_come_in_the_order_of_the_file():
    text = b"ODOMETRY 5 3 1 0 0 0.1 0 0 0.1 0 0.1\nLANDMARK 3 9 1 1 0.1 0 0.1\nODOMETRY 3 8 1 0 0 0.1 0 0 0.1 0 0.1\n"
    problem = bearslam.load(io.BytesIO(text), format="graph")
    assert problem.view_ids == ("5", "3", "8")
    assert problem.odometry.start.tolist() == [0, 1]


TORO = "VERTEX2 0 0 0 0\nEDGE2 0 1 1 0 0 2500 0 2500 10000 0 0\nBR 1 2 0.5 10 0.02 0.3\n"


def test_a_file_that_ends_in_toro_has_information(tmp_path):
    path = tmp_path / "run.toro"
    path.write_text(TORO)
    np.testing.assert_allclose(bearslam.load(path).odometry.sigma, [[0.02, 0.02, 0.01]])
    with pytest.raises(InvalidInputError, match="expected a heading with a standard deviation .*, got 100: degrees?"):
        bearslam.load(path, noise="graph")


def test_degrees_are_no_radians(tmp_path):
    path = tmp_path / "run.graph"
    path.write_text(TORO.replace("BR 1 2 0.5", "BR 1 2 45"))
    with pytest.raises(InvalidInputError, match=r"run.graph:3: expected a bearing in radians within one turn, got 45"):
        bearslam.load(path)
