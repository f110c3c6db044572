# SPDX-License-Identifier: MIT OR Apache-2.0
"""Results of sweeps in files and tables: nothing is lost, and damage is named."""

import csv
import io
import random
import sys
import tracemalloc
import zipfile

import numpy as np
import pytest

import bearslam
from bearslam import InvalidInputError, SweepResult

ARGUMENTS = {
    "layout": ["mixed", "trajectory"],
    "views": [3, 6],
    "landmarks": [9, 4],
    "noise": np.radians([0.1, 0.5, 1 / 3]),
    "trials": 5,
    "seed": 2**64 - 1,
    "chunk": 1,
}


@pytest.fixture(scope="module")
def result():
    return bearslam.sweep(**ARGUMENTS)


@pytest.fixture(scope="module")
def part():
    """Of one layout, and not all done."""

    def progress(stage, done, total):
        if done > 4:
            raise KeyboardInterrupt

    arguments = {**ARGUMENTS, "layout": "mixed"}
    return bearslam.sweep(**arguments, progress=progress, threads=1)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "sweep.npz"


def test_files_hold_everything(result, part, path):
    assert not part.complete
    for whole in (result, part, result.merge(bearslam.sweep(**{**ARGUMENTS, "seed": 3}))):
        whole.save(path)
        again = SweepResult.load(path)
        assert again.identical(whole, times=True)
        assert again.grid.single == whole.grid.single
        assert repr(again) == repr(whole)
        for start in whole.start:
            np.testing.assert_array_equal(again.mean_seconds[start], whole.mean_seconds[start])
            np.testing.assert_array_equal(again.heading_ratio[start], whole.heading_ratio[start])
        first = path.read_bytes()
        again.save(str(path))
        assert path.read_bytes() == first


def test_the_table_can_be_read_by_others(result, tmp_path):
    path = tmp_path / "sweep.csv"
    result.save(path)
    first = path.read_bytes()
    result.save(path)
    assert path.read_bytes() == first
    assert [line.split(":")[0] for line in path.read_text().splitlines()[:8]] == [
        "# bearslam sweep 1",
        *(f"# {name}" for name in ("layouts", "noise", "views", "landmarks", "starts", "trials", "seeds")),
    ]
    rows = list(csv.DictReader(line for line in path.read_text().splitlines() if not line.startswith("#")))
    assert len(rows) == 2 * 3 * 2 * 2 * 3
    row = rows[-1]
    place = [row[name] for name in ("layout", "noise", "noise_deg", "views", "landmarks", "start")]
    assert place == ["trajectory", repr(ARGUMENTS["noise"][2].item()), "0.33333333333333", "6", "4", "solve"]
    assert float(row["failure_rate"]) == result.failure_rate["solve"][1, 2, 1, 1]
    for quantity, name in enumerate(("position", "heading", "position_ratio", "heading_ratio")):
        bins = result.tally.bins()
        mine = bins[(bins[:, 0] == 71) & (bins[:, 1] == quantity), 2:]
        assert row[f"{name}_bins"] == " ".join(f"{place}:{size}" for place, size in mine.tolist())
    assert float(row["heading_p90"]) == result.heading_p90["solve"][1, 2, 1, 1]
    assert (float(row["failure_low"]), float(row["failure_high"])) == tuple(
        result.failure_interval()["solve"][1, 2, 1, 1]
    )
    frame = pytest.importorskip("pandas").read_csv(path, comment="#")
    assert frame["trials"].sum() == 2 * 3 * 2 * 2 * 3 * 5


