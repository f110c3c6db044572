# SPDX-License-Identifier: MIT OR Apache-2.0
"""Damage files of every format at random, and see that each is read whole or refused with file and line.

    python tests/fuzz_loaders.py --minutes 10 --seed 0

Every outcome has to be a problem with as many sightings as the file has lines of them, which comes back bit for bit
from the g2o file that it is written to, or an `InvalidInputError` that names the file and, unless it is about the file
as a whole, the line; within two seconds, and without a warning. What is not is printed, with the content, and the exit
code is 1.
"""

from __future__ import annotations

import argparse
import gzip
import random
import re
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

import bearslam
from bearslam.io import g2o

FOLDERS = 0.2
"""Share of folders among what is damaged."""
SECONDS = 2.0
"""Longest that a small file may take."""

CSV = """\
# the kitchen
landmark,bearing_deg,view,sigma_deg
door,90,robot 1,2
"window, left",-45.5,robot 1,2
door,1e1,7,0.5
lamp,12.25,7,0.5
"""

G2O = """\
VERTEX_SE2 3 0 0 0
VERTEX_SE2 1 1 0.5 -0.25  # bearslam name robot 1
VERTEX_XY 7 4 5
VERTEX_XY 9 0 0  # bearslam unknown name window, left
EDGE_SE2 3 1 1.0 0.5 0.25 100 0 0 25 0 400
EDGE_SE2 1 3 -1.0 0.5 0.25 100 3 2 25 1 400
EDGE_BEARING_SE2_XY 1 9 -0.5 400
EDGE_BEARING_SE2_XY 3 9 0.75 399.99999999999997
EDGE_SE2_XY 3 7 3 4 100 0 25
EDGE_SE2_XY 1 7 3 -4 100 5 25
EDGE_PRIOR_SE2 1 1 2 0.5 0 0 0 0 0 2500
EDGE_PRIOR_SE2 3 1 2 0.5 100 0 0 100 0 2500
EDGE_PRIOR_XY 9 5 6 4 0 2
FIX 3 7
PARAMS_SE2OFFSET 0 0.1 0 0
VERTEX_SE3:QUAT 20 0 0 0 0 0 0 1
"""

GRAPH = """\
VERTEX2 0 0 0 0
VERTEX2 1 1 0.5 0.25
VERTEX_XY 5 4 5
ODOMETRY 0 1 1.0 0.5 0.25 0.01 0 0 0.04 0 0.0025
EDGE2 1 2 1.0 0.5 0.25 0.01 0 0 0.04 0 0.0025
LANDMARK 1 0 3 4 0.01 0 0.04
LANDMARK 0 0 4 3 0.01 0.001 0.04
BR 1 5 0.5 10 0.02 0.3
BR 2 5 -0.5 10 0.02 0.3
EDGE3 0 1 2
"""


def written() -> str:
    """What bearslam writes of a file with everything, exact numbers behind the lines included."""
    turned = G2O.replace("EDGE_PRIOR_SE2 1 1 2 0.5 0 0 0 0 0 2500", "EDGE_PRIOR_SE2 1 1 2 0.5 100 3 2 25 1 400")
    return g2o.render(g2o.parse(turned.encode(), "seed.g2o"))


SEEDS: dict[str, bytes] = {
    "a.csv": CSV.encode(),
    "a.g2o": G2O.encode(),
    "written.g2o": written().encode(),
    "a.graph": GRAPH.encode(),
    "a.txt": GRAPH.encode(),
    "b.txt": G2O.encode(),
    "a.csv.gz": gzip.compress(CSV.encode(), mtime=0),
    "a.g2o.gz": gzip.compress(G2O.encode(), mtime=0),
    "a.graph.gz": gzip.compress(GRAPH.encode(), mtime=0),
}

