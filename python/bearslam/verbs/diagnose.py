# SPDX-License-Identifier: MIT OR Apache-2.0
"""Diagnosis: what bearings determine, what they do not, and why."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields, is_dataclass
from typing import Any, Literal, TypeAlias, cast

import numpy as np
from numpy.typing import ArrayLike

from bearslam import _core
from bearslam.data.checks import FloatArray, observer
from bearslam.data.estimate import Estimate, per_sighting
from bearslam.data.finding import Finding, findings
from bearslam.data.maps import MapLike, pick
from bearslam.data.priors import LandmarkPriors, Odometry, PosePriors
from bearslam.data.problem import ProblemLike
from bearslam.data.request import Request
from bearslam.progress import Progress

__all__ = ["Component", "Diagnosis", "Mover", "NullDirection", "diagnose", "diagnosed"]

Subject: TypeAlias = Literal["view", "landmark"]


@dataclass(frozen=True)
class Component:
    """A connected component of a problem: views and landmarks joined by sightings.

    Attributes
    ----------
    views, landmarks : tuple of int
        Indices of its views and landmarks.
    sightings : int
        Number of sightings between them.
    freedom : int
        Degrees of freedom: sightings minus unknowns, without the four of the gauge; negative if there are too few.
    """

    views: tuple[int, ...]
    landmarks: tuple[int, ...]
    sightings: int
    freedom: int


@dataclass(frozen=True)
class Mover:
    """A view or landmark that moves along a null direction.

    Attributes
    ----------
    kind : {"view", "landmark"}
        Whether it is a view or a landmark.
    index : int
        Its index.
    share : float
        Its share of the squared displacement.
    """

    kind: Literal["view", "landmark"]
    index: int
    share: float


@dataclass(frozen=True)
class NullDirection:
    """A direction in which the bearings constrain the map weakly or not at all.

    Attributes
    ----------
    free : bool
        Whether it is free, up to rounding; otherwise it is weak.
    singular_value : float
        Singular value of the Jacobian, relative to its median column; 0 if free.
    deviation : float
        Predicted standard deviation of the map along it, as a share of its size; infinite if free.
    movers : tuple of Mover
        Views and landmarks that move along it, largest displacement first.
    cause : str or None
        Name of the finding that explains it.
    """

    free: bool
    singular_value: float
    deviation: float
    movers: tuple[Mover, ...]
    cause: str | None


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis:
    """What bearings determine and what they do not. `str` gives a report of a few lines.

    Attributes
    ----------
    views, landmarks, sightings : int
        Numbers of views, landmarks and sightings.
    determined : bool
        Whether the bearings determine everything: no finding is an error.
    findings : tuple of Finding
        What is wrong, most severe first.
    components : tuple of Component
        Connected components, without views and landmarks with too few sightings; most sightings first.
    extra : int
        Free directions beyond position, rotation and scale of each component.
    null_directions : tuple of NullDirection
        Free and weak directions.
    singular_values : ndarray
        Up to eight smallest singular values of the Jacobian of the first component, relative to its median column,
        ascending, without those of position, rotation and scale; empty without a map.
    condition : float
        Largest singular value over the smallest nonzero one; NaN without a map.
    noise : float
        Assumed standard deviation of a bearing: as stated, or estimated from the residuals [rad].
    near_collinear : bool
        Whether there are three views, and they are collinear to within noise.
    mirror_margin : float
        Ratio of the residuals of the second best map, such as the mirror image of three views, to those of the best;
        infinite if none was found, NaN if none was sought.
    """

    views: int
    landmarks: int
    sightings: int
    determined: bool
    findings: tuple[Finding, ...]
    components: tuple[Component, ...]
    extra: int
    null_directions: tuple[NullDirection, ...]
    singular_values: FloatArray
    condition: float
    noise: float
    near_collinear: bool
    mirror_margin: float
    _text: str

    def __str__(self) -> str:
        return self._text

    def to_dict(self) -> dict[str, Any]:
        """Everything as numbers, strings, lists and dicts, for `json.dumps`; what is not a finite number is None.

        Examples
        --------
        >>> import json
        >>> import bearslam
        >>> scene = bearslam.simulate("mixed", 6, 9, noise=0.01, seed=7)
        >>> found = json.loads(json.dumps(bearslam.diagnose(scene.bearings, sigma=0.01).to_dict()))
        >>> found["determined"], found["components"][0]["freedom"]
        (True, 22)
        """
        members = {field.name: getattr(self, field.name) for field in fields(self) if not field.name.startswith("_")}
        return cast("dict[str, Any]", _plain(members))

    def __repr__(self) -> str:
        names = ", ".join(finding.name for finding in self.findings) or "no findings"
        return f"<Diagnosis: {'determined' if self.determined else 'not determined'}; {names}>"


def _plain(value: object) -> object:
    """A value in terms of JSON."""
    if is_dataclass(value) and not isinstance(value, type):
        return _plain(asdict(value))
    if isinstance(value, dict):
        return {name: _plain(member) for name, member in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(member) for member in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def diagnose(
    problem: ProblemLike,
    reconstruction: MapLike | None = None,
    *,
    sigma: ArrayLike | None = None,
    oriented: bool = True,
    odometry: Odometry | None = None,
    pose_priors: PosePriors | None = None,
    landmark_priors: LandmarkPriors | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find out what the bearings determine, what they do not, and why.

    Sightings are counted first. Then the singular values of the Jacobian at a map tell which directions are free or
    weak, and the geometry of the map why: landmarks along a wall, views in one place, everything on one circle, ...

    Parameters
    ----------
    problem : (m, n) array_like of float, Sightings or Problem
        As for `solve`.
    reconstruction : Reconstruction, Scene or (poses, landmarks), optional
        Map to examine; NaN for what it leaves out. Of a robust reconstruction the inliers alone are looked at. By
        default one that explains the bearings is computed, whether they determine it or not.
    sigma : float or array_like of float
        As for `solve`. Below 1 it is taken for the noise; otherwise the noise is estimated from the residuals.
    oriented, odometry, pose_priors, landmark_priors, progress
        As for `solve`.

    Returns
    -------
    Diagnosis
        Findings, most severe first, and the numbers behind them.

    Raises
    ------
    InvalidInputError
        If an argument is out of range, or the map is not of the size of the problem. Degenerate geometry is not an
        error here: it is what the diagnosis reports.

    See Also
    --------
    solve : raises `DegenerateError`, which carries a diagnosis.

    Examples
    --------
    >>> import numpy as np
    >>> from bearslam import diagnose, simulate
    >>> diagnose(simulate("mixed", 5, 9, noise=0.002, seed=1).bearings)
    <Diagnosis: determined; no findings>

    Landmarks along a wall, two units away:

    >>> views = np.array([[0.0, 0.0], [1.1, 0.6], [2.0, -0.4], [-1.2, 0.3], [-2.1, -0.2]])
    >>> wall = np.linspace(-3, 3, 8)
    >>> diagnosis = diagnose(np.arctan2(2.0 - views[:, 1:], wall - views[:, :1]))
    >>> diagnosis
    <Diagnosis: not determined; collinear_landmarks>
    >>> diagnosis.findings[0].advice
    'Add three sightings of a landmark off the line.'
    """
    request = Request(
        problem,
        sigma,
        loss="squared",
        oriented=oriented,
        odometry=odometry,
        pose_priors=pose_priors,
        landmark_priors=landmark_priors,
    )
    poses = points = None
    if reconstruction is not None:
        if isinstance(reconstruction, Estimate) and reconstruction.settings.has_outliers:
            request.keep(per_sighting(reconstruction, reconstruction.inliers))
        poses, points = pick("reconstruction", reconstruction, request.table.views, request.table.landmarks)
    return diagnosed(request, poses, points, progress)


def diagnosed(
    request: Request, poses: FloatArray | None, points: FloatArray | None, progress: Progress | None
) -> Diagnosis:
    """The diagnosis of a request, at a given map or at one that the core computes."""
    raw = _core.diagnose(request, poses, points, observer(progress))
    return Diagnosis(
        views=raw["views"],
        landmarks=raw["landmarks"],
        sightings=raw["sightings"],
        determined=raw["determined"],
        findings=findings(raw["findings"]),
        components=tuple(
            Component(tuple(one["views"]), tuple(one["landmarks"]), one["sightings"], one["freedom"])
            for one in raw["components"]
        ),
        extra=raw["extra"],
        null_directions=tuple(
            NullDirection(
                free=one["free"],
                singular_value=one["singular_value"],
                deviation=one["deviation"],
                movers=tuple(Mover(cast("Subject", kind), k, share) for kind, k, share in one["movers"]),
                cause=one["cause"],
            )
            for one in raw["null_directions"]
        ),
        singular_values=raw["singular_values"],
        condition=raw["condition"],
        noise=raw["noise"],
        near_collinear=raw["near_collinear"],
        mirror_margin=raw["mirror_margin"],
        _text=raw["text"],
    )
