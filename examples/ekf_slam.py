# SPDX-License-Identifier: MIT OR Apache-2.0
"""Bearing-only SLAM by an extended Kalman filter, started from bearslam's map or blind.

python ekf_slam.py                                    # 100 runs for each start: a table, and ekf.svg
python ekf_slam.py --odometry 0.1 3 --output ekf.png  # worse odometry

Dellaert and Stroupe (ICRA 2002) proposed their linear method for this: to initialise such a filter. A robot drives one
and a half times around a loop, sees the landmarks in range as bearings, and measures its own motion. Nothing else is
known; the first pose is the origin, and the odometry determines the scale. The state consists of the pose and the
landmarks, with their full covariance.

Starts
    bearslam         The first views are solved at once; the last pose and the landmarks become the state. bearslam
                     gives the covariance of each pose and landmark, but not those between them, which the filter needs:
                     `joint_covariance` computes both, to first order, at bearslam's map. Its blocks agree with
                     bearslam's.
    bearslam blocks  The same with the blocks alone, as if the errors of pose and landmarks were independent. They are
                     not, since they share those of the odometry; without the correlations the filter is overconfident.
    blind            At the first view only the pose is known.

Landmarks that the start does not know are initialised in one of two ways, the same for all starts
    guess            At the first sighting, along the bearing, at a range guessed from the range of the sensor.
    parallax         Where two rays intersect, once they do so at a wide enough angle. Until then the pose of the first
                     sighting is kept in the state; sightings in between are not used.

The table has the position error at the view where bearslam's map enters, and at the end, both in the frame of the first
pose. If the covariance C of the filter is correct, e^T C^-1 e (NEES) of the error e is chi-square with two degrees of
freedom, with median 1.39. A run is "beyond 3 sigma" if it ends above 11.8, as 0.3 % should, and "lost" if it ends more
than 5 % of the diagonal of the arena away from the truth, has no start, or breaks down numerically. An extended filter
linearises only once, at its estimate: it becomes overconfident in time, however it starts.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

import bearslam
from bearslam.data.align import wrap
from bearslam.plotting.ellipses import COVERED, STYLE, draw_ellipses
from bearslam.plotting.map import FORMATS, finish, save_figure
from bearslam.plotting.style import ESTIMATE, PAPER, TRUTH, Style

Array = NDArray[np.float64]
STARTS = ("bearslam", "bearslam blocks", "blind")
ENTRIES = ("guess", "parallax")
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])
ARENA = (14.0, 10.0)
"""Width and height [m]."""
LAP = 60
"""Views in one lap, half a metre apart."""
LOST = 0.05 * float(np.hypot(*ARENA))
"""Error at the end [m]."""
NEES = -2.0 * float(np.log(0.0027))
"""Bound of the NEES of a position with the same probability as three standard deviations of a single number."""
PARALLAX = 50.0
"""Least angle between two rays that initialise a landmark, in standard deviations of a bearing; at most 60 degrees is
required. Blind starts were tried with 5 to 60: from 40 on they do not improve."""
PRECISE = 0.1
"""Largest standard deviation of a landmark taken from bearslam's map into the filter, over its distance. Less certain
ones enter later: their errors are not Gaussian, as the filter assumes."""


def turned(angle: float) -> Array:
    """Matrix (2, 2) of a rotation."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def move(pose: Array, motion: Array) -> tuple[Array, Array, Array]:
    """Pose after a motion, and its Jacobians by the pose (3, 3) and by noise in the axes of the end (3, 3)."""
    step = turned(pose[2]) @ motion[:2]
    by_pose, by_noise = np.eye(3), np.eye(3)
    by_pose[:2, 2] = QUARTER @ step
    by_noise[:2, :2] = turned(pose[2] + motion[2])
    return np.append(pose[:2] + step, wrap(pose[2] + motion[2])), by_pose, by_noise


def sight(pose: Array, landmarks: Array) -> tuple[Array, Array, Array]:
    """Bearings (k,) of landmarks (k, 2), and their derivatives by the pose (k, 3) and by the own landmark (k, 2)."""
    away = landmarks - pose[:2]
    across = away @ QUARTER.T / (away**2).sum(axis=1, keepdims=True)
    bearings = wrap(np.arctan2(away[:, 1], away[:, 0]) - pose[2])
    return bearings, np.column_stack([-across, np.full(len(away), -1.0)]), across


