# SPDX-License-Identifier: MIT OR Apache-2.0
"""The compiled core: functions on arrays. The package wraps each of them once; call the package."""

from collections.abc import Callable, Sequence
from typing import Final, TypedDict, type_check_only

import numpy as np
from numpy.typing import NDArray

from bearslam.data.options import Settings
from bearslam.data.request import Request

_Float = NDArray[np.float64]
_Index = NDArray[np.int64]

__version__: Final[str]

@type_check_only
class RawFixes(TypedDict):
    value: _Float
    covariance: _Float
    rms: _Float
    sigma0: _Float
    p_value: _Float
    poor: NDArray[np.bool_]
    uncertainty: _Float

@type_check_only
class RawThreeView(TypedDict):
    poses: _Float
    landmarks: _Float
    inconsistent: int
    cost: float
    near_collinear: bool

@type_check_only
class RawSearch(TypedDict):
    triples: int
    grown: int
    candidates: int
    swept: int

@type_check_only
class RawRefinement(TypedDict):
    max_iterations: int
    damping: float
    tolerance: float
    loss_scale: float | None

@type_check_only
class Defaults(TypedDict):
    search: RawSearch
    refinement: RawRefinement

@type_check_only
class RawCertificate(TypedDict):
    views: list[int] | None
    cone: float
    cells: int
    verified: bool
    message: str

@type_check_only
class RawReconstruction(TypedDict):
    poses: _Float
    landmarks: _Float
    residuals: _Float
    inliers: NDArray[np.bool_]
    cost: float
    rms: float
    freedom: int
    explained: int | None
    sensitivity: float
    uncertainty: float
    worst: tuple[str, int] | None
    sigma0: float
    p_value: float
    findings: list[RawFinding]
    converged: bool
    termination: str
    iterations: int
    undetermined: list[tuple[str, int, str]]
    components: list[RawReconstruction]
    pose_covariance: _Float | None
    landmark_covariance: _Float | None
    covariance_frame: str | None
    certificate: RawCertificate | None

@type_check_only
class RawComponent(TypedDict):
    views: list[int]
    landmarks: list[int]
    sightings: int
    freedom: int

@type_check_only
class RawDirection(TypedDict):
    free: bool
    singular_value: float
    deviation: float
    movers: list[tuple[str, int, float]]
    cause: str | None

@type_check_only
class RawFinding(TypedDict):
    name: str
    severity: str
    views: list[int]
    landmarks: list[int]
    directions: int
    message: str
    advice: str

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
    components: list[RawComponent]
    null_directions: list[RawDirection]
    findings: list[RawFinding]
    text: str

@type_check_only
class RawRedundancy(TypedDict):
    sightings: tuple[_Float, _Float]
    odometry: tuple[_Float, _Float]
    pose_priors: tuple[_Float, _Float]
    landmark_priors: tuple[_Float, _Float]

def redundancy(request: Request, poses: _Float, landmarks: _Float, inliers: NDArray[np.bool_]) -> RawRedundancy: ...
def expected_error(
    request: Request, poses: _Float, landmarks: _Float, inliers: NDArray[np.bool_], sigma0: float
) -> float: ...
def three_view(bearings: _Float, method: str, reweights: int) -> list[RawThreeView]: ...
def trifocal_tensor(bearings: _Float, method: str, reweights: int) -> _Float: ...
def epipoles(tensor: _Float) -> _Float: ...
def triangulate(poses: _Float, bearings: _Float, sigma: float) -> RawFixes: ...
def resect(landmarks: _Float, bearings: _Float, sigma: float, strict: bool) -> RawFixes: ...
def align(source: _Float, target: _Float) -> tuple[float, float, float, float]: ...
def defaults() -> Defaults: ...
def initialize(
    request: Request, settings: Settings, progress: Callable[[str, int, int], object] | None
) -> list[RawReconstruction]: ...
def solve(
    request: Request, settings: Settings, covariance: str | None, progress: Callable[[str, int, int], object] | None
) -> list[RawReconstruction]: ...
def refine(
    request: Request,
    settings: Settings,
    poses: _Float,
    landmarks: _Float,
    covariance: str | None,
    progress: Callable[[str, int, int], object] | None,
) -> RawReconstruction: ...
def relabel(request: Request, poses: _Float, landmarks: _Float) -> list[tuple[int, int, int, int]]: ...
def diagnose(
    request: Request,
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
    outliers: float,
    outlier_kind: str,
) -> tuple[_Float, _Float, _Float, NDArray[np.bool_]]: ...
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
