# SPDX-License-Identifier: MIT OR Apache-2.0
"""The compiled core: functions on arrays. The package wraps each of them once; call the package."""

from collections.abc import Callable, Sequence
from typing import Final, TypedDict, type_check_only

import numpy as np
from numpy.typing import NDArray

_Float = NDArray[np.float64]
_Index = NDArray[np.int64]

__version__: Final[str]

@type_check_only
class RawThreeView(TypedDict):
    poses: _Float
    landmarks: _Float
    inconsistent: int
    cost: float
    near_collinear: bool

@type_check_only
class RawProblem(TypedDict):
    views: int
    landmarks: int
    view: _Index
    landmark: _Index
    bearing: _Float
    sigma: _Float
    oriented: bool
    odometry: tuple[_Index, _Index, _Float, _Float] | None
    pose_priors: tuple[_Index, _Float, _Float] | None
    landmark_priors: tuple[_Index, _Float, _Float] | None

@type_check_only
class RawSearch(TypedDict):
    method: str
    triples: int
    grown: int
    candidates: int
    swept: int
    seed: int
    robust: bool

@type_check_only
class RawRefine(TypedDict):
    max_iterations: int
    damping: float
    tolerance: float
    loss: str
    loss_scale: float | None

@type_check_only
class RawReconstruction(TypedDict):
    poses: _Float
    landmarks: _Float
    residuals: _Float
    inliers: NDArray[np.bool_]
    cost: float
    rms: float
    sensitivity: float
    uncertainty: float
    converged: bool
    termination: str
    iterations: int
    undetermined: list[tuple[str, int, str]]
    components: list[RawReconstruction]
    pose_covariance: _Float | None
    landmark_covariance: _Float | None
    covariance_frame: str | None

@type_check_only
class RawDiagnosis(TypedDict):
    views: int
    landmarks: int
    sightings: int
    determined: bool
    extra: int
    singular_values: _Float
    condition: float
    noise: float
    near_collinear: bool
    mirror_margin: float
    components: list[tuple[list[int], list[int], int, int]]
    null_directions: list[tuple[bool, float, float, list[tuple[str, int, float]], str | None]]
    findings: list[tuple[str, str, list[int], list[int], int, str, str]]
    text: str

def three_view(bearings: _Float, method: str, reweights: int) -> list[RawThreeView]: ...
def trifocal_tensor(bearings: _Float, method: str, reweights: int) -> _Float: ...
def epipoles(tensor: _Float) -> _Float: ...
def triangulate(poses: _Float, bearings: _Float) -> _Float: ...
def resect(landmarks: _Float, bearings: _Float) -> _Float: ...
def align(source: _Float, target: _Float) -> tuple[float, float, float, float]: ...
def initialize(
    problem: RawProblem, search: RawSearch, refine: RawRefine, progress: Callable[[str, int, int], object] | None
) -> list[RawReconstruction]: ...
def solve(
    problem: RawProblem,
    search: RawSearch,
    refine: RawRefine,
    covariance: str | None,
    progress: Callable[[str, int, int], object] | None,
) -> list[RawReconstruction]: ...
def refine(
    problem: RawProblem,
    poses: _Float,
    landmarks: _Float,
    refine: RawRefine,
    covariance: str | None,
    progress: Callable[[str, int, int], object] | None,
) -> RawReconstruction: ...
def diagnose(
    problem: RawProblem,
    poses: _Float | None,
    landmarks: _Float | None,
    progress: Callable[[str, int, int], object] | None,
) -> RawDiagnosis: ...
def simulate(
    layout: str,
    views: int,
    landmarks: int,
    noise: float,
    seed: int,
    width: float,
    height: float,
    sight: float,
) -> tuple[_Float, _Float, _Float]: ...
def odometry(poses: _Float, sigmas: tuple[float, float, float], seed: int) -> _Float: ...
def three_view_batch(
    bearings: _Float, method: str, reweights: int
) -> tuple[_Float, _Float, _Index, _Float, NDArray[np.bool_]]: ...
def sweep(
    chunks: Sequence[tuple[str, int, int, float, int, int]],
    starts: Sequence[str],
    seed: int,
    threads: int,
    done: Callable[[int, _Index, _Index], object],
) -> None: ...
def scene_seed(layout: str, views: int, landmarks: int, noise: float, seed: int, trial: int) -> int: ...
