# SPDX-License-Identifier: MIT OR Apache-2.0
"""A reconstruction: an estimate that can plot itself, save itself, and hand itself over to other programs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from bearslam import _core
from bearslam.data.certificate import certificate_from_core
from bearslam.data.checks import FloatArray
from bearslam.data.estimate import Estimate, Termination, Undetermined, per_sighting
from bearslam.data.finding import findings
from bearslam.data.maps import MapLike
from bearslam.data.options import CovarianceFrame, Settings
from bearslam.data.request import Request
from bearslam.io import files, gtsam

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from bearslam._core import RawReconstruction

__all__ = ["Observations", "Reconstruction", "best_with_alternatives", "from_core"]


@dataclass(frozen=True, eq=False)
class Observations:
    """A number for each observation of a problem.

    Attributes
    ----------
    sightings : (m, n) or (k,) ndarray
        In the shape of the problem; NaN where nothing was seen.
    odometry, pose_priors, landmark_priors : (k,) ndarray
        In their order; empty where there are none.
    """

    sightings: FloatArray
    odometry: FloatArray
    pose_priors: FloatArray
    landmark_priors: FloatArray


@dataclass(frozen=True, eq=False, repr=False)
class Reconstruction(Estimate):
    """A map, and how well it explains the bearings.

    `plot` draws it, `save` writes it to a file, and `to_gtsam` hands it over to GTSAM.

    Attributes
    ----------
    poses, landmarks
        The map.
    sightings, residuals, inliers, cost, rms, freedom, explained
        How well it explains the bearings.
    sigma0, p_value, findings, redundancy, standardized_residuals
        Whether the residuals are what the standard deviations predict.
    expected_error, sensitivity, uncertainty, worst, pose_covariance, landmark_covariance, covariance_frame
        How well the bearings determine it.
    converged, termination, iterations
        How the refinement ended.
    certificate
        Whether a map of lower cost is excluded, with ``verify=True``.
    undetermined, alternatives, components
        What it leaves out, and other maps.
    oriented, odometry, pose_priors, landmark_priors, view_ids, landmark_ids, settings
        What it was made from, and how.

    See Also
    --------
    bearslam.data.estimate.Estimate : the same attributes, each with its shape and unit.
    """

    alternatives: tuple[Reconstruction, ...] = ()
    components: tuple[Reconstruction, ...] = ()

    @cached_property
    def redundancy(self) -> Observations:
        """The share of an error of each observation that its residual shows: 0 where nothing checks it, 1 where the map
        does not depend on it. Of a motion or a prior the mean over its numbers. NaN of outliers, and of what the map
        does not contain. Computed when it is first read.
        """
        return self._checked[0]

    @cached_property
    def standardized_residuals(self) -> Observations:
        """Residuals over their own standard deviations, r / (sigma sqrt(redundancy)): standard normal where the
        standard deviations are right (Baarda's w-test). Of a motion or a prior the value without sign that a normal
        variable exceeds as rarely as it. NaN where nothing checks the observation. Computed when it is first read.
        """
        return self._checked[1]

    @cached_property
    def expected_error(self) -> float:
        """Predicted root-mean-square error of the landmarks once the map is aligned with the truth, as a share of their
        root-mean-square distance from their centroid, for the standard deviations stated, or those that the residuals
        have if they are larger. Computed when it is first read.
        """
        return _core.expected_error(*self._in_core, self.sigma0)

    @property
    def _in_core(self) -> tuple[Request, FloatArray, FloatArray, NDArray[np.bool_]]:
        """The problem, the map and its inliers as the core reads them."""
        request = Request(
            self.sightings,
            None,
            loss="squared",
            oriented=self.oriented,
            odometry=self.odometry,
            pose_priors=self.pose_priors,
            landmark_priors=self.landmark_priors,
        )
        request.views, request.landmarks = len(self.poses), len(self.landmarks)
        return request, self.poses, self.landmarks, per_sighting(self, self.inliers)

    @cached_property
    def _checked(self) -> tuple[Observations, Observations]:
        raw = _core.redundancy(*self._in_core)
        both = []
        for which in (0, 1):
            sightings = raw["sightings"][which]
            if self.residuals.ndim == 2:
                table = np.full(self.residuals.shape, np.nan)
                table[self.sightings.view, self.sightings.landmark] = sightings
                sightings = table
            others = (raw[kind][which] for kind in ("odometry", "pose_priors", "landmark_priors"))
            both.append(Observations(sightings, *others))
        return both[0], both[1]

    def plot(self, ax: Axes | None = None, truth: MapLike | None = None) -> Axes:
        """Draw the map: views as triangles that point along their headings, landmarks, and the bearings as rays.

        Positions with covariances have ellipses that cover 95 % of a Gaussian distribution. Outliers among the bearings
        are dashed. More than 60 views joined by odometry are drawn as lines, one for each robot, with a triangle at
        intervals; most of the bearings and of the ellipses of views, which would hide such a map, are left out, and
        the legend says so.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw into; by default those of a new figure.
        truth : Scene, Reconstruction or (poses, landmarks), optional
            Truth to draw as well; the map is aligned with it by a similarity.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn into.

        Raises
        ------
        ImportError
            If matplotlib is not installed (``pip install "bearslam[plot]"``).
        """
        from bearslam.plotting.map import plot

        return plot(self, ax, truth)

    def view(self, path: str | os.PathLike[str] | None = None, truth: MapLike | None = None) -> None:
        """Open the map in the viewer of Rerun, or write it to a recording that the viewer opens.

        Trajectories, named landmarks and outliers are static. What each view sees is shown along a timeline of the
        views. The y axis of the viewer points down, so that -y is recorded to keep the map upright.

        Writing a recording opens no connection. The viewer is a separate program, which sends usage statistics to its
        makers unless ``rerun analytics disable`` has been called once.

        Parameters
        ----------
        path : str or path-like, optional
            Recording to write, `.rrd`; an existing file is replaced in one step. By default the viewer is opened.
        truth : Scene, Reconstruction or (poses, landmarks), optional
            Truth to show as well, in grey; the map is aligned with it by a similarity.

        Raises
        ------
        ImportError
            If rerun-sdk is not installed (``pip install "bearslam[viewer]"``).
        InvalidInputError
            If the name does not end in `.rrd`.
        OSError
            If the recording cannot be written, or the viewer cannot be opened, for example without a screen.
        """
        from bearslam.plotting.viewer import view

        view(self, path, truth)

    def save(self, path: str | os.PathLike[str], *, robot: str | int | None = None) -> None:
        """Write the map to a file: `.json` keeps everything, `.csv` the poses and landmarks, `.g2o` these and the
        measurements, for other programs, and `.tum` the trajectory of a robot.

        An existing file is replaced in one step and never left half written.

        Parameters
        ----------
        path : str or path
            File to write.
        robot : str or int, optional
            For `.tum`: the robot whose views to write, if the names of views, ``robot@time``, are of several robots.

        Raises
        ------
        InvalidInputError
            If the name has another ending, or a trajectory needs a robot.
        OSError
            If the file cannot be written.
        """
        files.save(self, path, robot=robot)

    def to_gtsam(self) -> tuple[Any, Any]:
        """Hand the map over to GTSAM as factors and initial values, ready to be optimised.

        Views have the keys ``symbol("x", i)`` and landmarks ``symbol("l", j)``, where i and j are rows of `poses` and
        `landmarks`. Undetermined views and landmarks are left out together with their measurements, and so are
        outliers.

        - A sighting is a ``BearingFactor2D``. A bearing that is a line becomes the ray towards the landmark.
        - A motion is a ``BetweenFactorPose2``. The Python wheels of GTSAM take the logarithm of its error, bearslam its
          x, y and theta; the two agree to first order in theta.
        - A prior on a pose is a ``PoseTranslationPrior2D`` and a ``PoseRotationPrior2D`` on the known coordinates, or
          with a covariance a ``PriorFactorPose2``, which agrees to first order. A prior on a landmark is a
          ``PriorFactorPoint2``.
        - Position, rotation and scale that these leave free are held at their values: by priors on the first view, and
          for the scale by a range from it to the farthest view. They are tight, 1e-4 rad and 1e-4 of the size of the
          map, and have zero cost at the map, so that the optimum does not change.

        Factors have squared errors, whatever the loss was.

        Returns
        -------
        gtsam.NonlinearFactorGraph, gtsam.Values
            The factors, and the map as initial values.

        Raises
        ------
        ImportError
            If GTSAM is not installed (``pip install gtsam``).
        """
        return gtsam.to_gtsam(self)


def best_with_alternatives(request: Request, settings: Settings, raws: Sequence[RawReconstruction]) -> Reconstruction:
    """The best of several maps, with the others as its alternatives."""
    winner, *others = raws
    return from_core(request, settings, winner, tuple(from_core(request, settings, other) for other in others))


def from_core(
    request: Request, settings: Settings, raw: RawReconstruction, alternatives: tuple[Reconstruction, ...] = ()
) -> Reconstruction:
    """The answer of the core in the shape of the problem."""
    table = request.table
    return Reconstruction(
        poses=raw["poses"],
        landmarks=raw["landmarks"],
        sightings=table.sightings,
        residuals=table.restore(raw["residuals"]),
        cost=raw["cost"],
        rms=raw["rms"],
        sensitivity=raw["sensitivity"],
        uncertainty=raw["uncertainty"],
        worst=cast("tuple[Literal['view', 'landmark'], int] | None", raw["worst"]),
        sigma0=raw["sigma0"],
        p_value=raw["p_value"],
        findings=findings(raw["findings"]),
        converged=raw["converged"],
        termination=cast("Termination", raw["termination"]),
        iterations=raw["iterations"],
        freedom=raw["freedom"],
        explained=raw["explained"],
        inliers=table.restore(raw["inliers"], False),
        undetermined=tuple(
            Undetermined(cast("Literal['view', 'landmark']", kind), index, reason)
            for kind, index, reason in raw["undetermined"]
        ),
        alternatives=alternatives,
        components=tuple(from_core(request, settings, other) for other in raw["components"]),
        pose_covariance=raw["pose_covariance"],
        landmark_covariance=raw["landmark_covariance"],
        covariance_frame=cast("CovarianceFrame | None", raw["covariance_frame"]),
        certificate=certificate_from_core(raw["certificate"]),
        oriented=request.oriented,
        odometry=request.odometry,
        pose_priors=request.pose_priors,
        landmark_priors=request.landmark_priors,
        view_ids=table.view_ids,
        landmark_ids=table.landmark_ids,
        settings=settings,
    )
