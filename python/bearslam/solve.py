# SPDX-License-Identifier: MIT OR Apache-2.0
"""Reconstruction of many views: from nothing, from a guess, or without the refinement."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, TypeAlias, cast

from numpy.typing import ArrayLike

from bearslam import _core
from bearslam.coerce import Progress, choice, observer, real, whole
from bearslam.diagnose import diagnose
from bearslam.errors import DegenerateError
from bearslam.maps import MapLike, pick
from bearslam.problem import ProblemLike, Table, tabulate
from bearslam.reconstruction import Reconstruction, Termination, Undetermined

if TYPE_CHECKING:
    from bearslam._core import RawReconstruction

__all__ = ["METHODS", "Method", "initialize", "refine", "solve"]

Method: TypeAlias = Literal["search", "calibrated", "projective", "incremental", "global"]
METHODS = ("search", "calibrated", "projective", "incremental", "global")


def solve(
    problem: ProblemLike,
    *,
    sigma: ArrayLike = 1.0,
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
    """Poses and landmarks from bearings alone: no odometry, no guess.

    The tensors of many triples of views are estimated; the best conditioned are grown to whole maps, linearly, by
    resection and triangulation; the best of these are refined until one is beyond doubt; the least cost is the answer.

    Parameters
    ----------
    problem : (m, n) array_like of float, Sightings or Problem
        Bearings at which view i sees landmark j, in the frame of the view, counter-clockwise from its heading; NaN
        where it does not [rad]. Three views with five landmarks or four with four are the least.
    sigma : float or array_like of float
        Standard deviation of all bearings or of each, in the shape of the problem [rad]. Sightings may come with their
        own instead.
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
        If an argument is out of range, a landmark is seen twice by a view, or there are too few sightings.
    DegenerateError
        If no part of the problem determines a map: landmarks along one wall seen by three views, views in one place.
        Its `diagnosis` says what is wrong, and what to add.

    See Also
    --------
    initialize : the same without the refinement.
    diagnose : what the bearings determine, and why not.
    refine : the refinement alone.

    References
    ----------
    Dellaert and Stroupe, ICRA 2002.

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

    Two views never determine a map:

    >>> solve(scene.bearings[:2])
    Traceback (most recent call last):
    bearslam.errors.InvalidInputError: ...
    """
    table = tabulate(problem, sigma)
    try:
        raws = _core.solve(
            table.views,
            table.landmarks,
            table.sightings.view,
            table.sightings.landmark,
            table.sightings.bearing,
            table.sigma,
            method=choice("method", method, METHODS),
            triples=whole("triples", triples, 1),
            grown=whole("grown", grown, 1),
            candidates=whole("candidates", candidates, 1),
            swept=whole("swept", swept, 0),
            max_iterations=whole("max_iterations", max_iterations, 1),
            damping=real("damping", damping, 0.0),
            tolerance=real("tolerance", tolerance, 0.0),
            seed=whole("seed", seed, 0),
            progress=observer(progress),
        )
    except DegenerateError as error:
        error.diagnosis = diagnose(problem, sigma=sigma, progress=progress)
        raise
    return _ranked(table, raws)


def initialize(
    problem: ProblemLike,
    *,
    sigma: ArrayLike = 1.0,
    method: Method = "search",
    triples: int = 24,
    grown: int = 6,
    seed: int = 0,
    progress: Progress | None = None,
) -> Reconstruction:
    """Poses and landmarks by linear methods alone: a start for `refine`, or something to compare `solve` with.

    Parameters
    ----------
    problem, sigma, method, triples, grown, seed, progress
        As for `solve`.

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
    table = tabulate(problem, sigma)
    raws = _core.initialize(
        table.views,
        table.landmarks,
        table.sightings.view,
        table.sightings.landmark,
        table.sightings.bearing,
        table.sigma,
        method=choice("method", method, METHODS),
        triples=whole("triples", triples, 1),
        grown=whole("grown", grown, 1),
        seed=whole("seed", seed, 0),
        progress=observer(progress),
    )
    return _ranked(table, raws)


def refine(
    problem: ProblemLike,
    start: MapLike,
    *,
    sigma: ArrayLike = 1.0,
    max_iterations: int = 100,
    damping: float = 1e-4,
    tolerance: float = 1e-10,
    progress: Progress | None = None,
) -> Reconstruction:
    """Nearest map of least squared bearing residuals, by Levenberg-Marquardt from a start.

    Parameters
    ----------
    problem, sigma, max_iterations, damping, tolerance, progress
        As for `solve`.
    start : Reconstruction, Scene or (poses, landmarks)
        Poses (m, 3) and landmarks (n, 2) to start at, in any frame and scale; NaN for what is to be left out.

    Returns
    -------
    Reconstruction
        The minimum that was reached, in the gauge of every reconstruction (the first view at the origin).

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
    table = tabulate(problem, sigma)
    guess = pick("start", start, table.views, table.landmarks)
    raw = _core.refine(
        table.views,
        table.landmarks,
        table.sightings.view,
        table.sightings.landmark,
        table.sightings.bearing,
        table.sigma,
        guess.poses,
        guess.landmarks,
        max_iterations=whole("max_iterations", max_iterations, 1),
        damping=real("damping", damping, 0.0),
        tolerance=real("tolerance", tolerance, 0.0),
        progress=observer(progress),
    )
    return _wrapped(table, raw, ())


def _ranked(table: Table, raws: Sequence[RawReconstruction]) -> Reconstruction:
    winner, *others = raws
    return _wrapped(table, winner, tuple(_wrapped(table, other, ()) for other in others))


def _wrapped(table: Table, raw: RawReconstruction, alternatives: tuple[Reconstruction, ...]) -> Reconstruction:
    return Reconstruction(
        poses=raw["poses"],
        landmarks=raw["landmarks"],
        sightings=table.sightings,
        residuals=table.restore(raw["residuals"]),
        cost=raw["cost"],
        rms=raw["rms"],
        sensitivity=raw["sensitivity"],
        uncertainty=raw["uncertainty"],
        converged=raw["converged"],
        termination=cast("Termination", raw["termination"]),
        iterations=raw["iterations"],
        undetermined=tuple(
            Undetermined(cast("Literal['view', 'landmark']", kind), index, reason)
            for kind, index, reason in raw["undetermined"]
        ),
        alternatives=alternatives,
        components=tuple(_wrapped(table, other, ()) for other in raw["components"]),
        view_ids=table.view_ids,
        landmark_ids=table.landmark_ids,
    )
