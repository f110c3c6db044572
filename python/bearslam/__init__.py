# SPDX-License-Identifier: MIT OR Apache-2.0
"""Planar structure and motion from bearings alone.

Poses of robots and positions of landmarks from nothing but the angles at which the robots see the landmarks, with no
initial guess; odometry and priors are used where there are any. A pose is (x, y, theta); a bearing is measured in the
frame of the robot, counter-clockwise from its heading; all angles are in radians. Bearings do not determine position,
rotation and scale of the whole map: unless odometry or priors do, the first view is at the origin with heading 0, and
the root-mean-square distance of the other views from it is 1.

>>> import bearslam
>>> scene = bearslam.simulate("mixed", 4, 9, noise=0.01, seed=1)
>>> bearslam.solve(scene.bearings).converged
True
"""

from bearslam._core import __version__
from bearslam.data.align import Similarity, align
from bearslam.data.certificate import Certificate
from bearslam.data.estimate import Undetermined
from bearslam.data.finding import Finding
from bearslam.data.fix import Fix
from bearslam.data.options import RefineOptions, SearchOptions
from bearslam.data.priors import LandmarkPriors, Odometry, PosePriors
from bearslam.data.problem import Problem
from bearslam.data.sightings import Offsets, Sightings
from bearslam.errors import (
    AmbiguousWarning,
    BearslamError,
    BearslamWarning,
    DegenerateError,
    ExecutorError,
    InvalidInputError,
    NotConvergedWarning,
    PoorFitWarning,
)
from bearslam.io.files import load, save
from bearslam.io.truth import load_truth
from bearslam.montecarlo.sweep_result import SweepResult
from bearslam.reconstruction import Reconstruction
from bearslam.verbs.diagnose import Diagnosis, NullDirection, diagnose
from bearslam.verbs.relabel import LabelChange, relabel
from bearslam.verbs.resect import resect
from bearslam.verbs.simulate import Scene, simulate
from bearslam.verbs.solve import initialize, refine, solve
from bearslam.verbs.sweep import sweep
from bearslam.verbs.three_view import (
    ThreeViewBatch,
    ThreeViewSolution,
    epipoles,
    three_view,
    three_view_batch,
    trifocal_tensor,
)
from bearslam.verbs.triangulate import triangulate

__all__ = [
    "AmbiguousWarning",
    "BearslamError",
    "BearslamWarning",
    "Certificate",
    "DegenerateError",
    "Diagnosis",
    "ExecutorError",
    "Finding",
    "Fix",
    "InvalidInputError",
    "LabelChange",
    "LandmarkPriors",
    "NotConvergedWarning",
    "NullDirection",
    "Odometry",
    "Offsets",
    "PoorFitWarning",
    "PosePriors",
    "Problem",
    "Reconstruction",
    "RefineOptions",
    "Scene",
    "SearchOptions",
    "Sightings",
    "Similarity",
    "SweepResult",
    "ThreeViewBatch",
    "ThreeViewSolution",
    "Undetermined",
    "__version__",
    "align",
    "diagnose",
    "epipoles",
    "initialize",
    "load",
    "load_truth",
    "refine",
    "relabel",
    "resect",
    "save",
    "simulate",
    "solve",
    "sweep",
    "three_view",
    "three_view_batch",
    "triangulate",
    "trifocal_tensor",
]


def __dir__() -> list[str]:
    return __all__
