# SPDX-License-Identifier: MIT OR Apache-2.0
"""The same as GTSAM, an independent implementation, for bearings and odometry; skipped where it is not installed.

With `z^-1 (p^-1 q)` for the error of a motion, our residual is its x, y and theta. So is GTSAM's when it is built
without the full exponential map; the wheels of 4.3 are built with it, and theirs is the logarithm. The two agree to
first order in theta: the first is compared through a factor of our own, the second to what the difference lets expect.
"""

import functools

import numpy as np
import pytest

import bearslam

gtsam = pytest.importorskip("gtsam", reason="GTSAM is not installed: pip install gtsam")

NOISE = np.radians(0.5)
SIGMA = (0.02, 0.02, 0.01)
VIEWS = 100


def pose(k):
    return gtsam.symbol("x", k)


def landmark(k):
    return gtsam.symbol("l", k)


def graph_of(sightings, odometry, first, chart=None):
    """The graph, with the error of a motion in that chart or by GTSAM's definition."""
    graph = gtsam.NonlinearFactorGraph()
    bearing = gtsam.noiseModel.Isotropic.Sigma(1, NOISE)
    motion = gtsam.noiseModel.Diagonal.Sigmas(np.array(SIGMA))
    for i, j, angle in zip(sightings.view, sightings.landmark, sightings.bearing, strict=True):
        graph.add(gtsam.BearingFactor2D(pose(i), landmark(j), gtsam.Rot2.fromAngle(angle), bearing))
    for start, end, delta in zip(odometry.start, odometry.end, odometry.delta, strict=True):
        keys = [pose(start), pose(end)]
        if chart is None:
            graph.add(gtsam.BetweenFactorPose2(*keys, gtsam.Pose2(*delta), motion))
        else:
            error = functools.partial(chart, delta, keys)
            graph.add(gtsam.CustomFactor(motion, keys, lambda _, *rest, error=error: error(*rest)))
    # Nothing else constrains the first pose, so this prior has no cost.
    graph.add(gtsam.PriorFactorPose2(pose(0), gtsam.Pose2(*first), gtsam.noiseModel.Isotropic.Sigma(3, 1e-2)))
    return graph


def values_of(poses, landmarks):
    values = gtsam.Values()
    for k, row in enumerate(poses):
        values.insert(pose(k), gtsam.Pose2(*row))
    for k, row in enumerate(landmarks):
        values.insert(landmark(k), row)
    return values


def problem(seed):
    """A scene in which everything is seen often enough to be determined, its odometry, and a start near the truth."""
    scene = bearslam.simulate("trajectory", VIEWS, 40, noise=NOISE, seed=seed, sight=2.5)
    odometry = scene.odometry(SIGMA, seed=seed)
    random = np.random.default_rng(seed)
    poses = scene.poses + random.normal(0, [0.05, 0.05, 0.02], scene.poses.shape)
    landmarks = scene.landmarks + random.normal(0, 0.05, scene.landmarks.shape)
    return scene, odometry, poses, landmarks


def minimum(graph, start):
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setMaxIterations(200)
    parameters.setRelativeErrorTol(1e-12)
    parameters.setAbsoluteErrorTol(1e-12)
    return graph.error(gtsam.LevenbergMarquardtOptimizer(graph, start, parameters).optimize())


@pytest.mark.parametrize("seed", range(5))
def test_cost_of_a_map_and_of_the_minimum_from_the_same_start(seed, chart):
    scene, odometry, poses, landmarks = problem(seed)
    ours = bearslam.refine(scene.bearings, (poses, landmarks), sigma=NOISE, odometry=odometry)
    assert ours.converged
    assert ours.undetermined == ()
    graph = graph_of(scene.sightings, odometry, ours.poses[0], chart)
    assert graph.error(values_of(ours.poses, ours.landmarks)) == pytest.approx(ours.cost, rel=1e-9)
    theirs = minimum(graph_of(scene.sightings, odometry, poses[0], chart), values_of(poses, landmarks))
    assert ours.cost == pytest.approx(theirs, rel=1e-6)
    # The logarithm rotates a step by half the error of the heading: by up to 0.005 rad, of either sign.
    other = minimum(graph_of(scene.sightings, odometry, poses[0]), values_of(poses, landmarks))
    assert ours.cost == pytest.approx(other, rel=1e-4)


def test_covariances_with_the_first_pose_held(chart):
    scene, odometry, _, _ = problem(0)
    ours = bearslam.refine(scene.bearings, scene, sigma=NOISE, odometry=odometry, covariance="first_view")
    graph = graph_of(scene.sightings, odometry, ours.poses[0], chart)
    tight = gtsam.noiseModel.Isotropic.Sigma(3, 1e-7)
    graph.add(gtsam.PriorFactorPose2(pose(0), gtsam.Pose2(*ours.poses[0]), tight))
    marginals = gtsam.Marginals(graph, values_of(ours.poses, ours.landmarks))
    for view in (1, 30, 99):
        # GTSAM's covariance is in the frame of the pose, ours in that of the map.
        c, s = np.cos(ours.poses[view, 2]), np.sin(ours.poses[view, 2])
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        theirs = turn @ marginals.marginalCovariance(pose(view)) @ turn.T
        np.testing.assert_allclose(ours.pose_covariance[view], theirs, rtol=1e-6, atol=1e-12)
    for point in (0, 17, 39):
        theirs = marginals.marginalCovariance(landmark(point))
        np.testing.assert_allclose(ours.landmark_covariance[point], theirs, rtol=1e-6, atol=1e-12)
