# SPDX-License-Identifier: MIT OR Apache-2.0
"""Problems and maps in files of g2o."""

import io
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bearslam
from bearslam import InvalidInputError, LandmarkPriors, Odometry, Offsets, PosePriors, Problem, Sightings
from bearslam.io.g2o import parse, render

number = st.floats(-1e6, 1e6)
positive = st.floats(1e-4, 1e4) | st.sampled_from([1e-100, 1e100, 0.1, 1 / 3])
name = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\n\r"), min_size=1).filter(
    lambda text: text == text.strip()
)


def rows(count, size, what=number):
    return st.lists(st.lists(what, min_size=size, max_size=size), min_size=count, max_size=count)


def poses(count):
    """Poses with headings within one turn, as motions and priors have them."""
    turn = st.floats(-math.tau, math.tau)
    return st.lists(st.tuples(number, number, turn).map(list), min_size=count, max_size=count)


@st.composite
def covariances(draw, size):
    """Positive definite matrices of any shape and scale, with some zeros."""
    scale = np.array(draw(st.lists(st.floats(1e-3, 1e3), min_size=size, max_size=size)))
    entries = np.array(draw(rows(size, size, st.floats(-0.4, 0.4) | st.just(0.0))))
    matrix = np.eye(size) + np.triu(entries, 1) + np.triu(entries, 1).T
    return matrix * np.outer(scale, scale)


@st.composite
def noises(draw, count, size, unknown=False):
    if draw(st.booleans()):
        each = positive | st.just(math.inf) if unknown else positive
        deviations = np.array(draw(rows(count, size, each)))
        if size == 3:
            heading = deviations[:, 2]
            heading[np.isfinite(heading)] = np.minimum(heading[np.isfinite(heading)], math.pi)
        return deviations
    matrices = np.array([draw(covariances(size)) for _ in range(count)])
    if size == 3:
        # The heading has at most half a turn.
        scale = np.minimum(1, 3 / np.sqrt(matrices[:, 2:, 2:]))
        matrices[:, 2:] *= scale
        matrices[:, :, 2:] *= scale
    skewed = matrices[:, ~np.eye(size, dtype=bool)].any()
    return matrices if skewed else np.sqrt(np.diagonal(matrices, axis1=1, axis2=2))


@st.composite
def problems(draw):
    m, n = draw(st.integers(1, 4)), draw(st.integers(1, 4))
    pairs = draw(st.lists(st.tuples(st.integers(0, m - 1), st.integers(0, n - 1)), min_size=1, unique=True))
    view, landmark = np.array(pairs).T
    k = len(pairs)
    bearing = np.array(draw(st.lists(st.floats(-math.tau, math.tau), min_size=k, max_size=k)))
    sigma = np.minimum(draw(st.lists(positive, min_size=k, max_size=k)), 3.0)
    offsets = None
    if count := draw(st.integers(0, k)):
        places = rows(count, 2, st.floats(0.01, 100) | st.floats(-100, -0.01))
        which = sorted(draw(st.permutations(range(k)))[:count])
        noise = draw(noises(count, 2).filter(lambda one: one.ndim == 3 or ((one > 1e-9) & (one < 1e9)).all()))
        offsets = Offsets(which, draw(places), noise)
        bearing[which], sigma[which] = offsets.bearing, offsets.bearing_sigma
    if draw(st.booleans()):
        keys = draw(st.lists(st.integers(0, 2**31 - 1), min_size=m + n, max_size=m + n, unique=True))
        names = list(map(str, keys))
        names = names[:m], names[m:]
    else:
        names = [draw(st.lists(name, min_size=count, max_size=count, unique=True)) for count in (m, n)]
    known = {}
    if m > 1 and (count := draw(st.integers(0, 3))):
        ends = np.array([draw(st.permutations(range(m)))[:2] for _ in range(count)])
        known["odometry"] = Odometry(*ends.T, draw(poses(count)), draw(noises(count, 3)))
    if count := draw(st.integers(0, 3)):
        which = draw(st.lists(st.integers(0, m - 1), min_size=count, max_size=count))
        known["pose_priors"] = PosePriors(which, draw(poses(count)), draw(noises(count, 3, unknown=True)))
    if count := draw(st.integers(0, 3)):
        which = draw(st.lists(st.integers(0, n - 1), min_size=count, max_size=count))
        known["landmark_priors"] = LandmarkPriors(which, draw(rows(count, 2)), draw(noises(count, 2)))
    places = draw(poses(m)), draw(rows(n, 2))
    lost = [np.array(draw(st.lists(st.booleans(), min_size=count, max_size=count))) for count in (m, n)]
    if not all(one.all() for one in lost):
        start = [np.where(gone[:, None], np.nan, place) for gone, place in zip(lost, places, strict=True)]
        known["start"] = tuple(start)
        for kind, gone in zip(("fixed_views", "fixed_landmarks"), lost, strict=True):
            known[kind] = [i for i in range(len(gone)) if not gone[i] and draw(st.booleans())]
    others = draw(st.lists(st.sampled_from(["VERTEX_SE3:QUAT 9 0 0", "PARAMS_SE2OFFSET 0 1 2 3", "ROBOTLASER1 1"])))
    return Problem(Sightings(view, landmark, bearing, sigma), *names, offsets=offsets, others=others, **known)


