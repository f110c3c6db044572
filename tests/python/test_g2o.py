# SPDX-License-Identifier: MIT OR Apache-2.0
"""Problems and maps in files of g2o."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bearslam
from bearslam import InvalidInputError, LandmarkPriors, Odometry, Offsets, PosePriors, Problem, Sightings
from bearslam.g2o_file import parse, render

number = st.floats(-1e6, 1e6)
positive = st.floats(1e-4, 1e4) | st.sampled_from([1e-100, 1e100, 0.1, 1 / 3])
name = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\n\r"), min_size=1).filter(
    lambda text: text == text.strip()
)


def rows(count, size, what=number):
    return st.lists(st.lists(what, min_size=size, max_size=size), min_size=count, max_size=count)


@st.composite
def covariances(draw, size):
    """Positive definite, of any shape and scale, some of it zero."""
    scale = np.array(draw(st.lists(st.floats(1e-3, 1e3), min_size=size, max_size=size)))
    entries = np.array(draw(rows(size, size, st.floats(-0.4, 0.4) | st.just(0.0))))
    matrix = np.eye(size) + np.triu(entries, 1) + np.triu(entries, 1).T
    return matrix * np.outer(scale, scale)


@st.composite
def noises(draw, count, size, unknown=False):
    if draw(st.booleans()):
        each = positive | st.just(math.inf) if unknown else positive
        return np.array(draw(rows(count, size, each)))
    matrices = np.array([draw(covariances(size)) for _ in range(count)])
    skewed = matrices[:, ~np.eye(size, dtype=bool)].any()
    return matrices if skewed else np.sqrt(np.diagonal(matrices, axis1=1, axis2=2))


@st.composite
def problems(draw):
    m, n = draw(st.integers(1, 4)), draw(st.integers(1, 4))
    pairs = draw(st.lists(st.tuples(st.integers(0, m - 1), st.integers(0, n - 1)), min_size=1, unique=True))
    view, landmark = np.array(pairs).T
    k = len(pairs)
    bearing = np.array(draw(st.lists(number, min_size=k, max_size=k)))
    sigma = np.array(draw(st.lists(positive, min_size=k, max_size=k)))
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
        known["odometry"] = Odometry(*ends.T, draw(rows(count, 3)), draw(noises(count, 3)))
    if count := draw(st.integers(0, 3)):
        which = draw(st.lists(st.integers(0, m - 1), min_size=count, max_size=count))
        known["pose_priors"] = PosePriors(which, draw(rows(count, 3)), draw(noises(count, 3, unknown=True)))
    if count := draw(st.integers(0, 3)):
        which = draw(st.lists(st.integers(0, n - 1), min_size=count, max_size=count))
        known["landmark_priors"] = LandmarkPriors(which, draw(rows(count, 2)), draw(noises(count, 2)))
    places = draw(rows(m, 3)), draw(rows(n, 2))
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
