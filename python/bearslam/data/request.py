# SPDX-License-Identifier: MIT OR Apache-2.0
"""Problems and options on their way into the core, reconstructions on their way out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, SupportsFloat, SupportsIndex, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from bearslam.data.checks import SEED_LIMIT, choice, quote, real, whole
from bearslam.data.priors import LandmarkPriors, Odometry, PosePriors
from bearslam.data.problem import GAPS, Problem, ProblemLike, Table, tabulate
from bearslam.errors import InvalidInputError
from bearslam.reconstruction import FRAMES, CovarianceFrame, Reconstruction, Termination, Undetermined

if TYPE_CHECKING:
    from bearslam._core import RawProblem, RawReconstruction, RawRefine, RawSearch

__all__ = ["LOSSES", "METHODS", "Known", "flag", "frame", "ranked", "refinement", "search", "wrapped"]

METHODS = ("search", "calibrated", "projective", "incremental", "global")
LOSSES = ("squared", "huber", "cauchy", "truncated")
LARGEST_SIGMA = 0.5
"""Standard deviation above which a bearing says next to nothing [rad]: whoever states it has left it at its default."""

T = TypeVar("T")


class Known:
    """All that is known: sightings, odometry, priors, and the form in which they came."""

    def __init__(
        self,
        problem: ProblemLike,
        sigma: ArrayLike,
        *,
        loss: str,
        oriented: bool,
        odometry: Odometry | None = None,
        pose_priors: PosePriors | None = None,
        landmark_priors: LandmarkPriors | None = None,
    ) -> None:
        motions = _instance("odometry", odometry, Odometry)
        poses = _instance("pose_priors", pose_priors, PosePriors)
        points = _instance("landmark_priors", landmark_priors, LandmarkPriors)
        if isinstance(problem, Problem):
            motions = problem.odometry if motions is None else motions
            poses = problem.known_poses() if poses is None else poses
            points = problem.known_landmarks() if points is None else points
        self.odometry, self.pose_priors, self.landmark_priors = motions, poses, points
        views = [] if motions is None else [motions.start, motions.end]
        views += [] if poses is None else [poses.view]
        landmarks = [] if points is None else [points.landmark]
        self.table: Table = tabulate(
            problem,
            sigma,
            views=max((int(index.max(initial=-1)) + 1 for index in views), default=0),
            landmarks=max((int(index.max(initial=-1)) + 1 for index in landmarks), default=0),
        )
        entries = len(self.table.sightings) + sum(map(len, [*views, *landmarks]))
        if max(self.table.views, self.table.landmarks) > GAPS * entries:
            raise InvalidInputError(
                f"sightings: expected indices that leave few numbers out, got {self.table.views} views and "
                f"{self.table.landmarks} landmarks in {entries} sightings, motions and priors"
            )
        if choice("loss", loss, LOSSES) != "squared":
            self.require_sigma(f"loss={loss!r}")
        for name, given in (("odometry", motions), ("pose_priors", poses), ("landmark_priors", points)):
            if given is not None:
                self.require_sigma(name)
        self.raw: RawProblem = {
            "views": self.table.views,
            "landmarks": self.table.landmarks,
            "view": self.table.sightings.view,
            "landmark": self.table.sightings.landmark,
            "bearing": self.table.sightings.bearing,
            "sigma": self.table.sigma,
            "oriented": flag("oriented", oriented),
            "odometry": None if motions is None else (motions.start, motions.end, motions.delta, motions.sigma),
            "pose_priors": None if poses is None else (poses.view, poses.pose, poses.sigma),
            "landmark_priors": None if points is None else (points.landmark, points.position, points.sigma),
        }

    def require_sigma(self, what: str) -> None:
        """Refuse standard deviations that are none: what weighs bearings against something needs real ones."""
        sigma = self.table.sigma
        if (sigma > LARGEST_SIGMA).any():
            raise InvalidInputError(
                f"sigma: expected the standard deviation of a bearing in radians, at most {LARGEST_SIGMA:g}, which "
                f"{what} needs; got {sigma.max():g}"
            )


def search(
    *,
    method: str,
    triples: SupportsIndex,
    grown: SupportsIndex,
    seed: SupportsIndex,
    candidates: SupportsIndex = 1,
    swept: SupportsIndex = 0,
    robust: bool = False,
) -> RawSearch:
    """How a first map is found."""
    return {
        "method": choice("method", method, METHODS),
        "triples": whole("triples", triples, 1),
        "grown": whole("grown", grown, 1),
        "candidates": whole("candidates", candidates, 1),
        "swept": whole("swept", swept, 0),
        "seed": whole("seed", seed, 0, SEED_LIMIT),
        "robust": flag("robust", robust),
    }


def refinement(
    *,
    loss: str,
    loss_scale: SupportsFloat | None,
    max_iterations: SupportsIndex = 100,
    damping: SupportsFloat = 1e-4,
    tolerance: SupportsFloat = 1e-10,
) -> RawRefine:
    """How it is refined."""
    if loss_scale is not None and choice("loss", loss, LOSSES) == "squared":
        raise InvalidInputError(f"loss_scale: expected None, for squares have no width, got {quote(loss_scale)}")
    return {
        "max_iterations": whole("max_iterations", max_iterations, 1),
        "damping": real("damping", damping, 0.0),
        "tolerance": real("tolerance", tolerance, 0.0),
        "loss": choice("loss", loss, LOSSES),
        "loss_scale": None if loss_scale is None else real("loss_scale", loss_scale, 0.0, 1e6, above=True),
    }


def frame(covariance: bool | CovarianceFrame) -> str | None:
    """The frame of the covariances as the core calls it, None for no covariances."""
    if isinstance(covariance, bool | np.bool_):
        return "fitting" if covariance else None
    if covariance not in FRAMES:
        known = ", ".join(map(repr, FRAMES))
        raise InvalidInputError(f"covariance: expected False, True or one of {known}, got {quote(covariance)}")
    return covariance


def flag(name: str, value: bool) -> bool:
    """True or False, and nothing that passes for it."""
    if not isinstance(value, bool | np.bool_):
        raise InvalidInputError(f"{name}: expected True or False, got {quote(value)}")
    return bool(value)


def ranked(known: Known, raws: Sequence[RawReconstruction]) -> Reconstruction:
    """The winner, with its alternatives."""
    winner, *others = raws
    return wrapped(known, winner, tuple(wrapped(known, other) for other in others))


def wrapped(known: Known, raw: RawReconstruction, alternatives: tuple[Reconstruction, ...] = ()) -> Reconstruction:
    """A reconstruction in the form of the problem."""
    table = known.table
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
        inliers=table.restore(raw["inliers"], False),
        undetermined=tuple(
            Undetermined(cast("Literal['view', 'landmark']", kind), index, reason)
            for kind, index, reason in raw["undetermined"]
        ),
        alternatives=alternatives,
        components=tuple(wrapped(known, other) for other in raw["components"]),
        pose_covariance=raw["pose_covariance"],
        landmark_covariance=raw["landmark_covariance"],
        covariance_frame=cast("CovarianceFrame | None", raw["covariance_frame"]),
        oriented=known.raw["oriented"],
        odometry=known.odometry,
        pose_priors=known.pose_priors,
        landmark_priors=known.landmark_priors,
        view_ids=table.view_ids,
        landmark_ids=table.landmark_ids,
    )


def _instance(name: str, value: T | None, kind: type[T]) -> T | None:
    if value is not None and not isinstance(value, kind):
        raise InvalidInputError(f"{name}: expected None or {kind.__name__}, got {type(value).__name__}")
    return value