def test_other_endings_are_refused(result, tmp_path):
    with pytest.raises(InvalidInputError, match=r"path: expected a name that ends in .npz or .csv, got"):
        result.save(tmp_path / "sweep.json")
    for name in ("sweep.json", "sweep.csv"):  # tables are written, not read
        with pytest.raises(InvalidInputError, match=r"path: expected a name that ends in .npz, got"):
            SweepResult.load(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        SweepResult.load(tmp_path / "none.npz")
    with pytest.raises(FileNotFoundError):
        result.save(tmp_path / "none" / "sweep.csv")


def replaced(**entries):
    """Other arrays in an archive."""

    def edit(path):
        with np.load(path) as archive:
            arrays = dict(archive)
        arrays.update({name: change(arrays[name]) for name, change in entries.items()})
        np.savez(path, **{name: array for name, array in arrays.items() if array is not None})

    return edit


def set_to(where, value):
    def change(array):
        array[where] = value
        return array

    return change


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda path: path.write_bytes(b""), "expected a file that save has written"),
        (lambda path: path.write_bytes(b"view,landmark\n" * 9), "expected a file that save has written"),
        (lambda path: path.write_bytes(path.read_bytes()[:-100]), "expected a file that save has written"),
        (lambda path: np.savez(path, a=np.ones(3)), "expected the result of a sweep"),
        (replaced(bins=lambda _: None), "expected the result of a sweep: .*bins"),
        (replaced(noise=lambda a: a.astype(object)), "expected a file that save has written: Object arrays"),
        (replaced(noise=lambda a: a.astype(str)), "expected noise of kind 'f' and 1 dimensions, got 'U' and 1"),
        (replaced(format=lambda _: np.array("bearslam sweep 2")), "expected the format 'bearslam sweep 1', got"),
        (replaced(single=lambda _: np.array(True)), "expected one layout, got 2"),
        (replaced(views=set_to(0, 2)), r"views\[0\]: expected an integer from 3"),
        (replaced(noise=set_to(0, np.nan)), r"noise\[0\]: expected a number of at least 0"),
        (replaced(start=set_to(0, "solve")), "starts: expected every value once"),
        (replaced(trials=lambda _: np.array(4)), "expected seeds, and as many trials from each start, 4 at most"),
        (replaced(seeds=lambda a: a[:0]), "expected seeds"),
        (replaced(counts=lambda a: a[:1]), "expected counts of shape"),
        (replaced(counts=set_to((0, 0, 0, 0, 0, 0), 4)), "expected seeds, and as many trials from each start"),
        (replaced(counts=set_to((0, 0, 0, 0, 1, 1), 9)), "more failures than trials in group 1"),
        (replaced(counts=set_to((0, 0, 0, 0, 1, 4), -9)), "a count below 0 in group 1"),
        (replaced(bins=set_to((0, 3), 0)), "expected rows of group, quantity, bin and size as bins"),
        (replaced(bins=set_to((0, 0), 1000)), "expected rows of group, quantity, bin and size as bins"),
        (replaced(bins=set_to((0, 3), 10)), "more values of position than maps in group 0"),
        (replaced(bins=lambda a: a[::-1]), "expected ascending bins, got others"),
        (replaced(bins=lambda a: a[:, :3]), "expected rows of group, quantity, bin and size as bins"),
    ],
)
def test_a_bad_archive_is_refused(result, tmp_path, edit, message):
    path = tmp_path / "sweep.npz"
    result.save(path)
    edit(path)
    with pytest.raises(InvalidInputError, match=f"sweep.npz: {message}"):
        SweepResult.load(path)


def test_an_array_that_declares_more_than_there_is_is_refused_before_memory_is_taken(result, path):
    """A header may declare gigabytes; the compressed zeros behind it may even be there."""
    result.save(path)
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<i8", "fortran_order": False, "shape": (2**28, 4)})
    members["bins.npy"] = header.getvalue() + bytes(32)
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    tracemalloc.start()
    with pytest.raises(
        InvalidInputError, match=r"sweep.npz: expected bins of at most 32 bytes, got one that declares 8"
    ):
        SweepResult.load(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 10**7


def test_no_damage_gets_another_error_or_another_result(result, path):
    result.save(path)
    whole = path.read_bytes()
    dice = random.Random(1)
    refused = 0
    for trial in range(150):
        spoiled = bytearray(whole)
        if trial % 2:
            del spoiled[dice.randrange(len(whole)) :]
        else:
            for _ in range(dice.choice([1, 100])):
                spoiled[dice.randrange(len(whole))] = dice.randrange(256)
        path.write_bytes(spoiled)
        try:
            again = SweepResult.load(path)
        except InvalidInputError as error:
            assert str(error).startswith(f"{path}")
            refused += 1
        else:
            assert again.identical(result, times=True)
    assert refused > 75


def test_archives_are_plain_arrays(result, tmp_path):
    path = tmp_path / "sweep.npz"
    result.save(path)
    assert zipfile.is_zipfile(path)
    with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as archive:
        assert archive["counts"].shape == (2, 3, 2, 2, 3, 6)
        assert archive["bins"][:, 3].sum() == result.tally.sizes.sum()


def test_pandas(result):
    pytest.importorskip("pandas")
    frame = result.to_pandas()
    assert len(frame) == 72
    one = frame[
        (frame["layout"] == "mixed")
        & (frame["noise_deg"] == 0.5)
        & (frame["views"] == 6)
        & (frame["landmarks"] == 9)
        & (frame["start"] == "random")
    ].iloc[0]
    where = (0, 1, 1, 0)
    assert one["trials"] == 5
    assert one["failures"] == result.failures["random"][where]
    assert one["position_median"] == result.position_median["random"][where]
    assert one["mean_iterations"] == result.mean_iterations["random"][where]
    assert one["noise"] == ARGUMENTS["noise"][1]


def test_xarray(result, part):
    pytest.importorskip("xarray")
    data = result.to_xarray()
    assert dict(data.sizes) == {"layout": 2, "noise": 3, "views": 2, "landmarks": 2, "start": 3}
    chosen = data["failure_rate"].sel(layout="trajectory", start="projective", views=6)
    np.testing.assert_array_equal(chosen, result.failure_rate["projective"][1, :, 1])
    assert data.attrs["seeds"] == [str(2**64 - 1)]
    assert dict(part.to_xarray().sizes)["layout"] == 1
    assert int(part.to_xarray()["trials"].isel(start=0).sum()) == part.done.sum()


@pytest.mark.parametrize(("module", "method"), [("pandas", "to_pandas"), ("xarray", "to_xarray")])
def test_what_is_not_installed_is_named(result, module, method, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=f"pip install {module}"):
        getattr(result, method)()