def cross(poses: Array, bearings: Array) -> tuple[Array, Array, Array, Array]:
    """Point (2,) where the rays of two poses (2, 3) intersect, and its ranges (2,), negative behind a pose.

    Followed by its Jacobians by the poses, one after the other (2, 6), and by the bearings (2, 2).
    """
    angle = poses[:, 2] + bearings
    along = np.column_stack([np.cos(angle), np.sin(angle)])
    normal = along @ QUARTER.T
    inverse = np.linalg.inv(normal)
    point = inverse @ (normal * poses[:, :2]).sum(axis=1)
    ranges = (along * (point - poses[:, :2])).sum(axis=1)
    by_bearings = inverse * ranges
    by_poses = [np.column_stack([np.outer(inverse[:, k], normal[k]), by_bearings[:, k]]) for k in range(2)]
    return point, ranges, np.hstack(by_poses), by_bearings


class Filter:
    """Extended Kalman filter of a pose and landmarks.

    The state has a fixed size: the pose, two numbers per landmark, and, if landmarks wait for parallax, three more for
    the pose of the first sighting. Unused entries are zero, and so are their rows and columns of the covariance.
    """

    def __init__(self, landmarks: int, sigma: float, reach: float, guess: tuple[float, float] | None) -> None:
        self.sigma, self.reach, self.guess = sigma, reach, guess
        self.at = 3 + np.arange(2 * landmarks).reshape(-1, 2)
        self.first_at = 3 + 2 * landmarks + np.arange(3 * landmarks).reshape(-1, 3)
        size = 3 + (2 if guess else 5) * landmarks
        self.mean, self.covariance = np.zeros(size), np.zeros((size, size))
        self.known = np.zeros(landmarks, dtype=bool)
        self.first = np.full(landmarks, np.nan)

    def start(self, pose: Array, landmarks: Array, known: NDArray[np.bool_], covariance: Array) -> None:
        """Start from a pose, the landmarks that are known, and their joint covariance, in this order."""
        where = np.append([0, 1, 2], self.at[known].ravel())
        self.mean[where] = np.append(pose, landmarks[known].ravel())
        self.covariance[np.ix_(where, where)] = covariance
        self.known = known.copy()

    def predict(self, motion: Array, noise: Array) -> None:
        """Move by odometry with these standard deviations."""
        self.mean[:3], by_pose, by_noise = move(self.mean[:3], motion)
        self.covariance[:3] = by_pose @ self.covariance[:3]
        self.covariance[:, :3] = self.covariance[:, :3] @ by_pose.T
        self.covariance[:3, :3] += (by_noise * noise**2) @ by_noise.T

    def update(self, bearings: Array) -> None:
        """Update with the bearings (n,) of one view, NaN where a landmark is not seen."""
        seen = np.isfinite(bearings)
        old = np.flatnonzero(seen & self.known)
        predicted, by_pose, by_landmark = sight(self.mean[:3], self.mean[self.at[old]])
        jacobian = np.zeros((len(old), len(self.mean)))
        jacobian[:, :3] = by_pose
        jacobian[np.arange(len(old))[:, None], self.at[old]] = by_landmark
        crossed = jacobian @ self.covariance
        # With S = L L^T and V = L^-1 H P, the gain is V^T L^-1 and the covariance loses V^T V: it stays symmetric.
        lower = np.linalg.cholesky(crossed @ jacobian.T + self.sigma**2 * np.eye(len(old)))
        whitened = np.linalg.solve(lower, np.column_stack([crossed, wrap(bearings[old] - predicted)]))
        self.mean += whitened[:, :-1].T @ whitened[:, -1]
        self.mean[2] = wrap(self.mean[2])
        self.covariance -= whitened[:, :-1].T @ whitened[:, :-1]
        for landmark in np.flatnonzero(seen & ~self.known):
            if self.guess is not None:
                self.enter_by_guess(landmark, bearings[landmark], *self.guess)
            else:
                self.enter_by_parallax(landmark, bearings[landmark])

    def insert(self, where: Array, value: Array, of: Array, jacobian: Array, own: Array | float = 0.0) -> None:
        """Insert a function of the state entries `of`, with noise of its own."""
        rows = jacobian @ self.covariance[of]
        self.mean[where] = value
        self.covariance[where], self.covariance[:, where] = rows, rows.T
        self.covariance[np.ix_(where, where)] = rows[:, of] @ jacobian.T + own

    def enter_by_guess(self, landmark: int, bearing: float, mean: float, spread: float) -> None:
        """Insert a landmark along the bearing at a guessed range, whose mean and sigma are shares of the reach."""
        angle = self.mean[2] + bearing
        along = np.array([np.cos(angle), np.sin(angle)])
        across = mean * self.reach * QUARTER @ along
        own = (spread * self.reach) ** 2 * np.outer(along, along) + self.sigma**2 * np.outer(across, across)
        by_pose = np.column_stack([np.eye(2), across])
        value = self.mean[:2] + mean * self.reach * along
        self.insert(self.at[landmark], value, np.arange(3), by_pose, own)
        self.known[landmark] = True

    def enter_by_parallax(self, landmark: int, bearing: float) -> None:
        """Insert a landmark where the ray intersects that of the first sighting, which is kept until then."""
        first_at = self.first_at[landmark]
        if np.isnan(self.first[landmark]):
            self.insert(first_at, self.mean[:3], np.arange(3), np.eye(3))
            self.first[landmark] = bearing
            return
        of = np.append(first_at, [0, 1, 2])
        poses, bearings = self.mean[of].reshape(2, 3), np.array([self.first[landmark], bearing])
        if abs(np.sin(np.diff(poses[:, 2] + bearings)[0])) < np.sin(min(PARALLAX * self.sigma, np.pi / 3)):
            return
        point, ranges, by_poses, by_bearings = cross(poses, bearings)
        if (ranges > 0.0).all() and (ranges < 1.5 * self.reach).all():
            self.insert(self.at[landmark], point, of, by_poses, self.sigma**2 * by_bearings @ by_bearings.T)
            self.mean[first_at], self.covariance[first_at], self.covariance[:, first_at] = 0.0, 0.0, 0.0
            self.known[landmark] = True


