# SPDX-License-Identifier: MIT OR Apache-2.0
"""Folders of the UTIAS MRCLAM data sets: written by the tests with known truth, and the real one if it is available."""

import functools
import gzip
import os
from pathlib import Path

import numpy as np
import pytest

import bearslam
from bearslam import InvalidInputError
from bearslam.cli.main import main
from bearslam.data.maps import compare
from bearslam.io.mrclam import OdometryNoise, read

T0 = 1248446190.0
DELAY = 0.25
BARCODES = {1: 5, 2: 14, 6: 63, 7: 81, 8: 7, 9: 70, 10: 45, 11: 27}
LANDMARKS = {6: (0.0, 4.0), 7: (3.0, 3.5), 8: (4.0, -1.0), 9: (0.5, -4.0), 10: (-3.5, -2.0), 11: (-3.0, 3.0)}
HEADER = "# UTIAS\n# produced by a test\n# Format:\n# Time [s]  and so on\n"
SHARED = Path(os.environ.get("BEARSLAM_SHARED", Path(__file__).parents[2] / ".." / "shared"), "data", "mrclam7")
real = pytest.mark.skipif(
    not SHARED.is_dir(), reason=f"no data set in {SHARED}; BEARSLAM_SHARED names the folder above"
)


def table(rows, form):
    return HEADER + "".join("\t".join(form).format(*row) + " \n" for row in rows)


class Robot:
    """Drives along arcs: commands change at given times, and the robot follows them `DELAY` later."""

    def __init__(self, start, commands):
        self.start, self.commands = start, commands

    def pose(self, at):
        x, y, theta = self.start
        for k, (begin, v, w) in enumerate(self.commands):
            since = begin + DELAY
            until = self.commands[k + 1][0] + DELAY if k + 1 < len(self.commands) else np.inf
            t = min(at, until) - since
            if t <= 0:
                break
            if w == 0:
                x, y = x + v * t * np.cos(theta), y + v * t * np.sin(theta)
            else:
                x += v / w * (np.sin(theta + w * t) - np.sin(theta))
                y -= v / w * (np.cos(theta + w * t) - np.cos(theta))
            theta += w * t
        return np.array([x, y, theta])


ROBOTS = {
    1: Robot((0.0, 0.0, 0.3), [(T0 - 2, 0.1, 0.2), (T0 + 3.2, 0.15, 0.0), (T0 + 7.7, 0.05, -0.5), (T0 + 60, 0, 0)]),
    2: Robot((1.0, -1.0, 2.0), [(T0 - 2, 0.2, -0.3), (T0 + 5.1, 0.0, 0.4), (T0 + 9.9, 0.1, 0.1), (T0 + 60, 0, 0)]),
}


def bearing(pose, point):
    return float(np.angle((complex(*point) - complex(*pose[:2])) * np.exp(-1j * pose[2])))


def files(robots=(1, 2)):
    return dict(_files(robots))


@functools.cache
def _files(robots):
    """The content of a folder: every second an image with all landmarks, within 2 ms."""
    content = {
        "Barcodes.dat": table(BARCODES.items(), ["{}", "{}"]),
        "Landmark_Groundtruth.dat": table([(s, *p, 1e-4, 1e-4) for s, p in LANDMARKS.items()], ["{}"] * 5),
    }
    for number in robots:
        robot = ROBOTS[number]
        seen = []
        for second in range(1, 13):
            at = T0 + second + 0.1 * number
            for k, (subject, point) in enumerate(LANDMARKS.items()):
                seen.append((at + 0.001 * (k % 3 == 2), BARCODES[subject], 2.5, bearing(robot.pose(at), point)))
        seen.sort(key=lambda row: row[0])
        content[f"Robot{number}_Measurement.dat"] = table(seen, ["{:.3f}", "{:3d}", "{:.3f}", "{!r}"])
        content[f"Robot{number}_Odometry.dat"] = table(robot.commands, ["{:.3f}", "{}", "{}"])
        truth = [(at, *robot.pose(at).tolist()) for at in np.arange(T0 - 1, T0 + 20, 0.01).tolist()]
        content[f"Robot{number}_Groundtruth.dat"] = table(truth, ["{:.3f}", "{!r}", "{!r}", "{!r}"])
    return content