def assert_same(one, other):
    """Every number the same, bit for bit; NaN is NaN."""
    assert one.view_ids == other.view_ids
    assert one.landmark_ids == other.landmark_ids
    assert one.others == other.others
    assert one.fixed_views == other.fixed_views
    assert one.fixed_landmarks == other.fixed_landmarks
    arrays = {
        "sightings": ("view", "landmark", "bearing", "sigma"),
        "odometry": ("start", "end", "delta", "sigma"),
        "pose_priors": ("view", "pose", "sigma"),
        "landmark_priors": ("landmark", "position", "sigma"),
        "offsets": ("sighting", "position", "sigma"),
        "start": ("poses", "landmarks"),
    }
    for field, parts in arrays.items():
        mine, yours = getattr(one, field), getattr(other, field)
        assert (mine is None) == (yours is None), field
        for part in parts if mine is not None else ():
            np.testing.assert_array_equal(getattr(mine, part), getattr(yours, part), strict=True, err_msg=field)


@given(problems())
def test_what_is_written_is_read_again_bit_for_bit(problem):
    text = render(problem)
    again = parse(text.encode(), "again.g2o")
    assert_same(problem, again)
    assert render(again) == text


PLAIN = """\
# edges before vertices, and in any order
EDGE_BEARING_SE2_XY 1 9 -0.5 400   # the door
EDGE_SE2 3 1 1.0 0.5 0.25 100 0 0 25 0 400
VERTEX_XY 7 4 5
VERTEX_SE2 3 0 0 0

EDGE_SE2_XY 3 7 3 4 100 0 25
VERTEX_SE2 1 1 0.5 -0.25
PARAMS_SE2OFFSET 0 0.1 0 0
FIX 3 7
EDGE_PRIOR_SE2 1 1 2 0.5 0 0 0 0 0 2500
EDGE_PRIOR_XY 9 5 6 4 1 2
VERTEX_SE3:QUAT 20 0 0 0 0 0 0 1
VERTEX_SE3:QUAT 21 0 0 0 0 0 0 1
"""


def test_every_tag_is_understood():
    problem = parse(PLAIN.encode(), "plain.g2o")
    assert problem.view_ids == ("3", "1")
    assert problem.landmark_ids == ("7", "9")
    seen = problem.sightings
    assert (seen.view.tolist(), seen.landmark.tolist()) == ([1, 0], [1, 0])
    assert seen.bearing.tolist() == [-0.5, math.atan2(4, 3)]
    # Across the line of sight 10 cm and 20 cm are 0.8 * 0.1 and 0.6 * 0.2, seen from 5.
    np.testing.assert_allclose(seen.sigma, [0.05, math.hypot(0.08, 0.12) / 5], rtol=1e-14)
    odometry = problem.odometry
    assert (odometry.start.tolist(), odometry.end.tolist()) == ([0], [1])
    assert odometry.delta.tolist() == [[1.0, 0.5, 0.25]]
    assert odometry.sigma.tolist() == [[0.1, 0.2, 0.05]]
    assert problem.pose_priors.pose.tolist() == [[1.0, 2.0, 0.5]]
    assert problem.pose_priors.sigma.tolist() == [[math.inf, math.inf, 0.02]]
    np.testing.assert_allclose(problem.landmark_priors.sigma[0], np.linalg.inv([[4, 1], [1, 2]]), rtol=1e-15)
    np.testing.assert_array_equal(problem.start.poses, [[0, 0, 0], [1, 0.5, -0.25]])
    np.testing.assert_array_equal(problem.start.landmarks, [[4, 5], [np.nan, np.nan]])
    assert (problem.fixed_views, problem.fixed_landmarks) == ((0,), (0,))
    assert problem.others[0] == "PARAMS_SE2OFFSET 0 0.1 0 0"
    assert problem.remarks == ("1 line PARAMS_SE2OFFSET kept but not used", "2 lines VERTEX_SE3:QUAT kept but not used")


