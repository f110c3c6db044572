# SPDX-License-Identifier: MIT OR Apache-2.0
"""What bearings determine, what they do not, and why: by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias, cast

from numpy.typing import ArrayLike

from bearslam import _core
from bearslam.data.checks import FloatArray, observer
from bearslam.data.maps import MapLike, pick
from bearslam.data.priors import LandmarkPriors, Odometry, PosePriors
from bearslam.data.problem import ProblemLike
from bearslam.data.request import Request
from bearslam.progress import Progress

__all__ = ["Component", "Diagnosis", "Finding", "Mover", "NullDirection", "Severity", "diagnose", "diagnosed"]

Severity: TypeAlias = Literal["error", "warning", "note"]
"""Something is not determined; something is determined badly; something is worth knowing."""


@dataclass(frozen=True)
class Component:
    """A part of a problem that its sightings connect.

    Attributes
    ----------
    views, landmarks : tuple of int
        Its members.
    sightings : int
        How many there are between them.
    freedom : int
        Sightings less unknowns, but for the four of the gauge; negative when there are too few.
    """

    views: tuple[int, ...]
    landmarks: tuple[int, ...]
    sightings: int
    freedom: int


@dataclass(frozen=True)
class Mover:
    """A view or landmark that a direction moves.

    Attributes
    ----------
    kind : {"view", "landmark"}
        Which of the two.
    index : int
        Its number.
    share : float
        Its share of the squared moves.
    """

    kind: Literal["view", "landmark"]
    index: int
    share: float


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, whom it concerns, and what to do about it.

    Attributes
    ----------
    name : str
        What kind of thing, such as "collinear_landmarks"; the page on diagnosis has the list.
    severity : {"error", "warning", "note"}
        Whether something is not determined, is determined badly, or is worth knowing.
    views, landmarks : tuple of int
        Whom it concerns.
    directions : int
        Free directions that it explains.
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


@dataclass(frozen=True)
class NullDirection:
    """A direction of the map that the bearings hold weakly or not at all.

    Attributes
    ----------
    free : bool
        Whether it is free, up to rounding; else it is held weakly.
    singular_value : float
        Of the Jacobian, over its median column; 0 where free.
    deviation : float
        Predicted standard deviation of the map along it, as a share of its size; infinite where free.
    movers : tuple of Mover
        Who moves, the one that moves most first.
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
    """What bearings determine and what they do not. As `str` it is a report of a few lines.

    Attributes
    ----------
    views, landmarks, sightings : int
        How many there are.
    determined : bool
        Whether the bearings determine everything: no finding is an error.
    findings : tuple of Finding
        What is wrong, the worst first.
    components : tuple of Component
        Parts that sightings connect, without those who have too few; most sightings first.
    extra : int
        Directions that are free beyond place, rotation and scale of each part.
    null_directions : tuple of NullDirection
        Directions that are free or weak.
    singular_values : ndarray
        The smallest of the Jacobian of the first part, over its median column, ascending, up to eight, without place,
        rotation and scale of the whole; empty when no map was had.
    condition : float
        Largest singular value over the smallest that is not zero; NaN when no map was had.
    noise : float
        Standard deviation of a bearing that was reckoned with: the one stated, or the residuals' [rad].
    near_collinear : bool
        Whether there are three views, on one line or so near it that noise hides the difference.
    mirror_margin : float
        How many times larger the residuals of the next best map are, such as the mirror image of three views; infinite
        when none was found, NaN when none was looked for.
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

    def __repr__(self) -> str:
        names = ", ".join(finding.name for finding in self.findings) or "no findings"
        return f"<Diagnosis: {'determined' if self.determined else 'not determined'}; {names}>"


def diagnose(
    problem: ProblemLike,
    reconstruction: MapLike | None = None,
    *,
    sigma: ArrayLike = 1.0,
    oriented: bool = True,
    odometry: Odometry | None = None,
    pose_priors: PosePriors | None = None,
    landmark_priors: LandmarkPriors | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """What the bearings determine and what they do not, with names for the reasons.

    Sightings are counted first. Then the singular values of the Jacobian at a map tell which directions are free or
    weak, and shapes of the map why: landmarks along a wall, views in one place, everything on one circle and so on.

    Parameters
    ----------
    problem : (m, n) array_like of float, Sightings or Problem
        As for `solve`.
    reconstruction : Reconstruction, Scene or (poses, landmarks), optional
        The map to look at; NaN for what it leaves out. Without it one is made that explains the bearings, whether they
        determine it or not.
    sigma : float or array_like of float
        As for `solve`. Where it is below 1 it is the noise that is reckoned with, else the residuals tell.
    oriented, odometry, pose_priors, landmark_priors, progress
        As for `solve`.

    Returns
    -------
    Diagnosis
        Findings, the worst first, and the numbers behind them.

    Raises
    ------
    InvalidInputError
        If an argument is out of range, or the map has another size than the problem. Degenerate geometry is no error
        here: it is what the answer is about.

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
        poses, points = pick("reconstruction", reconstruction, request.table.views, request.table.landmarks)
    return diagnosed(request, poses, points, progress)


def diagnosed(
    request: Request, poses: FloatArray | None, points: FloatArray | None, progress: Progress | None
) -> Diagnosis:
    """The diagnosis of what is known, at a map or at one that is looked for."""
    raw = _core.diagnose(request.raw, poses, points, observer(progress))
    return Diagnosis(
        views=raw["views"],
        landmarks=raw["landmarks"],
        sightings=raw["sightings"],
        determined=raw["determined"],
        findings=tuple(
            Finding(name, cast("Severity", severity), tuple(views), tuple(landmarks), directions, message, advice)
            for name, severity, views, landmarks, directions, message, advice in raw["findings"]
        ),
        components=tuple(
            Component(tuple(views), tuple(landmarks), sightings, freedom)
            for views, landmarks, sightings, freedom in raw["components"]
        ),
        extra=raw["extra"],
        null_directions=tuple(
            NullDirection(
                free,
                value,
                deviation,
                tuple(Mover(cast("Literal['view', 'landmark']", kind), index, share) for kind, index, share in movers),
                cause,
            )
            for free, value, deviation, movers, cause in raw["null_directions"]
        ),
        singular_values=raw["singular_values"],
        condition=raw["condition"],
        noise=raw["noise"],
        near_collinear=raw["near_collinear"],
        mirror_margin=raw["mirror_margin"],
        _text=raw["text"],
    )
