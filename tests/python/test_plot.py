# SPDX-License-Identifier: MIT OR Apache-2.0
"""Pictures."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

import bearslam
from bearslam.plot import draw_to_file, save_figure

SCENE = bearslam.simulate("mixed", 4, 9, noise=0.01, seed=1)


@pytest.fixture
def result():
    return bearslam.solve(SCENE.bearings)


def drawn(ax, kind):
    return [artist for artist in ax.collections if isinstance(artist, kind)]


def test_a_map_is_drawn_into_the_axes_given(result):
    ax = Figure().add_subplot()
    assert result.plot(ax) is ax
    (robots,), (rays,) = drawn(ax, PolyCollection), drawn(ax, LineCollection)
    assert len(robots.get_paths()) == 4
    assert len(rays.get_segments()) == 36
    assert ax.get_aspect() == 1.0
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["estimate", "bearing"]


def test_triangles_point_where_the_robots_head(result):
    ax = result.plot(Figure().add_subplot())
    for path, (x, y, theta) in zip(drawn(ax, PolyCollection)[0].get_paths(), result.poses, strict=True):
        tip = path.vertices[0] - [x, y]
        assert np.arctan2(tip[1], tip[0]) == pytest.approx(theta, abs=1e-9)


def test_rays_start_at_robots_and_end_near_landmarks(result):
    ax = result.plot(Figure().add_subplot())
    segments = np.array(drawn(ax, LineCollection)[0].get_segments())
    np.testing.assert_allclose(segments[:, 0], np.repeat(result.poses[:, :2], 9, axis=0))
    away = np.hypot(*(segments[:, 1] - np.tile(result.landmarks, (4, 1))).T)
    reach = np.hypot(*(segments[:, 1] - segments[:, 0]).T)
    np.testing.assert_allclose(away, 2 * reach * np.abs(np.sin(result.residuals.ravel() / 2)), atol=1e-9)


@pytest.mark.parametrize("truth", [SCENE, (SCENE.poses, SCENE.landmarks)])
def test_a_map_is_laid_over_the_truth(result, truth):
    ax = result.plot(Figure().add_subplot(), truth=truth)
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["truth", "estimate", "bearing"]
    assert ax.get_xlabel() == "x [m]"
    robots = [
        np.mean([path.vertices[:3].mean(axis=0) for path in one.get_paths()], axis=0)
        for one in drawn(ax, PolyCollection)
    ]
    assert np.hypot(*(robots[0] - robots[1])) < 0.5


def test_a_figure_is_made_where_none_is_given(result):
    ax = result.plot()
    assert ax.figure.number in plt.get_fignums()
    plt.close(ax.figure)


def test_what_is_undetermined_is_not_drawn():
    bearings = SCENE.bearings.copy()
    bearings[1:, 8] = np.nan
    result = bearslam.solve(bearings)
    ax = result.plot(Figure().add_subplot())
    assert len(drawn(ax, LineCollection)[0].get_segments()) == 32
    assert np.isfinite(ax.get_xlim()).all()


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_a_picture_is_the_same_each_time(result, tmp_path, suffix):
    paths = [tmp_path / f"{name}{suffix}" for name in "ab"]
    for path in paths:
        draw_to_file(result, path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert len(paths[0].read_bytes()) > 5000


def test_other_kinds_of_picture_are_refused(tmp_path):
    with pytest.raises(bearslam.InvalidInputError, match="path: expected a name that ends in .png or .svg or .pdf"):
        save_figure(Figure(), tmp_path / "map.bmp")


def test_a_truth_of_another_size_is_refused(result):
    with pytest.raises(bearslam.InvalidInputError, match="truth: poses"):
        result.plot(Figure().add_subplot(), truth=(SCENE.poses[:3], SCENE.landmarks))