FOLDER: dict[str, bytes] = {
    "Barcodes.dat": b"# Subject Barcode\n1 5\n2 14\n6 63\n7 81\n8 7\n",
    "Robot1_Measurement.dat": b"# Time Subject range bearing\n10.0 63 1.5 0.25\n10.0 81 2.5 -0.25\n10.5 63 1.4 0.3\n"
    b"10.5 14 1.0 0.1\n11.0 7 1.2 0.2\n11.0 99 1.0 0.1\n11.5 81 1.9 0.5\n",
    "Robot1_Odometry.dat": b"# Time velocity turn\n9.0 0.1 0.0\n10.0 0.2 0.1\n10.75 0.1 -0.1\n12.0 0.0 0.0\n",
    "Robot2_Measurement.dat": gzip.compress(b"10.2 81 1.5 0.25\n10.7 63 1.5 0.5\n", mtime=0),
    "Robot2_Odometry.dat": b"9.0 0.1 0.0\n12.0 0.1 0.0\n",
}
FOLDER["Robot2_Measurement.dat.gz"] = FOLDER.pop("Robot2_Measurement.dat")
"""A data set of MRCLAM."""

WORDS = [
    *("nan", "inf", "-inf", "1e999", "-1e999", "1e-999", "1e308", "-1e308", "1e-308", "5e-324", "1e200", "1e-200"),
    *(
        "0",
        "-0.0",
        "-1",
        "1e16",
        "18446744073709551616",
        "9" * 400,
        "0." + "3" * 400,
        "0x10",
        "1_000",
        "1,5",
        "٣",
        "é",
        "",
    ),
    *(
        "#",
        "# bearslam",
        "# bearslam unknown",
        "# bearslam name x",
        "# bearslam sigma 1 1 1",
        "# bearslam covariance 1 0 1",
    ),
    *(
        "VERTEX_SE2",
        "VERTEX_XY",
        "EDGE_SE2",
        "EDGE_BEARING_SE2_XY",
        "EDGE_SE2_XY",
        "EDGE_PRIOR_SE2",
        "FIX",
        "ODOMETRY",
        "BR",
    ),
    *("view", "bearing", "sigma", '"', '""', "\\", "\x00", "\x1c", "\x85", "\u2028", "\ufeff", "\t", "\r"),
]
SIGHTING = {b"EDGE_BEARING_SE2_XY", b"EDGE_SE2_XY", b"LANDMARK", b"BR"}
WHOLE = re.compile(
    r": (no [A-Z]|expected a whole gzip|expected sightings|expected at most|expected a CSV header|"
    r"(view|landmark)_ids: expected distinct names)"
)
"""Complaints that are about the whole of a file."""


WHOLE_FOLDER = re.compile(
    r": (expected a whole gzip|expected sightings|expected at most|expected a file|"
    r"expected lines of \d numbers \([a-z ,]*\), got none)"
)


def lines_of(data: bytes) -> list[bytes]:
    return data.splitlines(keepends=True) or [b""]