@pytest.mark.parametrize(
    "change", [lambda t: "\ufeff" + t, lambda t: t.replace("\n", "\r\n"), lambda t: t.rstrip("\n")]
)
def test_files_of_other_systems(change):
    assert_same(parse(change(PLAIN).encode(), "plain.g2o"), parse(PLAIN.encode(), "plain.g2o"))


def test_known_poses_are_along_their_own_axes_in_g2o():
    """g2o measures the error of a known pose in the frame of that pose; bearslam in the frame of the map."""
    text = "EDGE_BEARING_SE2_XY 0 1 0.5 400\nEDGE_PRIOR_SE2 0 1 2 {} 100 0 0 25 0 400\n"
    turned = parse(text.format(math.pi / 2).encode(), "turned.g2o").pose_priors.sigma
    np.testing.assert_allclose(turned[0], np.diag([0.04, 0.01, 0.0025]), atol=1e-15)
    ahead = parse(text.format(0).encode(), "ahead.g2o").pose_priors.sigma
    assert ahead.tolist() == [[0.1, 0.2, 0.05]]
    local = np.linalg.inv([[100, 10, 5], [10, 25, 1], [5, 1, 400]])
    skewed = parse(text.replace("100 0 0 25 0 400", "100 10 5 25 1 400").format(0.3).encode(), "skewed.g2o")
    cosine, sine = math.cos(0.3), math.sin(0.3)
    axes = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    np.testing.assert_allclose(skewed.pose_priors.sigma[0], axes @ local @ axes.T, rtol=1e-12)


