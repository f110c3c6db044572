# SPDX-License-Identifier: MIT OR Apache-2.0
"""Options of solving: checked, and in the form in which the core takes them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, SupportsFloat, SupportsIndex, TypeAlias, get_args

import numpy as np

from bearslam.data.checks import SEED_LIMIT, choice, flag, quote, real, whole
from bearslam.errors import InvalidInputError

if TYPE_CHECKING:
    from bearslam._core import RawRefine, RawSearch

__all__ = ["FRAMES", "LOSSES", "METHODS", "CovarianceFrame", "Loss", "Method", "frame", "refinement", "search"]

Method: TypeAlias = Literal["search", "calibrated", "projective", "incremental", "global"]
METHODS: tuple[Method, ...] = get_args(Method)
Loss: TypeAlias = Literal["squared", "huber", "cauchy", "truncated"]
LOSSES: tuple[Loss, ...] = get_args(Loss)
CovarianceFrame: TypeAlias = Literal["first_view", "free_network", "priors"]
"""The gauge in which covariances are stated."""
FRAMES: tuple[CovarianceFrame, ...] = get_args(CovarianceFrame)


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
    """Options of the search for an initial map."""
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
    """Options of the refinement."""
    if loss_scale is not None and choice("loss", loss, LOSSES) == "squared":
        raise InvalidInputError(
            f"loss_scale: expected None, since the squared loss has no width, got {quote(loss_scale)}"
        )
    return {
        "max_iterations": whole("max_iterations", max_iterations, 1),
        "damping": real("damping", damping, 0.0),
        "tolerance": real("tolerance", tolerance, 0.0),
        "loss": choice("loss", loss, LOSSES),
        "loss_scale": None if loss_scale is None else real("loss_scale", loss_scale, 0.0, 1e6, above=True),
    }


def frame(covariance: bool | CovarianceFrame) -> str | None:
    """Name that the core has for the frame of the covariances; None for no covariances."""
    if isinstance(covariance, bool | np.bool_):
        return "fitting" if covariance else None
    if covariance not in FRAMES:
        known = ", ".join(map(repr, FRAMES))
        raise InvalidInputError(f"covariance: expected False, True or one of {known}, got {quote(covariance)}")
    return covariance
