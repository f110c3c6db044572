# SPDX-License-Identifier: MIT OR Apache-2.0
"""Maps in the viewer of Rerun, with a timeline of views. Needs rerun-sdk."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from bearslam.data.checks import FloatArray
from bearslam.data.estimate import Estimate, outliers
from bearslam.data.maps import Map, MapLike, pick
from bearslam.io.atomic import replacing
from bearslam.io.endings import ending_of
from bearslam.io.text import printable
from bearslam.plotting.geometry import aligned_to, extent, sight_lines, without_far_points
from bearslam.plotting.odometry_chains import OdometryChains, closure_lines, odometry_chains, pieces
from bearslam.plotting.style import ESTIMATE, RAY, TRUTH, WRONG, colors

try:
    import rerun as rr
    import rerun.blueprint as rrb
except ImportError:
    raise ImportError('the viewer needs rerun-sdk: pip install "bearslam[viewer]"') from None

__all__ = ["FORMATS", "view"]

FORMATS = (".rrd",)
TIMELINE = "view"
# The y axis of the viewer points down and cannot be flipped (rerun-io/rerun#1387). A planar map is best seen in a 2D
# view, so (x, -y) is recorded.
FLIP = np.array([1.0, -1.0])
HEADING = 0.03
"""Length of the arrow of a pose, as a share of the map; shorter if there are many."""


def view(result: Estimate, path: str | os.PathLike[str] | None = None, truth: MapLike | None = None) -> None:
    """Show a reconstruction in the viewer or record it; see `Reconstruction.view`."""
    if path is not None:
        ending_of(path, FORMATS)
    shown = Map(result.poses, result.landmarks)
    target = None
    if truth is not None:
        target = pick("truth", truth, len(shown.poses), len(shown.landmarks))
        shown = aligned_to(shown, target)
    recording = rr.RecordingStream("bearslam", send_properties=False)
    if path is None:
        try:
            recording.spawn(default_blueprint=_blueprint(shown))
            _record(recording, result, shown, target)
            recording.flush()
        except RuntimeError as error:
            raise OSError(f"the viewer cannot be opened: {error}") from error
    else:
        memory = recording.memory_recording()
        recording.send_blueprint(_blueprint(shown))
        _record(recording, result, shown, target)
        with replacing(path) as file:
            file.write(memory.drain_as_bytes())


def _blueprint(shown: Map) -> rrb.Blueprint:
    """A blueprint with one view of the whole map, without points far from all others."""
    points = without_far_points(shown) * FLIP
    if len(points) == 0:
        return rrb.Blueprint(rrb.Spatial2DView(origin="/", name="map"))
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.05 * extent(shown)
    (left, top), (right, bottom) = (low - margin).tolist(), (high + margin).tolist()
    bounds = rrb.VisualBounds2D(x_range=[left, right], y_range=[top, bottom])
    return rrb.Blueprint(rrb.Spatial2DView(origin="/", name="map", visual_bounds=bounds))


def _record(recording: rr.RecordingStream, result: Estimate, shown: Map, truth: Map | None) -> None:
    views, landmarks = len(shown.poses), len(shown.landmarks)
    scale = extent(shown if truth is None else truth)
    paths = odometry_chains(result.odometry, views)
    if truth is not None:
        _ways(recording, "truth", truth, paths, (TRUTH.color,) * len(paths.robots), 0.8)
        _points(recording, "truth/views", truth.poses[:, :2], TRUTH.color, 1.0)
        _points(recording, "truth/landmarks", truth.landmarks, TRUTH.color, 5.0)
    own = colors(len(paths.robots), ESTIMATE)
    _ways(recording, "estimate", shown, paths, own, 1.2)
    closures = closure_lines(paths, shown.poses[:, :2])
    if len(closures):
        recording.log("estimate/closures", _strips(closures, "#808080", 0.6), static=True)
    names = [printable(name) for name in result.view_ids or range(views)]
    length = HEADING * scale * min(1.0, (10 / max(views, 1)) ** 0.5)
    known = _known(shown.poses)
    shades = np.tile(_rgb([ESTIMATE.color]), (views, 1))
    for robot, color in zip(paths.robots, own, strict=True):
        shades[robot] = _rgb([color])
    recording.log(
        "estimate/views",
        rr.Arrows2D(
            origins=shown.poses[known, :2] * FLIP,
            vectors=_headings(shown.poses[known], length),
            colors=shades[known],
            radii=rr.Radius.ui_points(1.0),
            labels=list(compress(names, known)),
        ),
        static=True,
    )
    labels = [printable(name) for name in result.landmark_ids or range(landmarks)]
    _points(recording, "estimate/landmarks", shown.landmarks, ESTIMATE.color, 3.0, labels)
    wrong = outliers(result)
    dashed = sight_lines(shown, result.sightings, wrong, oriented=result.oriented)
    if len(dashed):
        recording.log("outliers", _strips(dashed, WRONG, 0.6), static=True)
    _steps(recording, result, shown, wrong, 2.0 * length)


def _steps(
    recording: rr.RecordingStream, result: Estimate, shown: Map, wrong: NDArray[np.bool_], length: float
) -> None:
    """Record what each view sees on a timeline of views, each replacing the one before."""
    views = len(shown.poses)
    moments = [rr.TimeColumn(TIMELINE, sequence=range(views))]
    posed, placed = _known(shown.poses), _known(shown.landmarks)
    seen = result.sightings
    known = posed[seen.view] & placed[seen.landmark]
    for name, which, color in (("bearings", known & ~wrong, RAY), ("outliers", known & wrong, WRONG)):
        order = np.flatnonzero(which)
        order = order[np.argsort(seen.view[order], kind="stable")]
        rays = sight_lines(shown, seen, order, oriented=result.oriented)
        counts = np.bincount(seen.view[order], minlength=views)
        style = rr.LineStrips2D.from_fields(colors=_rgb([color]), radii=rr.Radius.ui_points(0.8))
        recording.log(f"now/{name}", style, static=True)
        recording.send_columns(f"now/{name}", moments, rr.LineStrips2D.columns(strips=rays * FLIP).partition(counts))
    bold = rr.Arrows2D.from_fields(colors=_rgb(["#000000"]), radii=rr.Radius.ui_points(2.0))
    recording.log("now/robot", bold, static=True)
    arrows = rr.Arrows2D.columns(origins=shown.poses[posed, :2] * FLIP, vectors=_headings(shown.poses[posed], length))
    recording.send_columns("now/robot", moments, arrows.partition(posed.astype(np.int64)))


def _ways(
    recording: rr.RecordingStream, name: str, drawn: Map, paths: OdometryChains, shades: tuple[str, ...], width: float
) -> None:
    """Record the trajectory of each robot, with gaps where it is undetermined."""
    for number, (robot, color) in enumerate(zip(paths.robots, shades, strict=True)):
        lines = [drawn.poses[piece, :2] for piece in pieces(robot, drawn.poses[:, :2])]
        if lines:
            recording.log(f"{name}/robots/{number}", _strips(lines, color, width), static=True)


def _points(
    recording: rr.RecordingStream, name: str, points: FloatArray, color: str, size: float, labels: Sequence[str] = ()
) -> None:
    known = _known(points)
    recording.log(
        name,
        rr.Points2D(
            points[known] * FLIP,
            colors=_rgb([color]),
            radii=rr.Radius.ui_points(size),
            labels=list(compress(labels, known)) if labels else None,
        ),
        static=True,
    )


def _strips(lines: Sequence[FloatArray] | FloatArray, color: str, width: float) -> rr.LineStrips2D:
    return rr.LineStrips2D([line * FLIP for line in lines], colors=_rgb([color]), radii=rr.Radius.ui_points(width))


def _headings(poses: FloatArray, length: float) -> FloatArray:
    """Arrows (k, 2) along the headings of the poses."""
    arrows: FloatArray = length * FLIP * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    return arrows


def _known(rows: FloatArray) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(rows).all(axis=1))


def _rgb(names: Sequence[str]) -> NDArray[np.uint8]:
    """RGB values (k, 3) of colours such as #0072b2."""
    return np.array([list(bytes.fromhex(name[1:])) for name in names], dtype=np.uint8).reshape(-1, 3)