SEEN = "EDGE_BEARING_SE2_XY 0 1 0.5 400\n"
BAD = [
    ("", "bad.g2o: no EDGE_BEARING_SE2_XY or EDGE_SE2_XY: bearslam needs bearings"),
    ("VERTEX_SE2 0 0 0 0\n", "bad.g2o: no EDGE_BEARING_SE2_XY or EDGE_SE2_XY: bearslam needs bearings"),
    ("VERTEX_SE2 0 0 0\n", "bad.g2o:1: expected 4 numbers after VERTEX_SE2, got 3"),
    ("VERTEX_XY 0 0 0 0\n", "bad.g2o:1: expected 3 numbers after VERTEX_XY, got 4"),
    ("\n# x\nEDGE_BEARING_SE2_XY 0 1 0.5\n", "bad.g2o:3: expected 4 numbers after EDGE_BEARING_SE2_XY, got 3"),
    (SEEN.rstrip() + SEEN, "bad.g2o:1: expected 4 numbers after EDGE_BEARING_SE2_XY, got 8"),
    ("EDGE_BEARING_SE2_XY 0 1 # 0.5 400\n", "bad.g2o:1: expected 4 numbers after EDGE_BEARING_SE2_XY, got 2"),
    ("VERTEX_SE2 0 0 nan 0\n", "bad.g2o:1: expected a finite number, got 'nan'"),
    ("VERTEX_SE2 0 0 1e999 0\n", "bad.g2o:1: expected a finite number, got '1e999'"),
    ("VERTEX_SE2 0 0 1_0 0\n", "bad.g2o:1: expected a finite number, got '1_0'"),
    ("VERTEX_SE2 0 0 ٣ 0\n", "bad.g2o:1: expected a finite number, got '٣'"),
    ("VERTEX_SE2 0 0 x 0\n", "bad.g2o:1: expected a finite number, got 'x'"),
    (f"VERTEX_SE2 0 0 {'1' * 2000} 0\n", "bad.g2o:1: expected a finite number, got '1111"),
    ("VERTEX_SE2 1.0 0 0 0\n", "bad.g2o:1: expected the number of a vertex from 0, got '1.0'"),
    ("VERTEX_SE2 -1 0 0 0\n", "bad.g2o:1: expected the number of a vertex from 0, got '-1'"),
    ("VERTEX_SE2 ٣ 0 0 0\n", "bad.g2o:1: expected the number of a vertex from 0, got '٣'"),
    (f"VERTEX_SE2 {'9' * 5000} 0 0 0\n", "bad.g2o:1: expected the number of a vertex from 0, got '999"),
    ("vertex_se2 0 0 0 0\n", "bad.g2o:1: expected a tag such as VERTEX_SE2, got 'vertex_se2'"),
    (SEEN + "LANDMARK 0 2 3 4 1 0 1\n", "bad.g2o:2: expected tags of g2o, got LANDMARK of a text graph; read these as"),
    ("EDGE_SE2_XY 0 1 1e-200 0 1 0 1\n", "bad.g2o:1: expected a landmark at a distance from 1e-100 to 1e+100, got 1e-"),
    ("0.5 400\n", "bad.g2o:1: expected a tag such as VERTEX_SE2, got '0.5'"),
    ("EDGE_BEARING_SE2_XY 0 1 0.5 0\n", "bad.g2o:1: expected information above 0, got '0'"),
    ("EDGE_BEARING_SE2_XY 0 1 0.5 -4\n", "bad.g2o:1: expected information above 0, got '-4'"),
    (
        "EDGE_BEARING_SE2_XY 0 1 0.5 1e-300\n",
        "bad.g2o:1: expected a standard deviation from 1e-100 to 1e+100, got 1e+1",
    ),
    ("EDGE_SE2_XY 0 1 1 2 4 0 0\n", "bad.g2o:1: expected information above 0, got '0'"),
    ("EDGE_SE2_XY 0 1 1 2 4 4 4\n", "bad.g2o:1: expected information that is positive definite, got 4 4 4"),
    (
        "EDGE_SE2_XY 0 1 0 0 4 0 4\n",
        "bad.g2o:1: expected a landmark away from the pose, got one that coincides with it",
    ),
    ("EDGE_SE2_XY 0 1 1 2 1e-300 0 4\n", "bad.g2o:1: expected standard deviations from 1e-100 to 1e+100, got 1e+150"),
    ("EDGE_SE2_XY 0 1 1e90 0 1e40 0 1e40\n", "bad.g2o:1: expected a bearing with a standard deviation from 1e-100 to"),
    (SEEN + "EDGE_SE2 0 2 1 0 0 9 0 0 9 0 0\n", "bad.g2o:2: expected information above 0, got '0'"),
    (SEEN + "EDGE_SE2 0 2 1 0 0 9 0 5 9 0 1\n", "bad.g2o:2: expected information that is positive definite, got 9 0 5"),
    (SEEN + "EDGE_SE2 0 0 1 0 0 9 0 0 9 0 9\n", "bad.g2o:2: expected an edge between two poses, got 0 twice"),
    (
        SEEN + "EDGE_SE2 0 1 1 0 0 9 0 0 9 0 9\n",
        "bad.g2o:2: 1 is both a pose and a landmark; the other use is on line 1",
    ),
    (SEEN + "VERTEX_XY 0 1 0\n", "bad.g2o:2: 0 is both a pose and a landmark; the other use is on line 1"),
    (SEEN + "\n" + SEEN, "bad.g2o:3: pose '0' sees landmark '1' a second time; the first is on line 1"),
    (
        SEEN + "EDGE_SE2_XY 0 1 1 2 4 0 4\n",
        "bad.g2o:2: pose '0' sees landmark '1' a second time; the first is on line 1",
    ),
    ("VERTEX_XY 1 0 0\nVERTEX_XY 1 0 0\n", "bad.g2o:2: vertex 1 appears a second time; the first is on line 1"),
    (
        SEEN + "VERTEX_SE2 0 0 0 0 # bearslam unknown\nFIX 0\n",
        "bad.g2o:3: expected a vertex to fix, got 0, which has no",
    ),
    (SEEN + "FIX 0\n", "bad.g2o:2: expected a vertex to fix, got 0, which has no place"),
    (SEEN + "FIX\n", "bad.g2o:2: expected the number of a vertex after FIX, got nothing"),
    (
        SEEN + "EDGE_PRIOR_SE2 0 0 0 1 0 0 0 4 0 4\n",
        "bad.g2o:2: expected information on both x and y or on neither, as",
    ),
    (
        SEEN + "EDGE_PRIOR_SE2 0 0 0 1 9 0 0 5e-324 0 4\n",
        "bad.g2o:2: expected standard deviations from 1e-100 to 1e+100,",
    ),
    (
        SEEN + "EDGE_PRIOR_SE2 0 0 0 1 9 0 0 4 0 0\n",
        "bad.g2o:2: expected the same information on x and y, as the pose is",
    ),
    (
        SEEN + "EDGE_PRIOR_SE2 0 0 0 0 0 0 0 0 0 4\nEDGE_PRIOR_SE2 0 0 0 0 4 1 0 4 0 4\n",
        "bad.g2o:2: a coordinate without information cannot be combined with correlated priors",
    ),
    (SEEN + "EDGE_PRIOR_XY 1 0 0 0 0 4\n", "bad.g2o:2: expected information above 0, got '0'"),
    (
        "VERTEX_XY 1 0 0 # bearslam name\n",
        "bad.g2o:1: expected unknown or a name in the comment of bearslam, got 'name'",
    ),
    (
        "VERTEX_XY 1 0 0 # bearslam door\n",
        "bad.g2o:1: expected unknown or a name in the comment of bearslam, got 'door'",
    ),
    (
        "EDGE_SE2 0 1 0 0 0 1 0 0 1 0 1 # bearslam name a\n",
        "bad.g2o:1: expected sigma and 3 numbers or covariance and 6 in the comment of bearslam, got 'name a'",
    ),
    (
        "EDGE_SE2_XY 0 1 1 1 1 0 1 # bearslam covariance 1 0\n",
        "bad.g2o:1: expected sigma and 2 numbers or covariance and 3 in the comment of bearslam, got 'covariance 1 0'",
    ),
    ("EDGE_SE2_XY 0 1 1 1 1 0 1 # bearslam sigma 1 nan\n", "bad.g2o:1: expected a finite number, got 'nan'"),
    ("EDGE_SE2_XY 0 1 1 1 1 0 1 # bearslam covariance 1 0 inf\n", "bad.g2o:1: expected a finite number, got 'inf'"),
    (
        "EDGE_SE2_XY 0 1 1 1 1 0 1 # bearslam sigma 1 -1\n",
        "bad.g2o:1: expected numbers above 0 in the comment of bearslam, got -1",
    ),
    (
        "EDGE_PRIOR_SE2 0 0 0 0 4 0 0 4 0 4 # bearslam sigma 1 1 1\n",
        "bad.g2o:1: expected the information that the comment of bearslam states, got another",
    ),
    (
        "EDGE_SE2_XY 0 1 1 1 1 0 1 # bearslam covariance 1 1 1\n",
        "bad.g2o:1: expected a positive definite covariance whose inverse doubles can hold",
    ),
    (
        SEEN + "VERTEX_SE2 0 0 0 0 # bearslam name a\nVERTEX_SE2 2 0 0 0 # bearslam name a\n",
        "bad.g2o: view_ids: expected distinct names, got 'a' twice",
    ),
]


