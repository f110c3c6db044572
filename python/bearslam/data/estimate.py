# SPDX-License-Identifier: MIT OR Apache-2.0
"""Estimates: poses and landmarks, and how well they explain the bearings."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from bearslam.data.certificate import Certificate
from bearslam.data.checks import FloatArray
from bearslam.data.finding import Finding
from bearslam.data.options import CovarianceFrame, Settings
from bearslam.data.priors import LandmarkPriors, Odometry, PosePriors
from bearslam.data.sightings import Sightings

__all__ = ["Estimate", "Termination", "Undetermined", "outliers", "per_sighting"]

Entry = TypeVar("Entry", bound=np.generic)

Termination: TypeAlias = Literal[
    "not_refined", "converged", "zero_residual", "no_progress", "max_iterations", "overshot", "singular"
]
"""Why a refinement ended. The second to fourth are minima: the last step lowered the cost by less than the tolerance,
the residuals are zero, or no step lowers the cost."""


@dataclass(frozen=True)
class Undetermined:
    """A view or landmark that the measurements do not determine.

    Attributes
    ----------
    kind : {"view", "landmark"}
        Which of the two.
    index : int
        Its row in `Reconstruction.poses` or `Reconstruction.landmarks`, which is NaN.
    reason : str
        What is missing to determine it.
    """

    kind: Literal["view", "landmark"]
    index: int
    reason: str


@dataclass(frozen=True, eq=False, repr=False)
class Estimate:
    """A map, and how well it explains the bearings.

    Attributes
    ----------
    poses : (m, 3) ndarray
        Position and heading (x, y, theta) of each view, heading in (-pi, pi]; NaN where undetermined. From bearings
        alone, the first determined view is at the origin with heading 0, and the root-mean-square distance of the other
        views from it is 1 [that distance, rad]. Odometry or two known positions determine the scale, a known heading or
        two known positions the rotation, and a known position the translation; the gauge freedom that they leave is
        removed as for bearings alone. Where only one coordinate of positions is known, as on a lane, the first
        determined view is at 0 along the other.
    landmarks : (n, 2) ndarray
        Positions in the same frame; NaN where undetermined.
    sightings : Sightings
        The sightings of the problem, each with its standard deviation, in the order of `residuals`; those of an (m, n)
        array row by row.
    residuals : (m, n) or (k,) ndarray
        Predicted minus measured bearing, in (-pi, pi], or (-pi/2, pi/2] of bearings that are not oriented, in the shape
        of the problem; NaN where nothing was seen or nothing can be predicted [rad].
    cost : float
        Half the sum of the losses of the bearings, each of the residual over its standard deviation, and of the squared
        weighted residuals of odometry and priors. With ``robust=True`` a bearing adds at most 9 to that sum, the square
        of three standard deviations.
    rms : float
        Root mean square of the residuals, with ``robust=True`` of the inliers [rad].
    sensitivity : float
        Predicted standard deviation of the map, as a share of its size, in the least constrained direction, for
        residuals of one standard deviation. NaN where it was not computed: for alternatives and by `initialize`.
    uncertainty : float
        The same for the noise estimated from the residuals. Be careful above 0.2; near 1 and above, the bearings do not
        determine the map, however well it explains them. It is evaluated at the map: where noise was mistaken for
        parallax, as with landmarks along a wall, it is too small. NaN without degrees of freedom to estimate the noise
        from.
    worst : (str, int), or None
        The view or landmark that moves most in that direction, such as ("view", 17). One view that is badly held makes
        a map uncertain whose rest may be well known; `expected_error` says how well. None where the sensitivity was not
        computed.
    sigma0 : float
        A-posteriori standard deviation of unit weight: root mean square of the residuals over their standard
        deviations, per degree of freedom; 1 where the stated standard deviations are right. With ``robust=True`` and
        ``loss="truncated"`` of the inliers, made up for the tails that are cut off. NaN without degrees of freedom.
    p_value : float
        Probability that errors of the stated standard deviations leave residuals as large as these (chi-square test).
        NaN without degrees of freedom, without a stated `sigma`, and with the losses "huber" and "cauchy".
    findings : tuple of Finding
        What the test of the fit says: "poor_fit", "blunder", "turned_bearings", "mirrored_bearings" and
        "weak_consensus" are warnings, "understated_sigma" and "overstated_sigma" notes. Empty for alternatives, before
        refinement, and without a stated `sigma`.
    converged : bool
        Whether the refinement ended in a minimum. False without a refinement.
    termination : str
        Why the refinement ended: "converged" (a further step would lower the cost by less than the tolerance),
        "zero_residual", "no_progress" (no step lowers the cost), all three minima; "max_iterations",
        "overshot" (a full step of Gauss-Newton raises the cost), "singular"; "not_refined" where there was none.
    iterations : int
        Iterations of the refinement.
    freedom : int
        Degrees of freedom (redundancy): numbers measured (bearings of inliers, odometry and priors) minus unknowns,
        not counting gauge freedom.
    explained : int or None
        With ``robust=True`` the number of bearings within three standard deviations once their identities are assigned
        anew, view by view. Wrong maps explain few of them: a map that leaves many outliers and explains less than 80 %
        has the warning "weak_consensus".
    inliers : (m, n) or (k,) ndarray of bool
        Sightings that the map explains, in the shape of the problem: all with a residual, or with ``robust=True`` those
        within three standard deviations, with ``loss="truncated"`` those within its width. False where nothing was seen
        or nothing can be predicted.
    undetermined : tuple of Undetermined
        The views and landmarks that are NaN, with the reason.
    alternatives : tuple of Estimate
        Other maps that explain the bearings nearly as well, such as the mirror solution, best first.
    components : tuple of Estimate
        Maps of views that share too few landmarks with this one: largest first, each in a gauge of its own, NaN outside
        its views and landmarks. A landmark may be in several. What is `undetermined` is in none.
    pose_covariance : (m, 3, 3) ndarray, or None
        Covariance of each pose (x, y, theta), in the axes of the map, for the standard deviations that the problem
        states, to first order [squares of the units of `poses`]. An unconstrained coordinate has an infinite variance,
        and NaN covariances with the others; all is NaN where the pose is. None unless requested, and for alternatives
        and components.
    landmark_covariance : (n, 2, 2) ndarray, or None
        The same for each landmark (x, y).
    covariance_frame : {"first_view", "free_network", "priors"}, or None
        Gauge in which the covariances are stated, without which they mean nothing; see `solve`.
    certificate : Certificate, or None
        What the verification has shown. None without ``verify=True``, and for alternatives and components.
    oriented : bool
        Whether bearings were taken as rays. If False they are lines, and each heading is known modulo pi only: it is
        given in (-pi/2, pi/2], unless odometry or priors resolve it.
    odometry : Odometry, or None
    pose_priors : PosePriors, or None
    landmark_priors : LandmarkPriors, or None
        Measurements besides the sightings.
    view_ids, landmark_ids : tuple of str, or None
        Names of views and landmarks in the file that the problem was read from.
    settings : Settings
        How it was found: method, search, loss, refinement, robust, seed and verify.
    """

    poses: FloatArray
    landmarks: FloatArray
    sightings: Sightings
    residuals: FloatArray
    cost: float
    rms: float
    sensitivity: float
    uncertainty: float
    sigma0: float
    p_value: float
    converged: bool
    termination: Termination
    iterations: int
    freedom: int
    explained: int | None
    inliers: NDArray[np.bool_]
    worst: tuple[Literal["view", "landmark"], int] | None = None
    undetermined: tuple[Undetermined, ...] = ()
    findings: tuple[Finding, ...] = ()
    alternatives: tuple[Estimate, ...] = ()
    components: tuple[Estimate, ...] = ()
    pose_covariance: FloatArray | None = None
    landmark_covariance: FloatArray | None = None
    covariance_frame: CovarianceFrame | None = None
    certificate: Certificate | None = None
    oriented: bool = True
    odometry: Odometry | None = None
    pose_priors: PosePriors | None = None
    landmark_priors: LandmarkPriors | None = None
    view_ids: tuple[str, ...] | None = None
    landmark_ids: tuple[str, ...] | None = None
    settings: Settings = field(default_factory=Settings)

    def __repr__(self) -> str:
        missing = f", {len(self.undetermined)} undetermined" if self.undetermined else ""
        return (
            f"<{type(self).__name__}: {len(self.poses)} views, {len(self.landmarks)} landmarks{missing}, "
            f"rms {self.rms:.3g} rad, {self.termination}>"
        )


def per_sighting(result: Estimate, values: NDArray[Entry]) -> NDArray[Entry]:
    """Values in the shape of the problem as one for each of its sightings."""
    return values[result.sightings.view, result.sightings.landmark] if values.ndim == 2 else values


def outliers(result: Estimate) -> NDArray[np.bool_]:
    """Whether each sighting is an outlier: predicted by the map, but not explained."""
    residuals, inliers = per_sighting(result, result.residuals), per_sighting(result, result.inliers)
    wrong: NDArray[np.bool_] = np.isfinite(residuals) & ~inliers
    return wrong