@dataclass(frozen=True)
class Run:
    """The measurements of the robot, and the truth in the frame of its first pose."""

    poses: Array
    landmarks: Array
    bearings: Array
    odometry: bearslam.Odometry
    noise: Array
    sigma: float
    reach: float


def simulate(seed: int, options: argparse.Namespace) -> Run:
    """Laps of a trajectory, each with its own noise."""
    width, height = ARENA
    lap = bearslam.simulate(
        "trajectory", LAP, options.landmarks, noise=0.0, seed=seed, width=width, height=height, sight=options.reach
    )
    view = np.arange(options.views) % LAP
    sigma = np.radians(options.noise_deg)
    bearings = wrap(lap.bearings[view] + np.random.default_rng(seed).normal(0.0, sigma, (len(view), options.landmarks)))
    position, heading = options.odometry
    noise = np.array([position, position, np.radians(heading)])
    odometry = replace(lap, poses=lap.poses[view], bearings=bearings).odometry(noise, seed)
    x, y, theta = lap.poses[0]
    home = bearslam.Similarity(1.0, -theta, -turned(-theta) @ [x, y])
    return Run(
        home.apply_poses(lap.poses[view]), home.apply(lap.landmarks), bearings, odometry, noise, sigma, options.reach
    )


def joint_covariance(poses: Array, landmarks: Array, run: Run) -> Array:
    """Covariance (3m + 2n, 3m + 2n) of the first poses and of the landmarks at the minimum, with the first pose fixed.

    Landmarks that are NaN are left out: their rows and columns are NaN.
    """
    m, n = len(poses), len(landmarks)
    rows = []

    def add(block: Array, columns: Array) -> None:
        rows.append(np.zeros((len(block), 3 * m + 2 * n)))
        rows[-1][:, columns] = block

    for k in range(m - 1):
        # The Jacobian is evaluated at the motion in the map, in the axes of the measured end.
        motion = np.append(turned(poses[k, 2]).T @ (poses[k + 1] - poses[k])[:2], run.odometry.delta[k, 2])
        _, by_pose, by_noise = move(poses[k], motion)
        add(np.linalg.solve(by_noise * run.noise, np.hstack([-by_pose, np.eye(3)])), np.arange(3 * k, 3 * k + 6))
    for k in range(m):
        seen = np.flatnonzero(np.isfinite(run.bearings[k]) & np.isfinite(landmarks[:, 0]))
        _, by_pose, by_landmark = sight(poses[k], landmarks[seen])
        for j, row in zip(seen, np.hstack([by_pose, by_landmark]) / run.sigma, strict=True):
            add(row[None], np.append(3 * k + np.arange(3), 3 * m + 2 * j + np.arange(2)))
    used = np.append(np.arange(3 * m) >= 3, np.repeat(np.isfinite(landmarks[:, 0]), 2))
    root = np.linalg.inv(np.linalg.qr(np.concatenate(rows)[:, used], mode="r"))
    covariance = np.full((3 * m + 2 * n, 3 * m + 2 * n), np.nan)
    covariance[np.ix_(used, used)] = root @ root.T
    covariance[:3] = covariance[:, :3] = 0.0
    return covariance