def write(folder, content):
    for name, text in content.items():
        data = text if isinstance(text, bytes) else text.encode()
        Path(folder, name).write_bytes(data)
    return folder


@pytest.fixture
def folder(tmp_path):
    return write(tmp_path, files())


def test_views_names_and_bearings(folder):
    problem = bearslam.load(folder)
    assert problem.view_ids[:2] == ("1@1248446191.100", "1@1248446192.100")
    assert problem.view_ids[12] == "2@1248446191.200"
    assert len(problem.view_ids) == 24
    assert problem.landmark_ids == ("6", "7", "8", "9", "10", "11")
    assert len(problem.sightings) == 144
    truth = bearslam.load_truth(folder, problem)
    for view, landmark, angle in zip(
        problem.sightings.view, problem.sightings.landmark, problem.sightings.bearing, strict=True
    ):
        assert angle == pytest.approx(bearing(truth.poses[view], truth.landmarks[landmark]), abs=1e-4)
    assert problem.sightings.sigma.tolist() == [np.radians(0.3)] * 144
    assert problem.remarks == ("ranges left out: only the bearings of the cameras are used",)


def test_odometry_is_that_of_the_true_motion(folder):
    problem = bearslam.load(folder)
    odometry = problem.odometry
    assert odometry.start.tolist() == [*range(11), *range(12, 23)]
    assert (odometry.end == odometry.start + 1).all()
    for start, end, delta in zip(odometry.start, odometry.end, odometry.delta, strict=True):
        number, _ = problem.view_ids[start].split("@")
        before, after = (ROBOTS[int(number)].pose(float(problem.view_ids[i].split("@")[1])) for i in (start, end))
        step = (complex(*after[:2]) - complex(*before[:2])) * np.exp(-1j * before[2])
        np.testing.assert_allclose(delta, [step.real, step.imag, after[2] - before[2]], atol=1e-6)
    wrong = bearslam.load(folder, odometry_delay=0.0).odometry
    assert np.abs(wrong.delta - odometry.delta).max() > 0.02


def test_turn_scale(folder):
    whole, less = (bearslam.load(folder, turn_scale=scale).odometry for scale in (1.0, 0.95))
    np.testing.assert_allclose(less.delta[:, 2], 0.95 * whole.delta[:, 2])


def test_noise_grows_as_documented(folder):
    noise = OdometryNoise(position_time=0.01, position_distance=0.1, heading_time=0.02, heading_turn=0.2)
    odometry = bearslam.load(folder, odometry_noise=noise).odometry
    x, y, heading = odometry.sigma[0]  # of one second with 0.1 m/s and 0.2 rad/s
    assert x == y == pytest.approx(np.hypot(0.01, 0.1 * np.sqrt(0.1)))
    assert heading == pytest.approx(np.hypot(0.02, 0.2 * np.sqrt(0.2)))
    assert bearslam.load(folder, odometry_noise=tuple(noise)).odometry.sigma.tolist() == odometry.sigma.tolist()
    both = bearslam.load(folder, odometry_noise=noise, every=1.5).odometry  # half of the views
    assert both.sigma[0, 2] == pytest.approx(np.hypot(heading, odometry.sigma[1, 2]))


def test_five_lines_solve_it(folder):
    problem = bearslam.load(folder)
    result = bearslam.solve(problem)
    errors = compare(result, bearslam.load_truth(folder, problem))
    assert errors.landmark < 1e-3
    assert errors.position < 1e-3


