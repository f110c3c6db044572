# SPDX-License-Identifier: MIT OR Apache-2.0
"""Pictures."""

import dataclasses

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
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


def test_ellipses_have_the_axes_of_the_covariances():
    result = bearslam.solve(SCENE.bearings, sigma=0.01, covariance="free_network")
    ax = result.plot(Figure().add_subplot())
    (ellipses,) = drawn(ax, EllipseCollection)
    np.testing.assert_allclose(ellipses.get_offsets()[4:], result.landmarks)
    turn = np.radians(ellipses.get_angles())[4:]
    axes = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    variances = np.einsum("ki,kij,kj->k", axes, result.landmark_covariance, axes)
    np.testing.assert_allclose(ellipses.get_widths()[4:], 2 * np.sqrt(5.991 * variances), rtol=1e-3)  # chi-square, 2
    assert (ellipses.get_widths() >= ellipses.get_heights()).all()
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["estimate", "95 % ellipse\n(free network)", "bearing"]


def test_ellipses_go_with_the_map_over_the_truth():
    result = bearslam.solve(SCENE.bearings, sigma=0.01, covariance=True)
    plain, over = (result.plot(Figure().add_subplot(), truth=truth) for truth in (None, SCENE))
    before, after = (drawn(ax, EllipseCollection)[0] for ax in (plain, over))
    map_, truth = (np.concatenate([one.poses[:, :2], one.landmarks]) for one in (result, SCENE))
    similarity = bearslam.align(map_, truth)
    np.testing.assert_allclose(after.get_widths(), similarity.scale * before.get_widths(), rtol=1e-9)
    # The first view is held: an ellipse without extent, whose angle means nothing.
    turned = np.radians(after.get_angles() - before.get_angles())[1:] - similarity.angle
    np.testing.assert_allclose(np.sin(turned), 0, atol=1e-6)


def test_what_is_without_bounds_has_no_ellipse(result):
    def drawn_with(value):
        landmark = np.tile(1e-4 * np.eye(2), (9, 1, 1))
        landmark[2, 0, 0] = value
        pose = np.full((4, 3, 3), np.nan)
        full = dataclasses.replace(
            result, pose_covariance=pose, landmark_covariance=landmark, covariance_frame="first_view"
        )
        return drawn(full.plot(Figure().add_subplot()), EllipseCollection)

    assert len(drawn_with(np.inf)[0].get_offsets()) == len(drawn_with(np.nan)[0].get_offsets()) == 8
    assert len(drawn_with(1e-4)[0].get_offsets()) == 9


def test_a_picture_without_any_bounded_ellipse_says_nothing_of_them(result):
    nothing = {"pose_covariance": np.full((4, 3, 3), np.nan), "landmark_covariance": np.full((9, 2, 2), np.inf)}
    ax = dataclasses.replace(result, **nothing, covariance_frame="first_view").plot(Figure().add_subplot())
    assert drawn(ax, EllipseCollection) == []
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["estimate", "bearing"]


def test_outliers_are_drawn_apart():
    bearings = SCENE.bearings.copy()
    bearings[1, 4] += 0.5
    result = bearslam.refine(bearings, SCENE, sigma=0.01, loss="truncated", loss_scale=6.0)
    ax = result.plot(Figure().add_subplot())
    good, wrong = drawn(ax, LineCollection)
    assert len(good.get_segments()) == 35
    (segment,) = wrong.get_segments()
    np.testing.assert_allclose(segment[0], result.poses[1, :2])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["estimate", "bearing", "outlier"]


def test_lines_without_direction_are_drawn_to_their_landmarks():
    bearings = SCENE.bearings + np.pi * (np.indices(SCENE.bearings.shape).sum(axis=0) % 2)
    result = bearslam.solve(bearings, sigma=0.01, oriented=False)
    ends = np.array(drawn(result.plot(Figure().add_subplot()), LineCollection)[0].get_segments())[:, 1]
    reach = np.hypot(*(np.repeat(result.poses[:, :2], 9, axis=0) - np.tile(result.landmarks, (4, 1))).T)
    assert (np.hypot(*(ends - np.tile(result.landmarks, (4, 1))).T) < 0.1 * reach).all()


def test_thousands_of_ellipses(result, tmp_path):
    random = np.random.default_rng(0)
    landmarks = random.uniform(-3, 3, (5000, 2))
    roots = random.normal(0, 0.02, (5000, 2, 2))
    many = dataclasses.replace(
        result,
        landmarks=np.concatenate([result.landmarks, landmarks]),
        landmark_covariance=np.concatenate([np.tile(1e-4 * np.eye(2), (9, 1, 1)), roots @ roots.transpose(0, 2, 1)]),
        pose_covariance=np.zeros((4, 3, 3)),
        covariance_frame="free_network",
    )
    draw_to_file(many, tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 5000
