# SPDX-License-Identifier: MIT OR Apache-2.0
"""A map of bearslam in GTSAM: costs from the same data and start, and times.

With `z^-1 (p^-1 q)` for the error of a motion, bearslam's residual is its x, y and theta. The wheels of GTSAM take its
logarithm instead, which agrees to first order in theta. So costs are compared with factors that use bearslam's
residual, which are in Python and slow, and times with GTSAM's own factors.
"""

from __future__ import annotations

import functools
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

import bearslam

Array = NDArray[np.float64]


def chart(delta: Array, keys: list[int], values: Any, jacobians: list[Array] | None) -> Array:
    """The error of a motion as x, y and theta, with derivatives along steps in the frames of the poses."""
    import gtsam

    measured, (start, end) = gtsam.Pose2(*delta), map(values.atPose2, keys)
    moved = start.inverse() * end
    error = measured.inverse() * moved
    if jacobians is not None:
        before, after = -np.eye(3), np.eye(3)
        back = measured.rotation().matrix().T
        before[:2, :2] = -back
        before[:2, 2] = back @ [moved.y(), -moved.x()]
        after[:2, :2] = error.rotation().matrix()
        jacobians[0], jacobians[1] = before, after
    return np.array([error.x(), error.y(), error.theta()])


def charted(graph: Any) -> Any:
    """The same graph with bearslam's residual of motions."""
    import gtsam

    other = gtsam.NonlinearFactorGraph()
    for factor in map(graph.at, range(graph.size())):
        if isinstance(factor, gtsam.BetweenFactorPose2):
            delta, keys = factor.measured(), list(factor.keys())
            error = functools.partial(chart, np.array([delta.x(), delta.y(), delta.theta()]), keys)
            wrapped = functools.partial(lambda error, _, *rest: error(*rest), error)
            factor = gtsam.CustomFactor(factor.noiseModel(), keys, wrapped)
        other.add(factor)
    return other


def minimum(graph: Any, start: Any) -> tuple[Any, float, int]:
    """Levenberg-Marquardt until nothing changes: values, seconds, iterations."""
    import gtsam

    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setMaxIterations(200)
    parameters.setRelativeErrorTol(1e-12)
    parameters.setAbsoluteErrorTol(1e-12)
    optimizer = gtsam.LevenbergMarquardtOptimizer(graph, start, parameters)
    before = time.perf_counter()
    found = optimizer.optimize()
    return found, time.perf_counter() - before, optimizer.iterations()


def compare(result: bearslam.Reconstruction, cost: float) -> None:
    """Prints GTSAM's costs at a map, whose cost in bearslam is given, and at the minimum near it."""
    graph, values = result.to_gtsam()
    found, seconds, iterations = minimum(graph, values)
    print(
        f"  GTSAM, its own residual of motions: {graph.error(values):.4f} at the map, {graph.error(found):.4f} at its "
        f"minimum ({iterations} iterations, {seconds:.2f} s)"
    )
    graph = charted(graph)
    found, _, _ = minimum(graph, values)
    print(
        f"  GTSAM, ours: {graph.error(values):.6f} at the map, {graph.error(found):.6f} at its minimum; bearslam "
        f"{cost:.6f}: {graph.error(found) / cost - 1:+.1e}"
    )
