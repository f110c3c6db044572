# SPDX-License-Identifier: MIT OR Apache-2.0
"""Results as text for people: degrees instead of radians."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np

from bearslam.data.estimate import Estimate, outliers, per_sighting
from bearslam.data.maps import Map, compare
from bearslam.io.text import printable

__all__ = ["SHOWN", "columns", "describe", "errors", "listing", "name", "percent"]

SHOWN = 20
"""Rows of a listing that are printed; files have all of them."""
FRAME = {
    "first_view": "the first view held fixed",
    "free_network": "inner constraints",
    "priors": "fixed by odometry and priors",
}
"""Frames of covariances in words."""


def describe(result: Estimate) -> str:
    """A few lines on the size of the problem, the fit, and what is not determined."""
    views, landmarks = len(result.poses), len(result.landmarks)
    lines = [
        f"{views} views, {landmarks} landmarks, {len(result.sightings)} sightings",
        f"residual rms {math.degrees(result.rms):.4g} deg, cost {result.cost:.6g}, "
        f"{'converged' if result.converged else 'not converged'} after {result.iterations} iterations "
        f"({result.termination.replace('_', ' ')})",
    ]
    if not math.isnan(result.p_value):
        lines.append(f"sigma0 {result.sigma0:.3g}, p {result.p_value:.2g}, {result.freedom} degrees of freedom")
    if not math.isnan(result.uncertainty):
        most = "" if result.worst is None else f", of {name(result, *result.worst)} most"
        share = percent(result.uncertainty)
        lines.append(f"uncertainty {share} of the map's size in the least constrained direction{most}")
    elif not math.isnan(result.sensitivity):
        lines.append("uncertainty unknown: without redundant sightings the residuals say nothing about the errors")
    if result.covariance_frame is not None:
        lines.append(f"covariances in the frame {result.covariance_frame} ({FRAME[result.covariance_frame]})")
    if result.certificate is not None:
        lines.append(str(result.certificate))
    if not result.oriented:
        lines.append("bearings are lines: every heading is known modulo 180 deg only")
    lines += _outliers(result)
    for one in result.undetermined[:SHOWN]:
        lines.append(f"undetermined: {name(result, one.kind, one.index)}: {one.reason}")
    if len(result.undetermined) > SHOWN:
        lines.append(f"undetermined: ... and {len(result.undetermined) - SHOWN} more")
    lines += [
        f"alternative: residual rms {math.degrees(other.rms):.4g} deg, cost {other.cost:.6g}"
        for other in result.alternatives
    ]
    lines += [
        f"separate map: {np.isfinite(other.poses[:, 0]).sum()} views, "
        f"{np.isfinite(other.landmarks[:, 0]).sum()} landmarks, residual rms {math.degrees(other.rms):.4g} deg"
        for other in result.components
    ]
    return "\n".join(lines)


def _outliers(result: Estimate) -> list[str]:
    """Sightings that the map does not explain."""
    wrong = np.flatnonzero(outliers(result))
    if len(wrong) == 0:
        return []
    seen, degrees = result.sightings, np.degrees(per_sighting(result, result.residuals))
    views, landmarks = result.view_ids or range(len(result.poses)), result.landmark_ids or range(len(result.landmarks))
    lines = [f"{len(wrong)} outlier{'s' if len(wrong) > 1 else ''} among the bearings:"]
    lines += [
        f"  view {printable(views[seen.view[k]])} of landmark {printable(landmarks[seen.landmark[k]])}: "
        f"{degrees[k]:.4g} deg off"
        for k in wrong[:SHOWN].tolist()
    ]
    return lines if len(wrong) <= SHOWN else [*lines, f"  ... and {len(wrong) - SHOWN} more"]


def name(result: Estimate, kind: Literal["view", "landmark"], index: int) -> str:
    """A view or landmark as its file calls it."""
    ids = result.view_ids if kind == "view" else result.landmark_ids
    return f"{kind} {printable(index if ids is None else ids[index])}"


def errors(result: Estimate, truth: Map) -> str:
    """Errors of a map after alignment with the truth, on one line."""
    found = compare(result, truth)
    parts = []
    known = np.isfinite(result.landmarks + truth.landmarks).all(axis=1).sum()
    if known:
        share = f" ({percent(found.landmark / found.radius)} of the radius of the map)" if found.radius > 0 else ""
        parts.append(f"{known} landmarks {found.landmark:.4g} rms{share}")
    places = np.isfinite(result.poses[:, :2] + truth.poses[:, :2]).all(axis=1).sum()
    if places:
        parts.append(f"{places} positions {found.position:.4g} rms")
    if not math.isnan(found.heading):
        parts.append(f"headings {math.degrees(found.heading):.4g} deg rms")
    return f"errors after alignment with the truth: {', '.join(parts)}"


def listing(result: Estimate) -> str:
    """The map as a table: views, then landmarks."""
    views = result.view_ids or range(len(result.poses))
    landmarks = result.landmark_ids or range(len(result.landmarks))
    degrees = np.column_stack([result.poses[:, :2], np.degrees(result.poses[:, 2])])
    return "\n\n".join(
        (
            _table(("view", "x", "y", "heading [deg]"), views, degrees.tolist()),
            _table(("landmark", "x", "y"), landmarks, result.landmarks.tolist()),
        )
    )


def columns(rows: Iterable[Sequence[str]]) -> str:
    """Rows of text as a table: the first column to the left, the others to the right."""
    table = [tuple(row) for row in rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = []
    for first, *others in table:
        cells = [cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True)]
        lines.append("  ".join([first.ljust(widths[0]), *cells]).rstrip())
    return "\n".join(lines)


def percent(share: float) -> str:
    """A share in percent, to two significant digits."""
    return f"{100 * share:.2g} %" if share < 1 else f"{100 * share:.0f} %"


def _table(head: Sequence[str], names: Sequence[object], values: Sequence[Sequence[float]]) -> str:
    rows = [(printable(name), *(f"{value:.4f}" for value in row)) for name, row in zip(names, values, strict=True)]
    text = columns([head, *rows[:SHOWN]])
    return text if len(rows) <= SHOWN else f"{text}\n... and {len(rows) - SHOWN} more"
