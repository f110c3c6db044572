# SPDX-License-Identifier: MIT OR Apache-2.0
"""The formats of maps: everything as JSON, poses and landmarks as CSV."""

from __future__ import annotations

import math
from collections.abc import Sequence
from json import dumps

from bearslam.data.checks import FloatArray
from bearslam.data.maps import HasMap
from bearslam.io.sightings_csv import row
from bearslam.reconstruction import Reconstruction, per_sighting

__all__ = ["as_csv", "as_json", "truth_as_json"]

Ids = Sequence[str] | None


def as_csv(source: HasMap, view_ids: Ids = None, landmark_ids: Ids = None) -> str:
    """Lines of kind, id, x, y and theta [rad]; a landmark has no theta, and what is undetermined is nan."""
    lines = [row("kind", "id", "x", "y", "theta")]
    for i, (x, y, theta) in enumerate(source.poses.tolist()):
        lines.append(row("view", str(_id(view_ids, i)), repr(x), repr(y), repr(theta)))
    for j, (x, y) in enumerate(source.landmarks.tolist()):
        lines.append(row("landmark", str(_id(landmark_ids, j)), repr(x), repr(y), ""))
    return "".join(lines)


def as_json(result: Reconstruction) -> str:
    """The whole reconstruction; null for what is undetermined, or without bounds. Angles are radians."""
    seen = result.sightings
    sigma = seen.sigma
    return _object(
        {
            "format": "bearslam reconstruction",
            "version": 1,
            **_summary(result),
            "oriented": result.oriented,
            "covariance_frame": result.covariance_frame,
            **_map(result, result.view_ids, result.landmark_ids, result.pose_covariance, result.landmark_covariance),
            "undetermined": [
                {
                    "kind": one.kind,
                    "id": _id(result.view_ids if one.kind == "view" else result.landmark_ids, one.index),
                    "reason": one.reason,
                }
                for one in result.undetermined
            ],
            "sightings": {
                "view": [_id(result.view_ids, i) for i in seen.view.tolist()],
                "landmark": [_id(result.landmark_ids, j) for j in seen.landmark.tolist()],
                "bearing": _numbers(seen.bearing),
                "sigma": None if sigma is None else _numbers(sigma),
                "residual": _numbers(per_sighting(result, result.residuals)),
                "inlier": per_sighting(result, result.inliers).tolist(),
            },
            **{
                name: [{**_summary(other), **_map(other, result.view_ids, result.landmark_ids)} for other in others]
                for name, others in (("alternatives", result.alternatives), ("components", result.components))
            },
        }
    )


def truth_as_json(source: HasMap) -> str:
    """Poses and landmarks alone, as JSON."""
    return _object({"format": "bearslam map", "version": 1, **_map(source, None, None)})


def _summary(result: Reconstruction) -> dict[str, object]:
    return {
        "cost": _number(result.cost),
        "rms": _number(result.rms),
        "sensitivity": _number(result.sensitivity),
        "uncertainty": _number(result.uncertainty),
        "converged": result.converged,
        "termination": result.termination,
        "iterations": result.iterations,
    }


def _map(
    source: HasMap,
    view_ids: Ids,
    landmark_ids: Ids,
    pose_covariance: FloatArray | None = None,
    landmark_covariance: FloatArray | None = None,
) -> dict[str, object]:
    return {
        "views": [
            {
                "id": _id(view_ids, i),
                **dict(zip(("x", "y", "theta"), _numbers(pose), strict=True)),
                **_covariance(pose_covariance, i),
            }
            for i, pose in enumerate(source.poses)
        ],
        "landmarks": [
            {
                "id": _id(landmark_ids, j),
                **dict(zip(("x", "y"), _numbers(point), strict=True)),
                **_covariance(landmark_covariance, j),
            }
            for j, point in enumerate(source.landmarks)
        ],
    }


def _covariance(covariances: FloatArray | None, index: int) -> dict[str, object]:
    return {} if covariances is None else {"covariance": [_numbers(row) for row in covariances[index]]}


def _id(ids: Ids, index: int) -> str | int:
    return index if ids is None else ids[index]


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _numbers(values: FloatArray) -> list[float | None]:
    return [_number(value) for value in values.tolist()]


def _object(members: dict[str, object]) -> str:
    """JSON with a line for each member, and for each row of a list of rows."""
    return "{\n" + ",\n".join(f"  {dumps(name)}: {_value(value)}" for name, value in members.items()) + "\n}\n"


def _value(value: object) -> str:
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "[\n" + ",\n".join(f"    {dumps(one, allow_nan=False)}" for one in value) + "\n  ]"
    return dumps(value, allow_nan=False)
