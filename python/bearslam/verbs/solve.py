# SPDX-License-Identifier: MIT OR Apache-2.0
"""Reconstruction from many views: from scratch, from an initial map, or by linear methods alone."""

from __future__ import annotations

from numpy.typing import ArrayLike

from bearslam import _core
from bearslam.data.checks import observer
from bearslam.data.maps import MapLike, pick
from bearslam.data.options import CovarianceFrame, Loss, Method, frame, refinement, search
from bearslam.data.priors import LandmarkPriors, Odometry, PosePriors
from bearslam.data.problem import Problem, ProblemLike
from bearslam.data.request import Request
from bearslam.errors import DegenerateError, InvalidInputError
from bearslam.progress import Progress
from bearslam.reconstruction import Reconstruction, best_with_alternatives, from_core
from bearslam.verbs.diagnose import diagnosed

__all__ = ["initialize", "refine", "solve"]

        # Outliers would mislead the diagnosis, and if only the frame does not exist, nothing is wrong with the map.
        if not robust and error.kind != FREE_FRAME:
            error.diagnosis = diagnosed(request, None, None, progress)
        raise
    return best_with_alternatives(request, raws)


def initialize(
    problem: ProblemLike,
    *,
    sigma: ArrayLike = 1.0,
    loss: Loss = "squared",
    loss_scale: float | None = None,
    oriented: bool = True,
    method: Method = "search",
    triples: int = 24,
    grown: int = 6,
    seed: int = 0,
    progress: Progress | None = None,
) -> Reconstruction:
    """Reconstruct by linear methods alone: a start for `refine`, or a baseline for `solve`.

    Parameters
    ----------
    problem, sigma, oriented, method, triples, grown, seed, progress
        As for `solve`. Odometry and priors of a `Problem` are ignored.
    loss, loss_scale
        As for `solve`; used to compare the maps.

    Returns
    -------
    Reconstruction
        The best map before any refinement, and its `alternatives`.

    Raises
    ------
    InvalidInputError, DegenerateError
        As for `solve`.

    References
    ----------
    Dellaert and Stroupe, ICRA 2002.

    Examples
    --------
    >>> from bearslam import initialize, simulate, solve
    >>> scene = simulate("enclosed", 4, 9, noise=0.01, seed=1)
    >>> linear = initialize(scene.bearings, method="projective")
    >>> linear.cost > solve(scene.bearings).cost
    True
    """
    bearings = problem.bearings_only() if isinstance(problem, Problem) else problem
    request = Request(bearings, sigma, loss=loss, oriented=oriented)
    raws = _core.initialize(
        request.raw,
        search(method=method, triples=triples, grown=grown, seed=seed),
        refinement(loss=loss, loss_scale=loss_scale),
        observer(progress),
    )
    return best_with_alternatives(request, raws)


def refine(
    problem: ProblemLike,
    start: MapLike | None = None,
    *,
    sigma: ArrayLike = 1.0,
    loss: Loss = "squared",
    loss_scale: float | None = None,
    oriented: bool = True,
    odometry: Odometry | None = None,
    pose_priors: PosePriors | None = None,
    landmark_priors: LandmarkPriors | None = None,
    covariance: bool | CovarianceFrame = False,
    max_iterations: int = 100,
    damping: float = 1e-4,
    tolerance: float = 1e-10,
    progress: Progress | None = None,
) -> Reconstruction:
    """Refine a map to the nearest minimum of the cost, by Levenberg-Marquardt.

    Parameters
    ----------
    problem, sigma, loss, loss_scale, oriented, odometry, pose_priors, landmark_priors, covariance
        As for `solve`.
    max_iterations, damping, tolerance, progress
        As for `solve`.
    start : Reconstruction, Scene or (poses, landmarks), optional
        Initial poses (m, 3) and landmarks (n, 2); NaN for what to leave out. In any frame and scale without odometry
        and priors, in theirs otherwise. By default the start of the `Problem`.

    Returns
    -------
    Reconstruction
        The minimum, in the gauge of every reconstruction.

    Raises
    ------
    InvalidInputError
        As for `solve`, or if the start is not of the size of the problem.
    DegenerateError
        If a view of the start coincides with a landmark that it sees, or more than the gauge is free.

    References
    ----------
    Dellaert and Stroupe, ICRA 2002.

    Examples
    --------
    >>> from bearslam import refine, simulate
    >>> scene = simulate("mixed", 6, 12, noise=0.01, seed=1)
    >>> result = refine(scene.bearings, scene)
    >>> result.converged
    True
    """
    request = Request(
        problem,
        sigma,
        loss=loss,
        oriented=oriented,
        odometry=odometry,
        pose_priors=pose_priors,
        landmark_priors=landmark_priors,
    )
    if start is None:
        start = problem.start if isinstance(problem, Problem) else None
    if start is None:
        raise InvalidInputError("start: expected an initial map, since the problem has none; solve needs none")
    guess = pick("start", start, request.table.views, request.table.landmarks)
    raw = _core.refine(
        request.raw,
        guess.poses,
        guess.landmarks,
        refinement(
            loss=loss, loss_scale=loss_scale, max_iterations=max_iterations, damping=damping, tolerance=tolerance
        ),
        frame(covariance),
        observer(progress),
    )
    return from_core(request, raw)