def test_compressed_files_are_the_same(folder, tmp_path_factory):
    other = write(
        tmp_path_factory.mktemp("gz"), {f"{name}.gz": gzip.compress(text.encode()) for name, text in files().items()}
    )
    one, two = bearslam.load(folder), bearslam.load(other)
    assert one.view_ids == two.view_ids
    assert one.sightings.bearing.tolist() == two.sightings.bearing.tolist()
    assert one.odometry.delta.tolist() == two.odometry.delta.tolist()


def test_the_plain_file_of_two_is_read(folder):
    Path(folder, "Barcodes.dat.gz").write_bytes(b"nonsense")
    assert len(bearslam.load(folder).sightings) == 144


def insert(content, name, *lines):
    """More lines after those of the time before them."""
    rows = content[name].splitlines(keepends=True)
    rows = rows[:4] + sorted([*rows[4:], *(line + "\n" for line in lines)], key=lambda line: float(line.split()[0]))
    return content | {name: "".join(rows)}


def test_robots_and_unknown_barcodes_are_counted(tmp_path):
    lines = [f"{T0 + 2.1:.3f} 14 1.0 0.1", f"{T0 + 2.6:.3f} 14 1.0 0.1", f"{T0 + 2.1:.3f} 999 1.0 0.2"]
    problem = read(write(tmp_path, insert(files(), "Robot1_Measurement.dat", *lines)))
    assert problem.remarks[:2] == (
        "2 sightings of other robots left out",
        "1 sightings of barcodes missing from Barcodes.dat left out",
    )
    assert len(problem.sightings) == 144
    assert len(problem.view_ids) == 24  # a robot alone makes no view


def test_the_first_of_two_sightings_counts(tmp_path):
    line = f"{T0 + 2.103:.3f} 63 1.0 -3.0"
    problem = read(write(tmp_path, insert(files(), "Robot1_Measurement.dat", line)))
    assert problem.remarks[0] == "1 repeated sightings of a landmark in one view left out"
    assert -3.0 not in problem.sightings.bearing
    assert len(problem.sightings) == 144


def test_window(folder):
    assert len(bearslam.load(folder, window=0.0).view_ids) == 48  # the images are in two parts
    joined = bearslam.load(folder, window=1.01)
    assert len(joined.view_ids) == 12
    assert "72 repeated sightings of a landmark in one view left out" in joined.remarks


def test_every(folder):
    problem = bearslam.load(folder, every=3.0)
    assert len(problem.view_ids) == 8
    assert problem.view_ids[1] == "1@1248446194.100"
    assert len(problem.sightings) == 48
    assert problem.remarks[0] == "96 sightings of views less than 3 s after the previous one left out"
    assert len(problem.odometry) == 6


def test_start_and_end_count_from_the_first_measurement_of_all(folder):
    problem = bearslam.load(folder, start=2.0, end=4.0)
    assert problem.view_ids == tuple(f"{robot}@{T0 + s + 0.1 * robot:.3f}" for robot in (1, 2) for s in (3, 4))
    assert bearslam.load(folder, start=2.0, end=4.0, robots=[2]).view_ids == problem.view_ids[2:]
    assert len(bearslam.load(folder, end=1e9).view_ids) == 24


def test_no_motion_where_there_is_no_log(tmp_path):
    content = files()
    rows = content["Robot1_Odometry.dat"].splitlines(keepends=True)
    content["Robot1_Odometry.dat"] = "".join([*rows[:4], *rows[5:7]])  # from second 3.45 to 7.95
    problem = read(write(tmp_path, content), robots=[1])
    assert problem.odometry.start.tolist() == [3, 4, 5]
    assert "8 motions before the odometry log begins or after it ends left out" in problem.remarks


