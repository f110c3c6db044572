# SPDX-License-Identifier: MIT OR Apache-2.0
"""Certificates: what the verification of a map has shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bearslam._core import RawCertificate

__all__ = ["Certificate", "certificate_from_core"]


@dataclass(frozen=True)
class Certificate:
    """What the verification of a map has shown: where the maps of lower cost can be, and that a search found none.

    The trifocal tensor of three of the views is inside a cone in every map of lower cost; that is proved. The cone is
    divided into cells of a stated width, and the maps grown from the centre of each cell are refined. That none of
    them is lower is an exhaustive search at this resolution, no proof.

    Attributes
    ----------
    views : tuple of int, or None
        The three views. None where the verification ended before any were chosen.
    cone : float
        Half the largest opening angle of the cone of unit tensors [rad]: 0 if the bound alone excludes any lower map,
        NaN without a cone.
    cells : int
        Number of cells that were searched; each is at most 0.1 wide in five coordinates of the unit tensor.
    verified : bool
        Whether the bound alone excludes a map of lower cost, or the search of all cells found none.
    message : str
        The same as a sentence; if the map is not verified, why.
    """

    views: tuple[int, int, int] | None
    cone: float
    cells: int
    verified: bool
    message: str

    def __str__(self) -> str:
        return self.message


def certificate_from_core(raw: RawCertificate | None) -> Certificate | None:
    """The certificate as the core states it."""
    if raw is None:
        return None
    views = raw["views"]
    if views is not None:
        first, second, third = views
    return Certificate(
        None if views is None else (first, second, third), raw["cone"], raw["cells"], raw["verified"], raw["message"]
    )
