# SPDX-License-Identifier: MIT OR Apache-2.0
"""Options of solving, checked where they are made."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias, get_args

import numpy as np

from bearslam.data.checks import SEED_LIMIT, choice, flag, instance, quote, real, whole
from bearslam.errors import InvalidInputError

__all__ = [
    "FRAMES",
    "LOSSES",
    "METHODS",
    "CovarianceFrame",
    "Loss",
    "Method",
    "RefineOptions",
    "SearchOptions",
    "Settings",
    "frame",
]

Method: TypeAlias = Literal["search", "calibrated", "projective", "incremental", "global"]
METHODS: tuple[Method, ...] = get_args(Method)
Loss: TypeAlias = Literal["squared", "huber", "cauchy", "truncated"]
LOSSES: tuple[Loss, ...] = get_args(Loss)
CovarianceFrame: TypeAlias = Literal["first_view", "free_network", "priors"]
"""The gauge in which covariances are stated."""
FRAMES: tuple[CovarianceFrame, ...] = get_args(CovarianceFrame)


@dataclass(frozen=True)
class SearchOptions:
    """Width of the search for an initial map; the method "search" only.

    Attributes
    ----------
    triples : int
        Number of triples of views whose tensor is estimated.
    grown : int
        Number of these, best conditioned first, that are grown to whole maps, both solutions of each.
    candidates : int
        Largest number of maps that are refined; fewer if the cost of one is what `sigma` predicts, or two end in the
        same minimum.
    swept : int
        Number of triples whose tensors are varied in their least determined direction if the candidates leave doubt;
        twice as many candidates follow. 0 for none.

    Raises
    ------
    InvalidInputError
        If a number is not an integer, or out of range.

    Examples
    --------
    A wider search, for scenes with few landmarks and much noise:

    >>> from bearslam import SearchOptions, simulate, solve
    >>> scene = simulate("mixed", 4, 6, noise=0.02, seed=1)
    >>> solve(scene.bearings, sigma=0.02, search=SearchOptions(grown=12, candidates=24)).converged
    True
    """

    triples: int = 24
    grown: int = 6
    candidates: int = 6
    swept: int = 4

    def __post_init__(self) -> None:
        for name, low in (("triples", 1), ("grown", 1), ("candidates", 1), ("swept", 0)):
            object.__setattr__(self, name, whole(name, getattr(self, name), low))


@dataclass(frozen=True)
class RefineOptions:
    """How a map is refined, by Levenberg-Marquardt.

    Attributes
    ----------
    max_iterations : int
        Largest number of iterations of one refinement.
    damping : float
        Initial damping, relative to the diagonal of the normal equations, at most 1e8; 0 for Gauss-Newton.
    tolerance : float
        Relative decrease of the cost below which the refinement has converged.
    loss_scale : float or None
        Width of the loss [standard deviations], from 1e-6 to 1e6; by default 1.345 for "huber" and 2.385 for "cauchy",
        which keep 95 % of the efficiency of least squares for Gaussian errors, and 3 for "truncated". The squared loss
        has no width.

    Raises
    ------
    InvalidInputError
        If a number is not finite, or out of range.

    Examples
    --------
    >>> from bearslam import RefineOptions, refine, simulate
    >>> scene = simulate("mixed", 6, 12, noise=0.01, seed=1)
    >>> refine(scene.bearings, scene, refinement=RefineOptions(max_iterations=1)).termination
    'max_iterations'
    """

    max_iterations: int = 1000
    damping: float = 1e-4
    tolerance: float = 1e-10
    loss_scale: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "max_iterations", whole("max_iterations", self.max_iterations, 1))
        object.__setattr__(self, "damping", real("damping", self.damping, 0.0))
        object.__setattr__(self, "tolerance", real("tolerance", self.tolerance, 0.0))
        if self.loss_scale is not None:
            object.__setattr__(self, "loss_scale", real("loss_scale", self.loss_scale, 1e-6, 1e6))


@dataclass(frozen=True)
class Settings:
    """How a map was found and refined: the options of `solve`, checked, as the core reads them."""

    method: Method = "search"
    search: SearchOptions = field(default_factory=SearchOptions)
    loss: Loss = "squared"
    refinement: RefineOptions = field(default_factory=RefineOptions)
    robust: bool = False
    seed: int = 0
    verify: bool = False

    def __post_init__(self) -> None:
        choice("method", self.method, METHODS)
        choice("loss", self.loss, LOSSES)
        instance("search", self.search, SearchOptions)
        instance("refinement", self.refinement, RefineOptions)
        if self.loss == "squared" and self.refinement.loss_scale is not None:
            raise InvalidInputError(
                "loss_scale: expected None, since the squared loss has no width, got "
                f"{quote(self.refinement.loss_scale)}"
            )
        object.__setattr__(self, "robust", flag("robust", self.robust))
        object.__setattr__(self, "verify", flag("verify", self.verify))
        if self.verify and (self.robust or self.loss != "squared"):
            rival = "robust=True" if self.robust else f"loss={self.loss!r}"
            raise InvalidInputError(
                f"verify: expected False with {rival}, since the bound is one of the squared residuals of all bearings"
            )
        object.__setattr__(self, "seed", whole("seed", self.seed, 0, SEED_LIMIT))

    @property
    def has_outliers(self) -> bool:
        """Whether sightings may be outliers, which the map is not estimated from."""
        return self.robust or self.loss == "truncated"


def frame(covariance: bool | CovarianceFrame) -> str | None:
    """The core's name for the frame of the covariances; None for no covariances."""
    if isinstance(covariance, bool | np.bool_):
        return "fitting" if covariance else None
    if covariance not in FRAMES:
        known = ", ".join(map(repr, FRAMES))
        raise InvalidInputError(f"covariance: expected False, True or one of {known}, got {quote(covariance)}")
    return covariance