def test_a_robot_that_is_seen_once_has_no_motion(folder):
    assert bearslam.load(folder, start=0.0, end=0.5, robots=[1]).odometry is None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start": 5.0, "end": 5.0}, "end: expected a time after start"),
        ({"start": np.nan}, "start: expected a number"),
        ({"start": 100.0}, "expected sightings of landmarks by these robots at these times, got none"),
        ({"robots": [3]}, r"robots: expected robots of .* \(\[1, 2\]\), got 3"),
        ({"robots": [6]}, "robots: expected an integer from 1 to 5"),
        ({"robots": []}, "got none"),
        ({"window": -1.0}, "window: expected a number of at least 0"),
        ({"every": "1"}, "every: expected a number"),
        ({"sigma": 0.0}, "sigma: expected a number above 0"),
        ({"turn_scale": 0.0}, "turn_scale: expected a number above 0"),
        ({"odometry_delay": np.inf}, "odometry_delay: expected a number"),
        ({"odometry_noise": (1.0, 2.0)}, "odometry_noise: expected four numbers"),
        ({"odometry_noise": 0.1}, "odometry_noise: expected four numbers"),
        ({"odometry_noise": (0.0, 1.0, 1.0, 1.0)}, "odometry_noise: position_time"),
    ],
)
def test_options_out_of_range(folder, options, message):
    with pytest.raises(InvalidInputError, match=message):
        bearslam.load(folder, **options)


