# SPDX-License-Identifier: MIT OR Apache-2.0
"""Files that are replaced in one step or not at all."""

import os
import stat

import pytest

from bearslam.io.atomic import replacing


def test_the_file_is_there_when_the_block_ends(tmp_path):
    path = tmp_path / "new"
    with replacing(path) as file:
        file.write(b"half")
        assert not path.exists()
    assert path.read_bytes() == b"half"
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~umask
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("failure", [OSError("disk full"), KeyboardInterrupt()])
def test_a_failure_leaves_the_old_file_as_it_was(tmp_path, failure):
    path = tmp_path / "old"
    path.write_bytes(b"whole")

    def write():
        with replacing(path) as file:
            file.write(b"ha")
            raise failure

    with pytest.raises(type(failure)):
        write()
    assert path.read_bytes() == b"whole"
    assert list(tmp_path.iterdir()) == [path]


def test_mode_and_links_stay(tmp_path):
    path, link = tmp_path / "file", tmp_path / "link"
    path.write_bytes(b"old")
    path.chmod(0o640)
    link.symlink_to(path)
    with replacing(link) as file:
        file.write(b"new")
    assert link.is_symlink()
    assert path.read_bytes() == b"new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_pipes_are_written_to_and_not_replaced(tmp_path):
    path = tmp_path / "pipe"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    with replacing(path) as file:
        file.write(b"gone")
    assert os.read(reader, 10) == b"gone"
    os.close(reader)
    assert stat.S_ISFIFO(path.stat().st_mode)


def test_a_folder_is_an_error(tmp_path):
    with pytest.raises(IsADirectoryError), replacing(tmp_path) as file:
        file.write(b"")
