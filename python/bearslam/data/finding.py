# SPDX-License-Identifier: MIT OR Apache-2.0
"""Findings: what is wrong with a problem or a map."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias, cast

if TYPE_CHECKING:
    from bearslam._core import RawFinding

__all__ = ["Finding", "Severity", "findings"]

Severity: TypeAlias = Literal["error", "warning", "note"]
"""Not determined; poorly determined, or contradicted; worth knowing."""


@dataclass(frozen=True)
class Finding:
    """One finding: what is wrong, which views and landmarks it concerns, and what to do about it.

    Attributes
    ----------
    name : str
        Name of the configuration, such as "collinear_landmarks"; the page on diagnosis lists them.
    severity : {"error", "warning", "note"}
        Whether something is not determined, poorly determined, or worth knowing.
    views, landmarks : tuple of int
        Indices of the views and landmarks it concerns.
    directions : int
        Number of free directions that it explains.
    message, advice : str
        What is wrong, and what to add.
    """

    name: str
    severity: Severity
    views: tuple[int, ...]
    landmarks: tuple[int, ...]
    directions: int
    message: str
    advice: str

    def __str__(self) -> str:
        return f"{self.severity} ({self.name}): {self.message} {self.advice}".rstrip()


def findings(raws: Iterable[RawFinding]) -> tuple[Finding, ...]:
    """Findings as the core tells them."""
    return tuple(
        Finding(
            name=one["name"],
            severity=cast("Severity", one["severity"]),
            views=tuple(one["views"]),
            landmarks=tuple(one["landmarks"]),
            directions=one["directions"],
            message=one["message"],
            advice=one["advice"],
        )
        for one in raws
    )