def test_options_are_for_folders(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("view,landmark,bearing\na,b,1\n")
    with pytest.raises(InvalidInputError, match="every: applies to folders only"):
        bearslam.load(path, every=1.0)


MEASUREMENT = "Robot1_Measurement.dat"


@pytest.mark.parametrize(
    ("name", "line", "text", "message"),
    [
        (MEASUREMENT, 7, "1248446191.1 63 2.5", r"7: expected 4 numbers \(time, barcode, range, bearing\), got"),
        (MEASUREMENT, 7, "1248446191.1 63 2.5 0.1 9", "7: expected 4 numbers"),
        (MEASUREMENT, 7, "1248446191.1 63 2.5 left", "7: expected a number as bearing, got 'left'"),
        (MEASUREMENT, 7, "1248446191.1 63 2.5 1_0", "7: expected a number as bearing, got '1_0'"),
        (MEASUREMENT, 7, "1248446191.1 63 2.5 nan", "7: expected a finite number as bearing, got nan"),
        (MEASUREMENT, 7, "1248446191.1 63.5 2.5 0.1", "7: expected a whole number as barcode, got 63.5"),
        (MEASUREMENT, 7, "1248446191.1 63 2.5 45.0", "7: expected radians within one turn as bearing, got 45"),
        (MEASUREMENT, 7, "1248446191.1 63 -2.5 0.1", "7: expected a range of at least 0, got -2.5"),
        (MEASUREMENT, 7, "1e300 63 2.5 0.1", "7: expected a time in seconds, got 1e"),
        (MEASUREMENT, 40, "1248446191.1 63 2.5 0.1", "40: expected a time no earlier than that of the line above"),
        ("Robot1_Odometry.dat", 6, "1248446180.0 0.1 0.1", "6: expected a time no earlier than"),
        ("Robot1_Odometry.dat", 6, "1248446193.2 1e5 0.1", "6: expected velocities, got 100000 and 0.1"),
        ("Barcodes.dat", 6, "2 5", "6: expected every barcode once, got 5 again"),
        ("Barcodes.dat", 6, "1 77", "6: expected every subject once, got 1 again"),
        ("Barcodes.dat", 6, "2.5 77", "6: expected whole numbers, got 2.5 and 77"),
        ("Barcodes.dat", 6, "0 77", "6: expected a subject from 1 on, got 0"),
    ],
)
def test_what_cannot_be_read_is_an_error_with_file_and_line(tmp_path, name, line, text, message):
    content = files()
    rows = content[name].splitlines()
    rows[line - 1] = text
    write(tmp_path, content | {name: "\n".join(rows)})
    with pytest.raises(InvalidInputError, match=f"{name}:{message}"):
        bearslam.load(tmp_path)


def test_comments_and_empty_lines_count_as_lines(tmp_path):
    content = files()
    content[MEASUREMENT] = (
        "\r\n# more\r\n" + content[MEASUREMENT].replace("\n", "\r\n") + "# end\r\n1248446300 63 1\r\n"
    )
    write(tmp_path, content)
    with pytest.raises(InvalidInputError, match=rf"{MEASUREMENT}:80: expected 4 numbers"):
        bearslam.load(tmp_path)


@pytest.mark.parametrize("name", ["Barcodes.dat", "Robot1_Odometry.dat"])
def test_missing_files(tmp_path, name):
    content = files()
    del content[name]
    write(tmp_path, content)
    with pytest.raises(
        InvalidInputError, match=rf"expected a file {name} or {name}.gz, as a UTIAS MRCLAM data set has, got"
    ):
        bearslam.load(tmp_path)


def test_a_folder_without_measurements(tmp_path):
    write(tmp_path, {"Barcodes.dat": files()["Barcodes.dat"]})
    with pytest.raises(InvalidInputError, match="expected files Robot1_Measurement"):
        bearslam.load(tmp_path)


@pytest.mark.parametrize("name", list(files((1,))))
def test_empty_binary_and_damaged_files(tmp_path, name):
    folder = write(tmp_path, files((1,)))
    path = folder / name
    whole = path.read_bytes()

    def read_all():
        bearslam.load_truth(folder, bearslam.load(folder))

    for data in (b"", b"# nothing\n", b"\xff\xfe\x00\x01" * 20, whole[:-30] + b"\x00" * 10, bytes(range(128)) * 3):
        path.write_bytes(data)
        with pytest.raises(InvalidInputError, match=name):
            read_all()
    path.unlink()
    squeezed = gzip.compress(whole)
    for data in (squeezed[: len(squeezed) // 2], squeezed[:40] + b"zzzz" + squeezed[44:], b"", whole):
        (folder / f"{name}.gz").write_bytes(data)
        with pytest.raises(InvalidInputError, match=name):
            read_all()


def test_command_line(folder, capsys):
    truth = ["--truth", str(folder)]
    assert main(["solve", str(folder), "--robots", "2", "--start", "2", "--end", "9.5", "--every", "1.5", *truth]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("4 views, 6 landmarks, 24 sightings\n")
    assert "errors after alignment with the truth: 6 landmarks" in out
    assert "note: 24 sightings of views less than 1.5 s after the previous one left out" in err
    assert main(["solve", str(folder / "Barcodes.dat"), "--every", "1"]) == 1
    assert "every: applies to folders only" in capsys.readouterr().err


@real
def test_set_7_whole():
    problem = bearslam.load(SHARED)
    assert len(problem.sightings) == 16067
    assert problem.remarks[:2] == (
        "4206 sightings of other robots left out",
        "9 sightings of barcodes missing from Barcodes.dat left out",
    )
    assert len(problem.odometry) == len(problem.view_ids) - 5
    truth = bearslam.load_truth(SHARED, problem)
    seen = problem.sightings
    away = truth.landmarks[seen.landmark] - truth.poses[seen.view, :2]
    angle = np.arctan2(away[:, 1], away[:, 0]) - truth.poses[seen.view, 2] - seen.bearing
    missed = np.degrees(np.angle(np.exp(1j * angle[np.isfinite(angle)])))
    assert len(angle) - len(missed) < 30
    # As for single sightings at their own times: nothing is lost by combining them.
    assert 1.4826 * np.median(np.abs(missed - np.median(missed))) == pytest.approx(0.52, abs=0.01)
    assert (np.abs(missed) > 5).mean() < 0.0011


@real
def test_set_7_motions_against_motion_capture():
    for every in (0.5, 1.0, 2.0, 4.0):
        problem = bearslam.load(SHARED, every=every)
        truth, odometry = bearslam.load_truth(SHARED, problem), problem.odometry
        before, after = truth.poses[odometry.start], truth.poses[odometry.end]
        step = ((after - before)[:, :2] @ [1, 1j]) * np.exp(-1j * before[:, 2])
        true = np.column_stack([step.real, step.imag, after[:, 2] - before[:, 2]])
        error = odometry.delta - true
        error[:, 2] = np.angle(np.exp(1j * error[:, 2]))
        score = error / odometry.sigma
        rms = np.sqrt((score[np.isfinite(score).all(axis=1)] ** 2).mean(axis=0))
        assert (rms < 1.1).all()
        assert rms[0] > 0.4
        assert rms[2] > 0.6


@real
@pytest.mark.parametrize("window", range(3))
def test_set_7_odometry_as_computed_independently(window):
    """At the times of the views of derived scenes, which are means of several images."""
    from bearslam.io.mrclam import _motions

    path = SHARED / "derived" / "MRCLAM_Dataset7_track_joint.npz"
    with np.load(path) as scenes:
        robot, time, start, delta = (
            scenes[f"s{window:04d}_{name}"] for name in ("view_robot", "view_time", "odo_from", "odo_delta")
        )
    for one in range(1, 6):
        views = np.flatnonzero(robot == one)
        known, ours, _ = _motions(SHARED, one, time[views], DELAY, 1.0, OdometryNoise())
        assert known.all()
        np.testing.assert_allclose(ours, delta[np.isin(start, views)], atol=1e-3)
    problem = bearslam.load(SHARED, start=300.0 * window, end=300.0 * window + 300.0, every=1.0)
    assert len(problem.view_ids) == pytest.approx(len(time), rel=0.25)
    assert len(problem.landmark_ids) == 15


@real
@pytest.mark.parametrize("loss", ["squared", "huber"])
def test_set_7_five_robots_jointly(loss):
    for start in (0.0, 300.0, 600.0):
        problem = bearslam.load(SHARED, start=start, end=start + 300.0, every=1.0)
        result = bearslam.solve(problem, loss=loss)
        assert result.undetermined == ()
        truth = bearslam.load_truth(SHARED, problem).landmarks
        fit = bearslam.align(result.landmarks, truth)
        missed = fit.apply(result.landmarks) - truth
        share = np.sqrt((missed**2).sum() / ((truth - truth.mean(axis=0)) ** 2).sum())
        assert share < 0.035
        assert fit.scale == pytest.approx(1.0, abs=0.1)


@real
def test_set_7_in_gtsam():
    gtsam = pytest.importorskip("gtsam", reason="GTSAM is not installed: pip install gtsam")
    problem = bearslam.load(SHARED, end=300.0, every=1.0)
    result = bearslam.solve(problem)
    graph, values = result.to_gtsam()
    # The logarithm rotates the error of a motion by half the error of the heading, up to 0.1 rad here.
    assert graph.error(values) == pytest.approx(result.cost, rel=0.02)
    found = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    assert graph.error(found) == pytest.approx(result.cost, rel=0.02)
    # By GTSAM's definition, too, the least cost is hardly below that of our map.
    assert graph.error(found) == pytest.approx(graph.error(values), rel=1e-3)


@pytest.mark.parametrize("cell", ["\N{ARABIC-INDIC DIGIT THREE}", "1_0"])
def test_what_only_python_takes_for_a_number(tmp_path, cell):
    content = insert(files(), "Robot1_Measurement.dat", f"{T0 + 2.1:.3f} 63 {cell} 0.1")
    with pytest.raises(InvalidInputError, match=r"Robot1_Measurement\.dat:\d+: expected a number as range, got"):
        bearslam.load(write(tmp_path, content))


def test_lines_end_as_on_any_system(tmp_path):
    content = {name: text.replace("\n", "\r") for name, text in files().items()}
    assert len(bearslam.load(write(tmp_path, content)).sightings) == 144
