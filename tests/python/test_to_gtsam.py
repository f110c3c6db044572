# SPDX-License-Identifier: MIT OR Apache-2.0
"""Maps handed over to GTSAM, which finds the same optimum at once; skipped where it is not installed."""

import functools
import importlib.util

import numpy as np
import pytest

import bearslam

NOISE = np.radians(0.5)
SIGMA = (0.02, 0.02, 0.01)
HAS_GTSAM = importlib.util.find_spec("gtsam") is not None
needs_gtsam = pytest.mark.skipif(not HAS_GTSAM, reason="GTSAM is not installed: pip install gtsam")


def optimum(graph, values):
    import gtsam

    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setMaxIterations(100)
    parameters.setRelativeErrorTol(1e-14)
    parameters.setAbsoluteErrorTol(1e-14)
    return gtsam.LevenbergMarquardtOptimizer(graph, values, parameters).optimize()


def check(result, rel=1e-6, extra=0.0):
    """GTSAM has our cost at our map, and finds no lower minimum, from there and from nearby."""
    import gtsam

    graph, values = result.to_gtsam()
    ours = result.cost - extra
    assert graph.error(values) == pytest.approx(ours, rel=rel)
    found = optimum(graph, values)
    assert graph.error(found) == pytest.approx(ours, rel=rel)
    # Gauss-Newton fails if any gauge freedom is left.
    graph.error(gtsam.GaussNewtonOptimizer(graph, values).optimize())
    random = np.random.default_rng(0)
    beside = moved(values, random)
    assert graph.error(beside) > 1.5 * ours
    assert graph.error(optimum(graph, beside)) == pytest.approx(ours, rel=rel)
    return graph, found


def moved(values, random):
    """A start near by."""
    import gtsam

    steps = gtsam.VectorValues()
    for key in values.keys():  # noqa: SIM118
        size = 3 if chr(gtsam.Symbol(key).chr()) == "x" else 2
        steps.insert(key, random.normal(0, 0.01, size))
    return values.retract(steps)


def kinds(graph):
    """How many factors of each kind."""
    names = [type(graph.at(k)).__name__ for k in range(graph.size())]
    return {name: names.count(name) for name in sorted(set(names))}


@needs_gtsam
def test_bearings_alone():
    scene = bearslam.simulate("enclosed", 8, 12, noise=NOISE, seed=2)
    graph, values = check(bearslam.solve(scene.bearings, sigma=NOISE))
    assert kinds(graph) == {
        "BearingFactor2D": 96,
        "PoseRotationPrior2D": 1,
        "PoseTranslationPrior2D": 1,
        "RangeFactorPose2": 1,
    }
    assert values.size() == 20


@needs_gtsam
def test_a_sigma_for_each_sighting():
    scene = bearslam.simulate("enclosed", 6, 9, noise=NOISE, seed=2)
    sigma = NOISE * np.random.default_rng(1).uniform(0.5, 3.0, scene.bearings.shape)
    check(bearslam.solve(scene.bearings, sigma=sigma))


@needs_gtsam
@pytest.mark.parametrize("seed", range(3))
def test_lines(seed):
    scene = bearslam.simulate("enclosed", 8, 12, noise=NOISE, seed=seed)
    turned = scene.bearings + np.pi * (np.indices(scene.bearings.shape).sum(axis=0) % 3 == 0)
    check(bearslam.solve(turned, sigma=NOISE, oriented=False))


@needs_gtsam
def test_beacons_leave_nothing_open():
    scene = bearslam.simulate("enclosed", 8, 12, noise=NOISE, seed=2)
    beacons = bearslam.LandmarkPriors([0, 5], scene.landmarks[[0, 5]], sigma=0.01)
    graph, _ = check(bearslam.solve(scene.bearings, sigma=NOISE, landmark_priors=beacons))
    assert kinds(graph) == {"BearingFactor2D": 96, "PriorFactorPoint2": 2}


@needs_gtsam
def test_one_beacon_leaves_rotation_and_scale_open():
    scene = bearslam.simulate("enclosed", 8, 12, noise=NOISE, seed=2)
    beacon = bearslam.LandmarkPriors([3], scene.landmarks[[3]], sigma=[[0.01, 0.03]])
    graph, _ = check(bearslam.solve(scene.bearings, sigma=NOISE, landmark_priors=beacon))
    assert kinds(graph) == {
        "BearingFactor2D": 96,
        "PoseRotationPrior2D": 1,
        "PriorFactorPoint2": 1,
        "RangeFactorPose2": 1,
    }