@pytest.mark.parametrize(("text", "message"), BAD)
def test_a_bad_line_is_named(text, message):
    with pytest.raises(InvalidInputError) as caught:
        parse(text.encode(), "bad.g2o")
    assert str(caught.value).startswith(message)


def test_what_is_no_text_is_refused_with_its_line():
    with pytest.raises(InvalidInputError, match="^bad.g2o:2: expected text in UTF-8, got byte 0xff"):
        parse(b"VERTEX_SE2 0 0 0 0\n\xff", "bad.g2o")


@given(st.text() | st.text(alphabet="VERTEX_S2 EDGBARINFP#bearslmgov\n01.-e"))
def test_any_text_is_read_or_refused(text):
    try:
        assert len(parse((SEEN + text).encode("utf-8", "replace"), "any.g2o").sightings)
    except InvalidInputError as error:
        assert str(error).startswith("any.g2o:")


SIGHTINGS = Sightings([0, 1], [0, 0], [0.5, -0.5], 0.1)


@pytest.mark.parametrize(
    ("problem", "message"),
    [
        (
            Sightings([0], [0], [0.5]),
            "sightings: expected standard deviations, since g2o states the information of every",
        ),
        (
            [[0.5]],
            "sightings: expected standard deviations, since g2o states the information of every edge, got none; give",
        ),
        (Sightings([0, 0], [0, 0], [0.5, 0.6], 0.1), "sightings: view 0 sees landmark 0 more than once"),
        (
            Problem(SIGHTINGS, "ab", "c", others=["EDGE_SE2 0 1"]),
            "others: expected lines with tags that bearslam does not",
        ),
        (
            Problem(SIGHTINGS, "ab", "c", others=["A 1\nFIX 0"]),
            "others: expected lines with tags that bearslam does not",
        ),
        (
            Problem(SIGHTINGS, "ab", "c", others=["# x"]),
            "others: expected lines with tags that bearslam does not use, as",
        ),
        (
            Problem(SIGHTINGS, "ab", "c", others=[""]),
            "others: expected lines with tags that bearslam does not use, as load",
        ),
        (
            Problem(SIGHTINGS, "ab", "c", start=([[0, 0, 0], [1, 1, np.nan]], [[0, 0]])),
            "start: poses[1]: expected all or none of the coordinates for a g2o file",
        ),
        (
            Problem(SIGHTINGS, "ab", "c", offsets=Offsets([1], [[1.0, 2.0]], [0.1, 0.1])),
            "offsets: expected the bearing of sighting 1 to be that of its offset, 1.107",
        ),
        (
            Problem(
                SIGHTINGS, "ab", "c", landmark_priors=LandmarkPriors([0], [[0, 0]], [[[1e-320, 0], [1e-321, 1.0]]])
            ),
            "EDGE_PRIOR_XY 2: expected a positive definite covariance whose inverse doubles can hold",
        ),
    ],
)
def test_what_would_not_come_back_is_not_written(tmp_path, problem, message):
    with pytest.raises(InvalidInputError) as caught:
        bearslam.save(problem, tmp_path / "out.g2o")
    assert str(caught.value).startswith(message)
    assert not list(tmp_path.iterdir())


