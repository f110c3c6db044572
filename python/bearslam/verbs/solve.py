# SPDX-License-Identifier: MIT OR Apache-2.0
"""Reconstruction of many views: from nothing, from a guess, or without the refinement."""

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

NO_FRAME = "odometry and priors leave free"
"""What a `DegenerateError` says of covariances in the frame "priors" when there is no such frame."""


def solve(
    problem: ProblemLike,
    *,
    sigma: ArrayLike = 1.0,
    loss: Loss = "squared",
    loss_scale: float | None = None,
    oriented: bool = True,
    odometry: Odometry | None = None,
    pose_priors: PosePriors | None = None,
    landmark_priors: LandmarkPriors | None = None,
    robust: bool = False,
    covariance: bool | CovarianceFrame = False,
    method: Method = "search",
    triples: int = 24,
    grown: int = 6,
    candidates: int = 6,
    swept: int = 4,
    max_iterations: int = 100,
    damping: float = 1e-4,
    tolerance: float = 1e-10,
    seed: int = 0,
    progress: Progress | None = None,
) -> Reconstruction:
    """Poses and landmarks from bearings, alone or with odometry and priors: no guess.

    The tensors of many triples of views are estimated; the best conditioned are grown to whole maps, linearly, by
    resection and triangulation; the best of these are refined until one is beyond doubt; the least cost is the answer.
    With odometry or priors a map is grown along them as well, and the answer is maximum a posteriori.

    Parameters
    ----------
    problem : (m, n) array_like of float, Sightings or Problem
        Bearings at which view i sees landmark j, in the frame of the view, counter-clockwise from its heading; NaN
        where it does not [rad]. Three views with five landmarks or four with four are the least.
    sigma : float or array_like of float
        Standard deviation of all bearings or of each, in the shape of the problem [rad]. Sightings may come with their
        own instead. With the default only the cost and the covariances have another scale; a loss other than "squared",
        odometry and priors weigh bearings against something, and need the true one, at most 0.5.
    loss : {"squared", "huber", "cauchy", "truncated"}
        How much a residual counts. "huber" lets outliers pull with a constant force, "cauchy" the less the farther out
        they are, "truncated" not at all. The first map is found without it: many outliers need `robust`. Odometry and
        priors count with their squares.
    robust : bool
        Whether to expect outliers: landmarks taken for others, bearings off by pi, random ones. The map is the one that
        explains most bearings to within three standard deviations, `inliers` says which. Needs the true `sigma`; `loss`
        does not matter then. Up to a third of the bearings may be wrong.
    loss_scale : float, optional
        Width of the loss [standard deviations]; by default 1.345 for "huber" and 2.385 for "cauchy", which keep 95 % of
        the efficiency of least squares, and 3 for "truncated".
    oriented : bool
        Whether bearings are rays. False for lines, known modulo pi only: headings are then known modulo pi as well,
        each for itself.
    odometry : Odometry, optional
        Measured motions between views. They know the scale. These and priors are by default those of the `Problem`.
    pose_priors : PosePriors, optional
        Poses known beforehand, or parts of them: a compass knows headings.
    landmark_priors : LandmarkPriors, optional
        Landmarks whose position is known beforehand.
    covariance : bool or {"first_view", "free_network", "priors"}
        Whether to compute the covariances of poses and landmarks, and in which frame. "first_view": what odometry and
        priors leave open is held as it is in the result, at the first view and the distance of the others from it.
        "free_network": of what they leave open, nothing moves on the whole; the covariance after the map has been laid
        over the truth by all its positions. "priors": they leave nothing open. True is "priors" if they do, and
        "first_view" otherwise.
    method : {"search", "calibrated", "projective", "incremental", "global"}
        "search" tries many triples. "calibrated" and "projective" are the path of the paper: they start from the first
        three views, with the tensor of that name (see `three_view`), and choose between its two solutions by a fourth.
        "incremental" grows maps view by view from several seeds, with refinement in between; "search" does the same
        under limited sight: more than 40 views, or eight and more that see less than 60 % of the landmarks. "global"
        takes all views at once: headings by rotation averaging, then one linear system for all positions.
    triples : int
        Triples of views whose tensor is estimated; "search" only.
    grown : int
        The best conditioned of them, so many, are grown to whole maps, both solutions of each; "search" only.
    candidates : int
        Most maps that are refined; fewer when the cost of one is what `sigma` lets expect, or two end in the same
        minimum. "search" only.
    swept : int
        When the candidates leave doubt, the tensors of so many triples are varied in the direction that the bearings
        hold least, and twice as many candidates follow; 0 for none. "search" only.
    max_iterations : int
        Steps of one refinement at most.
    damping : float
        First damping of Levenberg-Marquardt; 0 for Gauss-Newton.
    tolerance : float
        The refinement has converged when a step would lower the cost by less than this share of it.
    seed : int
        Where the draw of triples starts. The same seed gives the same bits.
    progress : callable, optional
        Called now and then as ``progress(stage, done, total)``. An exception raised in it stops the work.

    Returns
    -------
    Reconstruction
        The best map; others that explain the bearings nearly as well are its `alternatives`, maps of views that too
        few common landmarks tie to it its `components`.

    Raises
    ------
    InvalidInputError
        If an argument is out of range, a landmark is seen twice by a view, there are too few sightings, or `sigma` is
        no standard deviation where one is needed.
    DegenerateError
        If no part of the problem determines a map: landmarks along one wall seen by three views, views in one place,
        with `robust` no map that more bearings agree with than chance explains.
        Its `diagnosis` says what is wrong, and what to add. If covariances are asked for in the frame "priors", and
        odometry and priors leave something open.

    See Also
    --------
    initialize : the same without the refinement.
    diagnose : what the bearings determine, and why not.
    refine : the refinement alone.

    References
    ----------
    Dellaert and Stroupe, ICRA 2002; section 2.2 for odometry.

    Examples
    --------
    >>> import numpy as np
    >>> from bearslam import align, simulate, solve
    >>> scene = simulate("mixed", 4, 9, noise=0.0, seed=1)
    >>> result = solve(scene.bearings)
    >>> result.rms < 1e-9
    True
    >>> similarity = align(result.landmarks, scene.landmarks)
    >>> bool(np.allclose(similarity.apply_poses(result.poses), scene.poses, atol=1e-6))
    True

    Odometry knows the scale, and what is known to which accuracy can be asked:

    >>> noise = 0.01
    >>> scene = simulate("trajectory", 30, 20, noise=noise, seed=1, sight=2.0)
    >>> odometry = scene.odometry([0.01, 0.01, 0.01], seed=2)
    >>> result = solve(scene.bearings, sigma=noise, odometry=odometry, covariance=True)
    >>> result.covariance_frame, result.pose_covariance.shape
    ('first_view', (30, 3, 3))

    Two views never determine a map:

    >>> solve(scene.bearings[:2])
    Traceback (most recent call last):
    bearslam.errors.InvalidInputError: ...
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
    wanted = frame(covariance)
    how = search(
        method=method, triples=triples, grown=grown, candidates=candidates, swept=swept, seed=seed, robust=robust
    )
    refining = refinement(
        loss=loss, loss_scale=loss_scale, max_iterations=max_iterations, damping=damping, tolerance=tolerance
    )
    if how["robust"]:
        request.require_sigma("robust=True")
    try:
        raws = _core.solve(request.raw, how, refining, wanted, observer(progress))
    except DegenerateError as error:
        # With outliers no map tells about the geometry; where only the frame is none, the map is as good as it was.
        if not robust and NO_FRAME not in error.quantity:
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
    """Poses and landmarks by linear methods alone: a start for `refine`, or something to compare `solve` with.

    Parameters
    ----------
    problem, sigma, oriented, method, triples, grown, seed, progress
        As for `solve`. Odometry and priors of a `Problem` are not looked at.
    loss, loss_scale
        As for `solve`: how the maps are judged.

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
    """Nearest map of least cost, by Levenberg-Marquardt from a start.

    Parameters
    ----------
    problem, sigma, loss, loss_scale, oriented, odometry, pose_priors, landmark_priors, covariance
        As for `solve`.
    max_iterations, damping, tolerance, progress
        As for `solve`.
    start : Reconstruction, Scene or (poses, landmarks), optional
        Poses (m, 3) and landmarks (n, 2) to start at; NaN for what is to be left out. In any frame and scale without
        odometry and priors, in theirs otherwise. By default the start that a `Problem` comes with.

    Returns
    -------
    Reconstruction
        The minimum that was reached, in the gauge of every reconstruction.

    Raises
    ------
    InvalidInputError
        As for `solve`, or if the start has another size than the problem.
    DegenerateError
        If a view of the start stands on a landmark that it sees, or the map has more freedom than a similarity.

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
        raise InvalidInputError("start: expected a map to start at, for the problem comes with none; solve needs none")
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