@needs_gtsam
def test_compass_leaves_place_and_scale_open():
    scene = bearslam.simulate("enclosed", 8, 12, noise=NOISE, seed=2)
    compass = bearslam.PosePriors(range(8), scene.poses, sigma=[np.inf, np.inf, 0.02])
    graph, _ = check(bearslam.solve(scene.bearings, sigma=NOISE, pose_priors=compass))
    assert kinds(graph) == {
        "BearingFactor2D": 96,
        "PoseRotationPrior2D": 8,
        "PoseTranslationPrior2D": 1,
        "RangeFactorPose2": 1,
    }


@needs_gtsam
@pytest.mark.parametrize(
    "sigma",
    [
        [[0.02, 0.03, 0.01], [0.01, 0.05, 0.02], [0.03, 0.01, 0.01]],
        [[0.02, np.inf, 0.01], [np.inf, 0.01, np.inf], [0.03, 0.02, np.inf]],
    ],
)
def test_known_poses(sigma):
    scene = bearslam.simulate("enclosed", 8, 12, noise=NOISE, seed=3)
    random = np.random.default_rng(0)
    given = scene.poses[[1, 4, 6]] + random.normal(0, 0.01, (3, 3))
    priors = bearslam.PosePriors([1, 4, 6], given, sigma=sigma)
    graph, _ = check(bearslam.solve(scene.bearings, sigma=NOISE, pose_priors=priors))
    assert "RangeFactorPose2" not in kinds(graph)


@needs_gtsam
def test_one_known_coordinate_leaves_the_other_open():
    scene = bearslam.simulate("enclosed", 8, 12, noise=NOISE, seed=3)
    priors = bearslam.PosePriors([2], scene.poses[[2]], sigma=[0.01, np.inf, np.inf])
    graph, _ = check(bearslam.solve(scene.bearings, sigma=NOISE, pose_priors=priors))
    assert kinds(graph) == {
        "BearingFactor2D": 96,
        "PoseRotationPrior2D": 1,
        "PoseTranslationPrior2D": 2,
        "RangeFactorPose2": 1,
    }


@needs_gtsam
def test_everything_at_once():
    """Lines, outliers, odometry and a known pose."""
    scene = bearslam.simulate("trajectory", 30, 20, noise=NOISE, seed=4, sight=3.5)
    bearings = scene.bearings % np.pi
    view, landmark = np.argwhere(np.isfinite(bearings))[50]
    bearings[view, landmark] += 0.5
    result = bearslam.solve(
        bearings,
        sigma=NOISE,
        oriented=False,
        robust=True,
        odometry=scene.odometry(SIGMA, seed=1),
        pose_priors=bearslam.PosePriors([3], scene.poses[[3]], sigma=[0.01, 0.01, 0.01]),
    )
    wrong = int((~result.inliers & np.isfinite(result.residuals)).sum())
    assert wrong >= 1
    graph, _ = check(result, rel=3e-3, extra=4.5 * wrong)
    assert {"PoseRotationPrior2D", "PoseTranslationPrior2D", "BetweenFactorPose2"} < set(kinds(graph))
    assert "RangeFactorPose2" not in kinds(graph)


@needs_gtsam
def test_known_poses_with_covariances():
    """GTSAM uses the logarithm of the error, so the costs agree only to first order."""
    scene = bearslam.simulate("enclosed", 8, 12, noise=NOISE, seed=3)
    random = np.random.default_rng(0)
    root = random.normal(0, 0.02, (3, 3, 3))
    covariance = root @ root.transpose(0, 2, 1) + 1e-5 * np.eye(3)
    given = scene.poses[[1, 4, 6]] + random.normal(0, 0.02, (3, 3))
    priors = bearslam.PosePriors([1, 4, 6], given, sigma=covariance)
    result = bearslam.solve(scene.bearings, sigma=NOISE, pose_priors=priors)
    check(result, rel=5e-3)


def with_chart(graph, odometry, chart):
    """The same graph with the error of a motion as x, y and theta, bearslam's definition."""
    import gtsam

    other = gtsam.NonlinearFactorGraph()
    motions = iter(range(len(odometry)))
    for k in range(graph.size()):
        factor = graph.at(k)
        if isinstance(factor, gtsam.BetweenFactorPose2):
            keys, delta = factor.keys(), odometry.delta[next(motions)]
            error = functools.partial(chart, delta, keys)
            other.add(gtsam.CustomFactor(factor.noiseModel(), keys, lambda _, *rest, error=error: error(*rest)))
        else:
            other.add(factor)
    return other


