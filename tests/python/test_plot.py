# SPDX-License-Identifier: MIT OR Apache-2.0
"""Pictures."""

import dataclasses

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.figure import Figure

import bearslam
from bearslam.plotting.map import draw_to_file, save_figure
from bearslam.plotting.odometry_chains import odometry_chains
from bearslam.plotting.style import ROBOTS

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
    # The first view is fixed: an ellipse without extent, whose angle is arbitrary.
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
    result = bearslam.refine(
        bearings, SCENE, sigma=0.01, loss="truncated", refinement=bearslam.RefineOptions(loss_scale=6.0)
    )
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


NOISE = [0.02, 0.02, 0.01]


def way(views, landmarks=40, **options):
    """Truth, odometry along it, and its map: a robot on a loop that sees all landmarks."""
    scene = bearslam.simulate("trajectory", views, landmarks, noise=0.003, seed=2, **options)
    odometry = scene.odometry(NOISE, seed=1)
    return scene, odometry, bearslam.refine(scene.sightings, scene, sigma=0.003, odometry=odometry)


@pytest.fixture(scope="module")
def long():
    return way(100)


def motions(pairs):
    start, end = np.transpose(pairs)
    return bearslam.Odometry(start, end, np.zeros((len(start), 3)), NOISE)


def texts(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def paths(ax):
    """The lines with more than two points in them: trajectories, in the order drawn."""
    return [[line for line in one.get_segments() if len(line) > 2] for one in drawn(ax, LineCollection)]


def diamonds(ax):
    return [line for line in ax.lines if line.get_marker() == "D"]


def test_views_in_a_row_are_a_chain():
    of = odometry_chains(motions([[0, 1], [2, 1], [2, 3], [2, 3]]), 5)
    assert [robot.tolist() for robot in of.robots] == [[0, 1, 2, 3]]
    assert len(of.closures) == 0


@pytest.mark.parametrize("pairs", [[[0, 2], [2, 4], [1, 3], [3, 5]], [[1, 3], [2, 0], [5, 3], [4, 2]]])
def test_robots_may_take_turns(pairs):
    assert [robot.tolist() for robot in odometry_chains(motions(pairs), 6).robots] == [[0, 2, 4], [1, 3, 5]]


def test_motions_between_views_that_do_not_follow_are_closures():
    of = odometry_chains(motions([[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [2, 5], [3, 5]]), 8)
    assert [robot.tolist() for robot in of.robots] == [[0, 1, 2, 3], [4, 5, 6]]
    assert of.closures.tolist() == [[0, 3], [2, 5], [3, 5]]


def test_without_odometry_there_are_no_chains():
    of = odometry_chains(None, 5)
    assert of.robots == ()
    assert of.closures.shape == (0, 2)


def test_a_map_keeps_the_odometry_of_the_problem(long):
    _, odometry, result = long
    assert result.odometry is odometry
    assert bearslam.solve(SCENE.bearings).odometry is None


def test_many_views_are_a_line(long):
    scene, _, result = long
    ax = result.plot(Figure().add_subplot(), truth=scene)
    (truth,), (estimate,), _ = paths(ax)
    np.testing.assert_allclose(truth, scene.poses[:, :2])
    similarity = bearslam.align(
        *(np.concatenate([one.poses[:, :2], one.landmarks]) for one in (result, scene)),
    )
    np.testing.assert_allclose(estimate, similarity.apply(result.poses[:, :2]))
    assert texts(ax) == ["truth", "estimate", "start, end", "bearing (1 in 2)"]
    assert len(ax.texts) == 0


def test_triangles_along_a_line_point_where_the_robot_heads(long):
    _, _, result = long
    (triangles,) = drawn(result.plot(Figure().add_subplot()), PolyCollection)
    middles = np.array([path.vertices[:3] @ [1, 1j] for path in triangles.get_paths()])
    assert 20 <= len(middles) <= 24
    tips = np.angle(middles[:, 0] - middles[:, 1:].mean(axis=1))
    # The corners are 1 ahead of the pose and 0.7 behind it.
    at = middles[:, 0] * 0.7 / 1.7 + middles[:, 1:].mean(axis=1) / 1.7
    nearest = np.abs(at[:, None] - result.poses[:, :2] @ [1, 1j]).argmin(axis=1)
    np.testing.assert_allclose(np.angle(np.exp(1j * (tips - result.poses[nearest, 2]))), 0, atol=1e-6)
    steps = np.hypot(*np.diff(result.poses[:, :2], axis=0).T)
    gone = np.concatenate([[0.0], steps.cumsum()])[nearest]
    np.testing.assert_allclose(np.diff(gone), steps.sum() / 24, atol=steps.max())


def test_the_start_is_hollow_and_the_end_is_filled(long):
    _, _, result = long
    start, end = diamonds(result.plot(Figure().add_subplot()))
    np.testing.assert_allclose(np.ravel(start.get_data()), result.poses[0, :2])
    np.testing.assert_allclose(np.ravel(end.get_data()), result.poses[-1, :2])
    assert start.get_markerfacecolor() == "white" != end.get_markerfacecolor()


def test_few_views_are_triangles_with_odometry_as_well():
    _, odometry, result = way(60)
    assert result.odometry is odometry
    ax = result.plot(Figure().add_subplot())
    assert len(drawn(ax, PolyCollection)[0].get_paths()) == 60
    assert diamonds(ax) == []


def test_many_views_without_odometry_are_small_triangles(long):
    _, _, result = long
    ax = dataclasses.replace(result, odometry=None).plot(Figure().add_subplot())
    assert len(drawn(ax, PolyCollection)[0].get_paths()) == 100
    assert texts(ax) == ["estimate", "bearing (1 in 2)"]


def test_a_loop_closure_is_drawn_apart(long):
    _, odometry, result = long
    pairs = np.column_stack([odometry.start, odometry.end]).tolist()
    closed = dataclasses.replace(result, odometry=motions([*pairs, [99, 3]]))
    ax = closed.plot(Figure().add_subplot())
    line, (closure,), _ = (one.get_segments() for one in drawn(ax, LineCollection))
    assert len(line) == 1
    np.testing.assert_allclose(closure, result.poses[[3, 99], :2])
    assert texts(ax) == ["estimate", "start, end", "loop closure", "bearing (1 in 2)"]


def test_several_robots_have_a_colour_each(long):
    _, odometry, result = long
    pairs = np.column_stack([odometry.start, odometry.end]).tolist()
    several = dataclasses.replace(result, odometry=motions([pair for pair in pairs if pair[0] not in (29, 69)]))
    ax = several.plot(Figure().add_subplot())
    lines = drawn(ax, LineCollection)[0]
    assert [len(line) for line in lines.get_segments()] == [30, 40, 30]
    assert len(np.unique(lines.get_colors(), axis=0)) == 3
    assert len(diamonds(ax)) == 6
    assert texts(ax) == ["robot 0", "robot 1", "robot 2", "landmark", "start, end", "bearing (1 in 2)"]
    names = [f"{'red' if i < 30 else 'blue' if i < 70 else '7'}@{i}" for i in range(100)]
    ax = dataclasses.replace(several, view_ids=tuple(names)).plot(Figure().add_subplot())
    assert texts(ax)[:3] == ["robot red", "robot blue", "robot 7"]


def test_more_robots_than_colours_have_one_colour(long):
    _, odometry, result = long
    pairs = np.column_stack([odometry.start, odometry.end]).tolist()
    crowd = dataclasses.replace(result, odometry=motions([pair for pair in pairs if pair[1] % 10]))
    ax = crowd.plot(Figure().add_subplot())
    lines = drawn(ax, LineCollection)[0]
    assert len(lines.get_segments()) == 10 > len(ROBOTS)
    assert len(np.unique(lines.get_colors(), axis=0)) == 1
    assert texts(ax) == ["estimate", "start, end", "bearing (1 in 2)"]


def test_a_line_has_gaps_where_views_are_undetermined(long):
    _, _, result = long
    poses = result.poses.copy()
    poses[[0, 40, 41, 43]] = np.nan
    ax = dataclasses.replace(result, poses=poses).plot(Figure().add_subplot())
    assert [len(line) for line in drawn(ax, LineCollection)[0].get_segments()] == [39, 56]
    _, alone = drawn(ax, PolyCollection)
    (corners,) = alone.get_paths()
    tip, left, right = corners.vertices[:3]
    np.testing.assert_allclose(tip * 0.7 / 1.7 + (left + right) / 3.4, result.poses[42, :2])
    start, _ = diamonds(ax)
    np.testing.assert_allclose(np.ravel(start.get_data()), result.poses[1, :2])


def test_a_map_of_nothing_is_an_empty_picture(long):
    _, _, result = long
    nothing = {"poses": np.full((100, 3), np.nan), "landmarks": np.full((40, 2), np.nan)}
    ax = dataclasses.replace(result, **nothing).plot(Figure().add_subplot())
    assert [len(one.get_segments()) for one in drawn(ax, LineCollection)] == [0, 0]
    assert diamonds(ax) == []


def test_the_legend_says_how_many_bearings_are_drawn(long):
    _, _, result = long
    rays = drawn(result.plot(Figure().add_subplot()), LineCollection)[-1]
    assert len(rays.get_segments()) == 2000  # of 4000
    assert rays.get_rasterized()


def test_all_outliers_are_drawn_and_thin_where_they_are_many(long):
    _, _, result = long
    widths = []
    for wrong in (10, 3000):
        inliers = np.arange(4000) >= wrong
        ax = dataclasses.replace(result, inliers=inliers).plot(Figure().add_subplot())
        dashed = drawn(ax, LineCollection)[-1]
        assert len(dashed.get_segments()) == wrong
        widths.append(dashed.get_linewidth()[0])
    assert texts(ax)[-2:] == ["bearing", "outlier"]
    assert widths[0] == 1.0 > 2 * widths[1]


def test_ellipses_of_views_are_thinned_and_those_of_landmarks_are_not():
    scene, odometry, _ = way(100)
    result = bearslam.refine(scene.sightings, scene, sigma=0.003, odometry=odometry, covariance=True)
    ax = result.plot(Figure().add_subplot())
    (ellipses,) = drawn(ax, EllipseCollection)
    assert len(ellipses.get_offsets()) == 20 + 40
    np.testing.assert_allclose(ellipses.get_offsets()[:20], result.poses[::5, :2])
    assert "95 % ellipse\n(first view,\n1 view in 5)" in texts(ax)


def test_markers_shrink_where_there_are_many(result):
    def size(landmarks):
        points = np.random.default_rng(0).uniform(-1, 1, (landmarks, 2))
        ax = dataclasses.replace(result, landmarks=points).plot(Figure().add_subplot())
        return ax.lines[0].get_markersize()

    assert size(9) == size(50) > size(100) > size(400)


def test_a_map_of_thousands_of_views_is_a_small_file(tmp_path):
    scene = bearslam.simulate("trajectory", 7000, 200, noise=0.003, seed=3, sight=0.6)
    assert len(scene.sightings) > 30_000
    odometry = scene.odometry(NOISE, seed=1)
    result = bearslam.refine(
        scene.bearings, scene, sigma=0.003, odometry=odometry, refinement=bearslam.RefineOptions(max_iterations=2)
    )
    random = np.random.default_rng(0)
    full = dataclasses.replace(
        result,
        inliers=random.uniform(size=result.inliers.shape) > 0.1,
        pose_covariance=np.tile(1e-4 * np.eye(3), (7000, 1, 1)),
        landmark_covariance=np.tile(1e-4 * np.eye(2), (200, 1, 1)),
        covariance_frame="priors",
    )
    for name in ("map.svg", "map.pdf", "map.png"):
        draw_to_file(full, tmp_path / name)
        assert 20_000 < (tmp_path / name).stat().st_size < 2_000_000