def test_plain_sightings_go_by_numbers(tmp_path):
    bearslam.save(SIGHTINGS, tmp_path / "plain.g2o")
    again = bearslam.load(tmp_path / "plain.g2o")
    assert (again.view_ids, again.landmark_ids, again.start) == (("0", "1"), ("2",), None)
    assert again.sightings.sigma.tolist() == [0.1, 0.1]


def test_correlations_that_vanish_are_none():
    problem = parse((SEEN + "EDGE_PRIOR_XY 1 5 6 4 5e-324 16\n").encode(), "tiny.g2o")
    assert problem.landmark_priors.sigma.tolist() == [[0.5, 0.25]]
    assert_same(parse(render(problem).encode(), "again.g2o"), problem)


def test_large_and_odd_identifiers_are_names():
    text = "EDGE_BEARING_SE2_XY 8646911284551352321 007 0.5 400\n"
    problem = parse(text.encode(), "symbols.g2o")
    assert (problem.view_ids, problem.landmark_ids) == (("8646911284551352321",), ("7",))
    written = render(problem)
    assert "VERTEX_SE2 0 0 0 0  # bearslam unknown name 8646911284551352321\n" in written
    assert_same(parse(written.encode(), "again.g2o"), problem)


@pytest.fixture(scope="module")
def solved():
    """A map with all kinds of measurements, one landmark of which is undetermined."""
    scene = bearslam.simulate("trajectory", 12, 10, noise=0.01, seed=4, sight=3.0)
    bearings = np.column_stack([scene.bearings, np.full(12, np.nan)])
    bearings[3, 10] = 0.5
    bearings = bearings[:, np.isfinite(bearings).any(axis=0)]
    view, landmark = np.nonzero(np.isfinite(bearings))
    return bearslam.solve(
        Sightings(view, landmark, bearings[view, landmark], 0.01),
        odometry=scene.odometry([0.05, 0.03, 0.02], seed=1),
        pose_priors=PosePriors([0, 5], [scene.poses[0], [0, 0, 0.3]], [[0.1, 0.2, 0.05], [math.inf, math.inf, 0.1]]),
        landmark_priors=LandmarkPriors([1], scene.landmarks[[1]], [[[0.04, 0.01], [0.01, 0.09]]]),
    )


