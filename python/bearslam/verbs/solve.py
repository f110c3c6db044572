# SPDX-License-Identifier: MIT OR Apache-2.0
"""Reconstruction from many views: from scratch, from an initial map, or by linear methods alone."""

from __future__ import annotations

import warnings

from numpy.typing import ArrayLike

from bearslam import _core
from bearslam.data.checks import observer
from bearslam.data.doubts import doubts
from bearslam.data.maps import MapLike, pick
from bearslam.data.options import CovarianceFrame, Loss, Method, RefineOptions, SearchOptions, Settings, frame
from bearslam.data.priors import LandmarkPriors, Odometry, PosePriors
from bearslam.data.problem import Problem, ProblemLike
from bearslam.data.request import Request
from bearslam.errors import DegenerateError, InvalidInputError
from bearslam.progress import Progress
from bearslam.reconstruction import Reconstruction, best_with_alternatives, from_core
from bearslam.verbs.diagnose import diagnosed

__all__ = ["initialize", "refine", "solve"]

DEFAULT_SEARCH, DEFAULT_REFINEMENT = SearchOptions(), RefineOptions()
FREE_FRAME = "free_frame"
"""The kind of the `DegenerateError` that is raised when the frame "priors" does not exist."""


def solve(
    problem: ProblemLike,
    *,
    sigma: ArrayLike | None = None,
    loss: Loss = "squared",
    oriented: bool = True,
    odometry: Odometry | None = None,
    pose_priors: PosePriors | None = None,
    landmark_priors: LandmarkPriors | None = None,
    robust: bool = False,
    verify: bool = False,
    covariance: bool | CovarianceFrame = False,
    method: Method = "search",
    search: SearchOptions = DEFAULT_SEARCH,
    refinement: RefineOptions = DEFAULT_REFINEMENT,
    seed: int = 0,
    progress: Progress | None = None,
) -> Reconstruction:
    """Reconstruct poses and landmarks from bearings, with or without odometry and priors, with no initial guess.

    The trifocal tensors of many triples of views are estimated; the best conditioned are grown to whole maps, linearly,
    by resection and triangulation; the best of these are refined until one is beyond doubt, and the one of least cost
    is returned. With odometry or priors a map is grown along them as well, and the result is the maximum a posteriori
    estimate.

    Parameters
    ----------
    problem : (m, n) array_like of float, Sightings or Problem
        Bearings at which view i sees landmark j, in the frame of the view, counter-clockwise from its heading; NaN
        where it does not [rad]. At least three views with five landmarks, or four with four.
    sigma : float or array_like of float
        Standard deviation of all bearings or of each, in the shape of the problem [rad]; sightings may have their own
        instead. If None, all are taken for one radian, which affects only the scale of the cost and of the covariances,
        and the fit is not tested. A loss other than "squared", odometry and priors weigh bearings against something
        else and need the true value, at most 0.5.
    loss : {"squared", "huber", "cauchy", "truncated"}
        Loss applied to the residuals. The influence of an outlier is constant with "huber", decreases with its residual
        with "cauchy", and is zero with "truncated". The initial map is found without the loss: many outliers need
        `robust`. Odometry and priors always have a squared loss.
    robust : bool
        Whether to tolerate outliers: mismatched landmarks, bearings off by pi, random bearings. The map is the one that
        explains most bearings to within three standard deviations; `inliers` says which. Needs the true `sigma` and
        ignores `loss`. Up to a third of the bearings may be wrong.
    verify : bool
        Whether to verify the map: `certificate` tells what was shown. In every map of lower cost the trifocal tensor of
        three of the views is inside a cone, which is computed. If it is narrow enough, it is divided into cells, at
        most 0.1 wide in five coordinates of the unit tensor and at most 20,000, and the maps grown from the centre of
        each are refined. If one is lower, it becomes the result, and its own cone is searched. This is a rigorous
        bound on where lower maps are, and an exhaustive search there at a stated resolution. For the squared loss
        without `robust`.
    oriented : bool
        Whether bearings are rays. False for lines, which are known modulo pi only, and so are the headings then.
    odometry : Odometry, optional
        Measured motions between views, which determine the scale. Odometry and priors default to those of the
        `Problem`.
    pose_priors : PosePriors, optional
        Priors on poses, or on some of their coordinates, such as the headings of a compass.
    landmark_priors : LandmarkPriors, optional
        Priors on the positions of landmarks.
    covariance : bool or {"first_view", "free_network", "priors"}
        Whether to compute the covariances of poses and landmarks, and in which frame. "first_view": gauge freedom that
        odometry and priors leave is removed by holding the first view and the distance of the others from it.
        "free_network": it is removed by inner constraints, as if the map were aligned with the truth by all its
        positions. "priors": they leave no gauge freedom. True is "priors" if that holds, and "first_view" otherwise.
    method : {"search", "calibrated", "projective", "incremental", "global"}
        How to find the initial map. "search" tries many triples. "calibrated" and "projective" follow the paper: they
        start from the first three views, with the tensor of that name (see `three_view`), and choose between its two
        solutions by a fourth view. "incremental" grows maps view by view from several seeds, with refinement in
        between; "search" does the same under limited sight: with more than 40 views, or with eight or more that see
        less than 60 % of the landmarks. "global" takes all views at once: headings by rotation averaging, then one
        linear system for all positions.
    search : SearchOptions
        Width of the search; the method "search" only.
    refinement : RefineOptions
        How maps are refined, and the width of the loss.
    seed : int
        Seed of the random choice of triples. The same seed gives the same bits.
    progress : callable, optional
        Called from time to time as ``progress(stage, done, total)``. An exception raised in it stops the work.

    Returns
    -------
    Reconstruction
        The best map. Others that explain the bearings nearly as well are its `alternatives`; maps of views that share
        too few landmarks with it are its `components`.

    Warns
    -----
    PoorFitWarning
        If the residuals are larger than 1.5 times the stated `sigma` allows, or an observation contradicts the others:
        the `findings` of the result.
    NotConvergedWarning
        If the refinement has not ended in a minimum.
    AmbiguousWarning
        If there are `alternatives`.

    Raises
    ------
    InvalidInputError
        If an argument is out of range, a view sees a landmark twice, there are too few sightings, or `sigma` is not
        plausible where it is needed.
    DegenerateError
        If no part of the problem determines a map: landmarks along one wall seen by three views, views in one place, or
        with `robust` no map with more inliers than chance would give. Its `diagnosis`, a `Diagnosis`, says what is
        wrong and what to add. Also if covariances are requested in the frame "priors", but odometry and priors leave
        gauge freedom.

    See Also
    --------
    initialize : the same without the refinement.
    diagnose : what the bearings determine, what they do not, and why.
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

    Odometry determines the scale, and covariances tell the accuracy:

    >>> noise = 0.01
    >>> scene = simulate("trajectory", 30, 20, noise=noise, seed=1, sight=2.0)
    >>> odometry = scene.odometry([0.01, 0.01, 0.01], seed=2)
    >>> result = solve(scene.bearings, sigma=noise, odometry=odometry, covariance=True)
    >>> result.covariance_frame, result.pose_covariance.shape
    ('first_view', (30, 3, 3))

    Every map of lower cost than this one has the tensor of the same three views in a narrow cone, and no cell of the
    cone leads to one:

    >>> scene = simulate("mixed", 8, 10, noise=noise, seed=1)
    >>> solve(scene.bearings, sigma=noise, verify=True).certificate.verified
    True

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
    settings = Settings(method, search, loss, refinement, robust, seed, verify)
    if settings.robust:
        request.require_sigma("robust=True")
    try:
        raws = _core.solve(request, settings, wanted, observer(progress))
    except DegenerateError as error:
        # Outliers would mislead the diagnosis, and if only the frame does not exist, nothing is wrong with the map.
        if not robust and error.kind != FREE_FRAME:
            error.diagnosis = diagnosed(request, None, None, progress)
        raise
    return warned(best_with_alternatives(request, settings, raws))


def initialize(
    problem: ProblemLike,
    *,
    sigma: ArrayLike | None = None,
    loss: Loss = "squared",
    oriented: bool = True,
    method: Method = "search",
    search: SearchOptions = DEFAULT_SEARCH,
    refinement: RefineOptions = DEFAULT_REFINEMENT,
    seed: int = 0,
    progress: Progress | None = None,
) -> Reconstruction:
    """Reconstruct by linear methods alone: a start for `refine`, or a baseline for `solve`.

    Parameters
    ----------
    problem, sigma, oriented, method, search, seed, progress
        As for `solve`. Odometry and priors of a `Problem` are ignored.
    loss, refinement
        As for `solve`; the loss and its width are used to compare the maps.

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
    settings = Settings(method, search, loss, refinement, seed=seed)
    raws = _core.initialize(request, settings, observer(progress))
    return best_with_alternatives(request, settings, raws)