def truncate(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def shuffle(data: bytes, rng: random.Random) -> bytes:
    lines = lines_of(data)
    rng.shuffle(lines)
    return b"".join(lines)


def delete(data: bytes, rng: random.Random) -> bytes:
    lines = lines_of(data)
    del lines[rng.randrange(len(lines))]
    return b"".join(lines)


def duplicate(data: bytes, rng: random.Random) -> bytes:
    lines = lines_of(data)
    lines.insert(rng.randrange(len(lines) + 1), rng.choice(lines))
    return b"".join(lines)


def join(data: bytes, rng: random.Random) -> bytes:
    lines = lines_of(data)
    k = rng.randrange(len(lines))
    lines[k] = lines[k].rstrip(b"\r\n")
    return b"".join(lines)


def flip(data: bytes, rng: random.Random) -> bytes:
    if not data:
        return data
    damaged = bytearray(data)
    for _ in range(rng.choice([1, 1, 1, 4, 20])):
        damaged[rng.randrange(len(damaged))] ^= 1 << rng.randrange(8)
    return bytes(damaged)


def binary(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.randbytes(rng.choice([1, 3, 100])) + data[at:]


def word(data: bytes, rng: random.Random) -> bytes:
    """Another word in the place of one."""
    lines = lines_of(data)
    k = rng.randrange(len(lines))
    parts = re.split(rb"([\s,]+)", lines[k])
    parts[2 * rng.randrange((len(parts) + 1) // 2)] = rng.choice(WORDS).encode()
    lines[k] = b"".join(parts)
    return b"".join(lines)


def swap(data: bytes, rng: random.Random) -> bytes:
    """Two words of a line the other way round."""
    lines = lines_of(data)
    k = rng.randrange(len(lines))
    parts = re.split(rb"([\s,]+)", lines[k])
    i, j = (2 * rng.randrange((len(parts) + 1) // 2) for _ in range(2))
    parts[i], parts[j] = parts[j], parts[i]
    lines[k] = b"".join(parts)
    return b"".join(lines)


def lengthen(data: bytes, rng: random.Random) -> bytes:
    lines = lines_of(data)
    k = rng.randrange(len(lines))
    lines[k] = lines[k].rstrip(b"\r\n") + rng.choice([b" 1", b",", b"9", b"#", b" "]) * 100_000 + b"\n"
    return b"".join(lines)


def splice(data: bytes, rng: random.Random) -> bytes:
    """The end of another file behind the start of this one."""
    other = rng.choice(list(SEEDS.values()))
    return data[: rng.randrange(len(data) + 1)] + other[rng.randrange(len(other) + 1) :]


def nest(data: bytes, rng: random.Random) -> bytes:
    return gzip.compress(data, mtime=0)


def unpack(change: Callable[[bytes, random.Random], bytes]) -> Callable[[bytes, random.Random], bytes]:
    """The same change inside of a compressed file."""

    def changed(data: bytes, rng: random.Random) -> bytes:
        try:
            return gzip.compress(change(gzip.decompress(data), rng), mtime=0)
        except Exception:  # noqa: BLE001 - it is damaged already
            return change(data, rng)

    return changed


CHANGES = [truncate, shuffle, delete, duplicate, join, flip, binary, word, word, word, swap, lengthen, splice, nest]


def damaged(rng: random.Random) -> tuple[str, bytes]:
    """A file that was whole, and what was left of it."""
    name, data = rng.choice(list(SEEDS.items()))
    for _ in range(rng.choice([1, 1, 1, 2, 3, 6])):
        change = rng.choice(CHANGES)
        inside = name.endswith(".gz") and rng.random() < 0.7
        data = (unpack(change) if inside else change)(data, rng)
    return name, data


def attempt_folder(folder: Path, content: dict[str, bytes]) -> str:
    """Read a folder of files, one of which is damaged: as `attempt`."""
    for name, data in content.items():
        (folder / name).write_bytes(data)
    start = time.perf_counter()
    try:
        problem = bearslam.load(folder)
    except bearslam.InvalidInputError as error:
        text = str(error)
        assert text.startswith(str(folder)), f"no file in {text!r}"
        named = re.match(re.escape(str(folder)) + r"/\w+\.dat(\.gz)?:\d+: ", text)
        outcome = "line named" if named else "file refused"
        assert named or WHOLE_FOLDER.search(text), f"no line in {text!r}"
    else:
        left_out = sum(int(remark.split()[0]) for remark in problem.remarks if " sightings " in remark.split(",")[0])
        count = sum(map(measurements, content.items()))
        assert len(problem.sightings) + left_out == count, f"{len(problem.sightings)} + {left_out} of {count} lines"
        outcome = "read"
    took = time.perf_counter() - start
    assert took < SECONDS, f"took {took:.1f} s"
    return outcome


def measurements(item: tuple[str, bytes]) -> int:
    """How many lines of measurements a file of a folder has."""
    name, data = item
    if "_Measurement" not in name:
        return 0
    text = (gzip.decompress(data) if name.endswith(".gz") else data).decode("utf-8-sig")
    return sum(bool(line.partition("#")[0].strip()) for line in re.split(r"\r\n|\r|\n", text))


def damaged_folder(rng: random.Random) -> dict[str, bytes]:
    """A folder, one file of which is no longer whole."""
    content = dict(FOLDER)
    name = rng.choice(list(content))
    data = content[name]
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        change = rng.choice(CHANGES)
        inside = name.endswith(".gz") and rng.random() < 0.7
        data = (unpack(change) if inside else change)(data, rng)
    content[name] = data
    return content


def expected(problem: bearslam.Problem, data: bytes) -> int:
    """How many lines of sightings a file has, by counting."""
    if data.startswith(b"\x1f\x8b"):
        data = gzip.decompress(data)
    lines = [line.strip() for line in re.split(rb"\r\n|\r|\n", data.removeprefix(b"\xef\xbb\xbf"))]
    # White space of Unicode may be around a line of text.
    full = [line for line in (text.decode().strip() for text in lines) if line and not line.startswith("#")]
    if "," in full[0] and full[0].split(",")[0].strip(' "').islower():
        return len(full) - 1
    return sum(line.split()[0].encode() in SIGHTING for line in full if line.partition("#")[0].split())


def same(one: bearslam.Problem, other: bearslam.Problem) -> bool:
    """Whether two problems say the same, bit for bit."""
    if (one.view_ids, one.landmark_ids, one.others) != (other.view_ids, other.landmark_ids, other.others):
        return False
    if (one.fixed_views, one.fixed_landmarks) != (other.fixed_views, other.fixed_landmarks):
        return False
    fields = ("sightings", "odometry", "pose_priors", "landmark_priors", "offsets")
    pairs = [(getattr(one, field), getattr(other, field)) for field in fields]
    if any((mine is None) != (yours is None) for mine, yours in [*pairs, (one.start, other.start)]):
        return False
    arrays = [
        (getattr(mine, name), getattr(yours, name)) for mine, yours in pairs if mine is not None for name in vars(mine)
    ]
    if one.start is not None and other.start is not None:
        arrays += zip(one.start, other.start, strict=True)
    return all(mine.shape == yours.shape and np.array_equal(mine, yours, equal_nan=True) for mine, yours in arrays)


def attempt(folder: Path, name: str, data: bytes) -> str:
    """Read a file: what came of it, in a word. Raises AssertionError, or whatever should not be raised."""
    path = folder / name
    path.write_bytes(data)
    start = time.perf_counter()
    try:
        problem = bearslam.load(path)
    except bearslam.InvalidInputError as error:
        text = str(error)
        assert text.startswith(f"{path}:"), f"no file in {text!r}"
        named = re.match(re.escape(str(path)) + r":\d+: ", text)
        assert named or WHOLE.search(text), f"no line in {text!r}"
        outcome = "line named" if named else "file refused"
    else:
        count = expected(problem, data)
        assert len(problem.sightings) == count, f"{len(problem.sightings)} sightings of {count} lines"
        outcome = "read"
    took = time.perf_counter() - start
    assert took < SECONDS, f"took {took:.1f} s"
    if outcome == "read" and problem.sightings.sigma is not None:
        try:
            text = g2o.render(problem)
        except bearslam.InvalidInputError:
            return "read, not written"
        assert same(g2o.parse(text.encode(), "again.g2o"), problem), "does not come back from g2o"
    return outcome


def run(seed: int, *, minutes: float = 0.0, files: int = 0, limit: int = 10) -> tuple[Counter[str], list[str]]:
    """Damage files until the time is over or so many are done: outcomes, and what went wrong."""
    rng = random.Random(seed)
    end = time.monotonic() + 60 * minutes
    outcomes: Counter[str] = Counter()
    failures: list[str] = []
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        Path(folder, "set").mkdir()
        warnings.simplefilter("error")
        while len(failures) < limit and (outcomes.total() < files or time.monotonic() < end):
            content = damaged_folder(rng) if rng.random() < FOLDERS else dict([damaged(rng)])
            try:
                if len(content) > 1:
                    outcomes[attempt_folder(Path(folder, "set"), content)] += 1
                else:
                    outcomes[attempt(Path(folder), *next(iter(content.items())))] += 1
            except Exception:  # noqa: BLE001 - whatever it is, it is a finding
                outcomes["wrong"] += 1
                shown = " ".join(f"{name} {data[:3000]!r} ({len(data)} bytes)" for name, data in content.items())
                failures.append(f"{shown}\n{traceback.format_exc(limit=-3)}")
    return outcomes, failures


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0, help="how long (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the damage (default: %(default)s)")
    options = parser.parse_args()
    outcomes, failures = run(options.seed, minutes=options.minutes)
    for failure in failures:
        print(failure)
    print(f"{outcomes.total()} files: " + ", ".join(f"{count} {what}" for what, count in outcomes.most_common()))
    return bool(failures)


if __name__ == "__main__":
    sys.exit(main())