def solve_first(run: Run, views: int) -> bearslam.Reconstruction:
    """Map of the first views, from bearings and odometry."""
    motions = slice(views - 1)
    first = run.odometry
    odometry = bearslam.Odometry(first.start[motions], first.end[motions], first.delta[motions], first.sigma[motions])
    return bearslam.solve(run.bearings[:views], sigma=run.sigma, odometry=odometry, covariance="first_view")


def state_of(result: bearslam.Reconstruction, run: Run, *, blocks: bool) -> tuple[NDArray[np.bool_], Array]:
    """Which landmarks of a map are known well enough, and the covariance of its last pose and of these."""
    m = len(result.poses)
    bounded = np.isfinite(result.landmark_covariance).all(axis=(1, 2))
    known = bounded.copy()
    distance = np.hypot(*(result.landmarks[known] - result.poses[-1, :2]).T)
    widest = np.linalg.eigvalsh(result.landmark_covariance[known])[:, 1]
    known[known] = widest < (PRECISE * distance) ** 2
    at = np.append(3 * m - 3 + np.arange(3), (3 * m + np.arange(2 * len(known)).reshape(-1, 2)[known]).ravel())
    covariance = joint_covariance(result.poses, np.where(bounded[:, None], result.landmarks, np.nan), run)[
        np.ix_(at, at)
    ]
    if blocks:
        covariance = np.zeros_like(covariance)
        covariance[:3, :3] = result.pose_covariance[-1]
        for k, block in enumerate(result.landmark_covariance[known]):
            covariance[3 + 2 * k : 5 + 2 * k, 3 + 2 * k : 5 + 2 * k] = block
    return known, covariance


@dataclass
class Track:
    """Errors of a filter along a run of m views: NaN before it starts, infinite after it has broken down."""

    error: Array
    nees: Array
    landmark_error: float = np.inf
    path: list[Array] = field(default_factory=list)
    landmarks: Array | None = None
    covariances: Array | None = None
    """Path, landmarks and covariances are those at the view where bearslam's map enters."""


def follow(run: Run, start: str, guess: tuple[float, float] | None, first: int) -> Track:
    """Run a filter over the measurements of a run."""
    views, landmarks = run.bearings.shape
    track = Track(np.full(views, np.inf), np.full(views, np.inf))
    ekf = Filter(landmarks, run.sigma, run.reach, guess)
    begin = 0 if start == "blind" else first - 1
    track.error[:begin] = track.nees[:begin] = np.nan
    try:
        with np.errstate(divide="raise", over="raise", invalid="raise"):
            if start != "blind":
                result = solve_first(run, first)
                if not result.converged or not np.isfinite(result.pose_covariance[-1]).all():
                    return track  # a landmark has slid into a view, for example
                ekf.start(result.poses[-1], result.landmarks, *state_of(result, run, blocks=start != "bearslam"))
                track.path += list(result.poses[:-1])
            for k in range(begin, views):
                if k > begin:
                    ekf.predict(run.odometry.delta[k - 1], run.noise)
                if k > begin or start == "blind":
                    ekf.update(run.bearings[k])
                error = ekf.mean[:2] - run.poses[k, :2]
                track.error[k] = np.hypot(*error)
                track.nees[k] = error @ np.linalg.solve(ekf.covariance[:2, :2], error) if k else np.nan
                if k < first:
                    track.path.append(ekf.mean[:3].copy())
                if k == first - 1:
                    at = ekf.at[ekf.known]
                    track.landmarks = ekf.mean[at]
                    track.covariances = ekf.covariance[at[:, :, None], at[:, None, :]]
    except (bearslam.DegenerateError, FloatingPointError, np.linalg.LinAlgError):
        return track
    away = ekf.mean[ekf.at[ekf.known]] - run.landmarks[ekf.known]
    track.landmark_error = float(np.sqrt((away**2).sum(axis=1).mean()))
    return track