@needs_gtsam
@pytest.mark.parametrize("full", [False, True])
def test_odometry(full, chart):
    scene = bearslam.simulate("trajectory", 60, 30, noise=NOISE, seed=4, sight=2.5)
    odometry = scene.odometry(SIGMA, seed=1)
    if full:
        covariance = np.diag(np.square(SIGMA)) + 1e-4 * np.ones((3, 3))
        odometry = bearslam.Odometry(odometry.start, odometry.end, odometry.delta, np.tile(covariance, (59, 1, 1)))
    result = bearslam.solve(scene.bearings, sigma=NOISE, odometry=odometry)
    # The logarithm rotates a step by half the error of the heading: by up to 0.005 rad, of either sign.
    graph, _ = check(result, rel=1e-3)
    assert kinds(graph)["BetweenFactorPose2"] == 59
    assert "RangeFactorPose2" not in kinds(graph)
    values = result.to_gtsam()[1]
    same = with_chart(graph, odometry, chart)
    assert same.error(values) == pytest.approx(result.cost, rel=1e-9)
    assert same.error(optimum(same, values)) == pytest.approx(result.cost, rel=1e-6)


@needs_gtsam
def test_outliers_are_left_out():
    scene = bearslam.simulate("enclosed", 8, 12, noise=NOISE, seed=2)
    bearings = scene.bearings.copy()
    bearings[2, 7] += 0.4
    bearings[5, 1] *= -1.0
    result = bearslam.solve(bearings, sigma=NOISE, robust=True)
    wrong = int((~result.inliers).sum())
    assert wrong >= 2
    # An outlier adds half the square of three standard deviations to our cost.
    graph, _ = check(result, extra=4.5 * wrong)
    assert kinds(graph)["BearingFactor2D"] == 96 - wrong


@needs_gtsam
def test_undetermined_views_and_landmarks_are_left_out():
    scene = bearslam.simulate("enclosed", 8, 12, noise=NOISE, seed=2)
    bearings = np.full((10, 14), np.nan)
    bearings[1:9, 1:13] = scene.bearings
    bearings[0, 3] = 0.5  # a view that sees one landmark
    bearings[4, 13] = 0.1  # a landmark that one view sees
    result = bearslam.solve(bearings, sigma=NOISE)
    assert {(one.kind, one.index) for one in result.undetermined} >= {("view", 0), ("landmark", 13)}
    graph, values = check(result)
    assert kinds(graph)["BearingFactor2D"] == 96
    assert values.size() == 20


@needs_gtsam
def test_the_map_comes_back_as_it_was():
    import gtsam

    scene = bearslam.simulate("enclosed", 8, 12, noise=NOISE, seed=2)
    result = bearslam.solve(scene.bearings, sigma=NOISE)
    graph, values = result.to_gtsam()
    found = optimum(graph, moved(values, np.random.default_rng(3)))
    poses = [found.atPose2(gtsam.symbol("x", i)) for i in range(8)]
    points = [found.atPoint2(gtsam.symbol("l", j)) for j in range(12)]
    np.testing.assert_allclose([[p.x(), p.y(), p.theta()] for p in poses], result.poses, atol=1e-5)
    np.testing.assert_allclose(points, result.landmarks, atol=1e-5)


def test_without_gtsam(monkeypatch):
    scene = bearslam.simulate("mixed", 4, 9, noise=NOISE, seed=1)
    result = bearslam.solve(scene.bearings)

    def missing(name, *rest, **options):
        if name == "gtsam":
            raise ImportError("no such thing")
        return real(name, *rest, **options)

    real = importlib.import_module
    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(ImportError, match="pip install gtsam"):
        result.to_gtsam()


@needs_gtsam
def test_what_is_half_known_is_not_held_as_well():
    """The standard deviation of a known y is kept, although x is fixed by the gauge."""
    import gtsam

    noise = np.radians(0.5)
    scene = bearslam.simulate("trajectory", 20, 15, noise=noise, seed=3, sight=3)
    known = bearslam.PosePriors(range(5), scene.poses[:5], sigma=[np.inf, 0.1, 0.05])
    odometry = scene.odometry([0.02, 0.02, 0.01], seed=3)
    result = bearslam.solve(scene.bearings, sigma=noise, odometry=odometry, pose_priors=known, covariance=True)
    graph, values = result.to_gtsam()
    theirs = gtsam.Marginals(graph, values).marginalCovariance(gtsam.symbol("x", 0))
    c, s = np.cos(result.poses[0, 2]), np.sin(result.poses[0, 2])
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    theirs = turn @ theirs @ turn.T
    np.testing.assert_allclose(np.diag(theirs)[1:], np.diag(result.pose_covariance[0])[1:], rtol=0.02)