def refine(
    problem: ProblemLike,
    start: MapLike | None = None,
    *,
    sigma: ArrayLike | None = None,
    loss: Loss = "squared",
    oriented: bool = True,
    odometry: Odometry | None = None,
    pose_priors: PosePriors | None = None,
    landmark_priors: LandmarkPriors | None = None,
    covariance: bool | CovarianceFrame = False,
    refinement: RefineOptions = DEFAULT_REFINEMENT,
    progress: Progress | None = None,
) -> Reconstruction:
    """Refine a map to the nearest minimum of the cost, by Levenberg-Marquardt.

    Parameters
    ----------
    problem, sigma, loss, oriented, odometry, pose_priors, landmark_priors, covariance, refinement, progress
        As for `solve`.
    start : Reconstruction, Scene or (poses, landmarks), optional
        Initial poses (m, 3) and landmarks (n, 2); NaN for what to leave out. In any frame and scale without odometry
        and priors, in theirs otherwise. By default the start of the `Problem`.

    Returns
    -------
    Reconstruction
        The minimum, in the gauge of every reconstruction.

    Warns
    -----
    PoorFitWarning, NotConvergedWarning
        As for `solve`.

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
    settings = Settings(loss=loss, refinement=refinement)
    raw = _core.refine(request, settings, guess.poses, guess.landmarks, frame(covariance), observer(progress))
    return warned(from_core(request, settings, raw))


def warned(result: Reconstruction) -> Reconstruction:
    """The result, with a warning for each reason to doubt it, at the caller of the caller."""
    for category, message in doubts(result):
        warnings.warn(message, category, stacklevel=3)
    return result