def quantile(values: Array, share: float) -> Array:
    """Quantile along the first axis; values may be infinite, so there is no interpolation."""
    return np.quantile(values, share, axis=0, method="inverted_cdf")


def table(tracks: dict[tuple[str, str], list[Track]], first: int) -> str:
    """The results of all runs, one line for each start and entry."""
    view = f"view {first}"
    lines = [
        f"{'':<26}error of position [m]               landmarks      median NEES     beyond",
        f"{'':<26}{f'at {view}':<18}at the end        at the end       at   at the   3 sigma  lost",
        f"{'start':<17}{'entry':<9}median    90 %  median    90 %      rms [m]  {view:>7}      end       [%]   [%]",
    ]
    for (start, entry), some in tracks.items():
        error = np.array([track.error for track in some])[:, [first - 1, -1]]
        nees = np.array([track.nees for track in some])[:, [first - 1, -1]]
        (early, late), (bad_early, bad_late) = quantile(error, 0.5), quantile(error, 0.9)
        early_nees, late_nees = quantile(nees, 0.5)
        landmarks = quantile(np.array([track.landmark_error for track in some]), 0.5)
        beyond, lost = 100 * (nees[:, 1] > NEES).mean(), 100 * (error[:, 1] > LOST).mean()
        lines.append(
            f"{start:<17}{entry:<9}{early:>6.3f} {bad_early:>7.3f}  {late:>6.3f} {bad_late:>7.3f}   {landmarks:>10.3f}"
            f"  {early_nees:>7.2f}  {late_nees:>7.2f}   {beyond:>7.0f}  {lost:>4.0f}"
        )
    return "\n".join(lines)


def draw_errors(ax: Axes, tracks: dict[str, list[Track]], first: int) -> None:
    """Median and band of the errors of each start, view by view."""
    for start, style, line in (("bearslam", ESTIMATE, "-"), ("blind", PAPER, "--")):
        errors = np.array([track.error for track in tracks[start]])
        views = np.arange(first if start == "bearslam" else 2, errors.shape[1] + 1)
        low, middle, high = (quantile(errors[:, views - 1], share) for share in (0.1, 0.5, 0.9))
        ax.fill_between(views, low, high, color=style.color, alpha=0.2, linewidth=0.0)
        ax.plot(views, middle, line, color=style.color, label=f"{start}, median and 10 to 90 %")
    ax.axvline(first, color=TRUTH.color, linewidth=0.8, linestyle=":", label="bearslam's map enters")
    ax.set(yscale="log", xlabel="view")
    ax.grid(color="#e6e6e6", linewidth=0.6)
    ax.spines[["top", "right"]].set_visible(False)
    ax.label_outer()


def draw_start(ax: Axes, run: Run, track: Track, style: Style, first: int) -> None:
    """Path and landmarks of the first views, and their estimates by the filter."""
    seen = run.landmarks[np.isfinite(run.bearings[:first]).any(axis=0)]
    ax.plot(*run.poses[:first, :2].T, color=TRUTH.color, linewidth=1.2)
    ax.plot(*seen.T, TRUTH.marker, color=TRUTH.color, markerfacecolor="none", markersize=7)
    if track.landmarks is not None and track.covariances is not None:
        ax.plot(*np.array(track.path)[:, :2].T, "--", color=style.color, linewidth=1.5)
        ax.plot(*track.landmarks.T, style.marker, color=style.color, markersize=4)
        draw_ellipses(ax, track.landmarks, track.covariances, np.eye(2), 1.0, None, 3.5)
    finish(ax, "m")
    framed = np.concatenate([run.poses[:first, :2], seen])
    (left, bottom), (right, top) = framed.min(axis=0) - 1.8, framed.max(axis=0) + 1.8
    ax.set(xlim=(left, right), ylim=(bottom, top))
    ax.label_outer()