def test_a_map_goes_on_from_where_it_is(solved, tmp_path):
    path = tmp_path / "map.g2o"
    solved.save(path)
    problem = bearslam.load(path)
    np.testing.assert_array_equal(problem.start.poses, solved.poses)
    np.testing.assert_array_equal(problem.start.landmarks, solved.landmarks)
    assert np.isnan(solved.landmarks[-1]).all()
    for field in ("odometry", "pose_priors", "landmark_priors"):
        np.testing.assert_array_equal(getattr(problem, field).sigma, getattr(solved, field).sigma)
    again = bearslam.refine(problem)
    assert again.cost == pytest.approx(solved.cost, rel=1e-9)


def test_lines_are_not_written_as_rays(tmp_path):
    scene = bearslam.simulate("mixed", 6, 10, noise=0.002, seed=3)
    result = bearslam.solve(scene.bearings % np.pi, sigma=0.002, oriented=False)
    with pytest.raises(InvalidInputError, match="^path: expected bearings that are rays, as in g2o, got lines"):
        result.save(tmp_path / "lines.g2o")
    assert not list(tmp_path.iterdir())


def test_gtsam_reads_what_it_knows(solved, tmp_path):
    gtsam = pytest.importorskip("gtsam")
    path = tmp_path / "map.g2o"
    solved.save(path)
    graph, values = gtsam.readG2o(str(path), False)
    assert graph.size() == len(solved.odometry)
    for k in range(graph.size()):
        factor = graph.at(k)
        assert list(factor.keys()) == [solved.odometry.start[k], solved.odometry.end[k]]
        delta = factor.measured()
        assert [delta.x(), delta.y()] == solved.odometry.delta[k, :2].tolist()
        assert delta.theta() == pytest.approx(solved.odometry.delta[k, 2], abs=1e-15)
        np.testing.assert_allclose(factor.noiseModel().sigmas(), solved.odometry.sigma[k], rtol=1e-14)
    for i, (x, y, theta) in enumerate(solved.poses):
        pose = values.atPose2(i)
        np.testing.assert_allclose([pose.x(), pose.y(), pose.theta()], [x, y, theta], rtol=1e-15)


def test_g2o_reads_all_of_it(solved, tmp_path):
    """The cost of the file by g2o's definitions is that of bearslam."""
    g2o = pytest.importorskip("g2opy")
    path = tmp_path / "map.g2o"
    solved.save(path)
    optimizer = g2o.SparseOptimizer()
    optimizer.load(str(path))
    m, n = len(solved.poses), len(solved.landmarks)
    assert sorted(optimizer.vertices()) == list(range(m + n))
    edges = list(optimizer.edges())
    priors = len(solved.pose_priors) + len(solved.landmark_priors)
    assert len(edges) == len(solved.sightings) + len(solved.odometry) + priors
    optimizer.compute_active_errors()
    # An undetermined landmark still has a vertex in the file, and an error that is not part of the cost.
    lost = m + n - 1
    chi2 = 0.0
    for edge in edges:
        edge.compute_error()
        if lost not in {vertex.id() for vertex in edge.vertices()}:
            chi2 += edge.chi2()
    assert chi2 / 2 == pytest.approx(solved.cost, rel=1e-9)


def test_degrees_are_no_radians():
    text = b"EDGE_BEARING_SE2_XY 0 7 45 100\n"
    with pytest.raises(InvalidInputError, match=r":1: expected a bearing in radians within one turn, got 45"):
        bearslam.load(io.BytesIO(text), format="g2o")