def draw(tracks: dict[tuple[str, str], list[Track]], run: Run, first: int, path: Path) -> None:
    """Errors along all runs, and the state of the filter in the first run where bearslam's map enters."""
    figure = Figure(figsize=(8.0, 7.2), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=(1.0, 1.2))
    left, right = above.subplots(1, 2, sharey=True)
    for ax, entry in ((left, "guess"), (right, "parallax")):
        draw_errors(ax, {start: tracks[start, entry] for start in STARTS}, first)
    left.set_ylabel("error of position [m]")
    left.set_title("new landmarks at a guessed range", fontsize=10)
    right.set_title("new landmarks after enough parallax", fontsize=10)
    entries = left.get_legend_handles_labels()
    above.legend(*entries, loc="outside upper center", ncols=3, frameon=False, fontsize=9)

    panels = (("bearslam", "parallax", ESTIMATE), ("blind", "guess", PAPER), ("blind", "parallax", PAPER))
    for ax, (start, entry, style) in zip(below.subplots(1, 3, sharex=True, sharey=True), panels, strict=True):
        draw_start(ax, run, tracks[start, entry][0], style, first)
        ax.set_title(f"{start}{'' if start == 'bearslam' else f', {entry}'}: view {first}", fontsize=10)
    line: dict[str, Any] = {"linewidth": 1.3, "markersize": 6}
    symbols = [
        Line2D([], [], color=TRUTH.color, marker=TRUTH.marker, markerfacecolor="none", label="truth", **line),
        *(
            Line2D([], [], color=style.color, marker=style.marker, linestyle="--", label=start, **line)
            for start, style in (("bearslam", ESTIMATE), ("blind", PAPER))
        ),
        Line2D(
            [],
            [],
            linestyle="none",
            marker="o",
            markersize=9,
            markerfacecolor="none",
            label=f"{100 * COVERED:.0f} % ellipse",
            color=STYLE["edgecolors"],
        ),
    ]
    below.legend(handles=symbols, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    save_figure(figure, path)


def arguments() -> argparse.Namespace:
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100, help="number of runs for each start (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the runs (default %(default)s)")
    parser.add_argument("--views", type=int, default=90, help=f"views per run, {LAP} per lap (default %(default)s)")
    parser.add_argument("--first", type=int, default=15, help="views that bearslam solves (default %(default)s)")
    parser.add_argument("--landmarks", type=int, default=30, help="number of landmarks (default %(default)s)")
    parser.add_argument("--reach", type=float, default=4.0, help="range of the sensor [m] (default %(default)s)")
    parser.add_argument("--noise-deg", type=float, default=1.0, help="noise of a bearing (default %(default)s)")
    parser.add_argument(
        "--odometry",
        type=float,
        nargs=2,
        default=(0.05, 2.0),
        metavar=("METRES", "DEGREES"),
        help="noise of the odometry over half a metre (default 0.05 2)",
    )
    parser.add_argument(
        "--guess",
        type=float,
        nargs=2,
        default=(0.9, 0.1),
        metavar=("MEAN", "SIGMA"),
        help="guessed range of a new landmark, over the reach (default 0.9 0.1, the best of five for blind starts)",
    )
    parser.add_argument("--output", type=Path, default=Path("ekf.svg"), help="figure to write (default %(default)s)")
    options = parser.parse_args()
    if options.runs < 1 or options.seed < 0:
        parser.error("expected --runs of 1 or more and --seed of 0 or more")
    if not all(number > 0 for number in (options.reach, options.noise_deg, *options.odometry, *options.guess)):
        parser.error("expected --reach, --noise-deg, --odometry and --guess above 0")
    if options.output.suffix not in FORMATS:
        parser.error(f"--output: expected a name that ends in {', '.join(FORMATS)}, got {options.output}")
    if not options.output.absolute().parent.is_dir():
        parser.error(f"--output: expected a folder that exists, got {options.output.parent}")
    if not 3 <= options.first < options.views:
        parser.error("expected 3 <= --first < --views")
    return options


def main() -> int:
    """Run all filters over all runs, print the table and draw the figure."""
    options = arguments()
    tracks: dict[tuple[str, str], list[Track]] = {(start, entry): [] for entry in ENTRIES for start in STARTS}
    try:
        runs = [
            simulate(seed, options)
            for seed in np.random.SeedSequence(options.seed).generate_state(options.runs).tolist()
        ]
        for run in runs:
            for (start, entry), some in tracks.items():
                some.append(follow(run, start, tuple(options.guess) if entry == "guess" else None, options.first))
        print(table(tracks, options.first))
        draw(tracks, runs[0], options.first, options.output)
    except (bearslam.BearslamError, OSError) as error:
        print(f"ekf_slam: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
