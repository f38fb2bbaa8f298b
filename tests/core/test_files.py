"""Files: only regular ones are read and written, and writes are whole."""

import errno
import os

import pytest

from hicp_lib.core import files
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import (
    atomic_path,
    read_bytes,
    read_checked,
    read_json,
    sha256_file,
    write_bytes,
    write_checked,
)
from hicp_lib.core.folders import listed


@pytest.fixture(params=["folder", "pipe", "socket", "device"])
def irregular(request, tmp_path):
    path = tmp_path / "x"
    if request.param == "folder":
        path.mkdir()
    elif request.param == "pipe":
        os.mkfifo(path)
    elif request.param == "socket":
        socket = pytest.importorskip("socket")
        server = socket.socket(socket.AF_UNIX)
        server.bind(str(path))
        request.addfinalizer(server.close)
    else:
        path.symlink_to("/dev/zero")
    return path


@pytest.mark.parametrize("read", [lambda path: read_bytes(path, "give a file"), read_json, sha256_file])
def test_only_regular_files_are_read(irregular, read):
    with pytest.raises(InputError, match="x: is a (folder|named pipe|socket|device); give"):
        read(irregular)


def test_only_regular_files_are_written(irregular):
    with pytest.raises(InputError, match="x: is a .*; give the name of a file to write"):
        write_bytes(irregular, b"new")
    assert not irregular.is_file() and os.path.exists(irregular)


@pytest.mark.parametrize("name", ["a\0b", "\ud800", "none"])
def test_a_name_that_no_file_has_is_told(tmp_path, name):
    with pytest.raises(InputError, match="cannot be read"):
        read_bytes(f"{tmp_path}/{name}", "give a file")


def test_write_protected_files_stay(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"kept")
    path.chmod(0o444)
    with pytest.raises(InputError, match="a: is write-protected"):
        write_bytes(path, b"new")
    assert path.read_bytes() == b"kept"


def test_of_a_link_the_target_is_replaced(tmp_path):
    target, link = tmp_path / "there" / "a", tmp_path / "b"
    write_bytes(target, b"old")
    link.symlink_to(target)
    write_bytes(link, b"new")
    assert link.is_symlink() and target.read_bytes() == b"new"
    assert listed(tmp_path) == ["b", "there"] and listed(target.parent) == ["a"]


def test_a_large_file_is_read_if_it_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "MAX_BYTES", 3.0)
    write_bytes(tmp_path / "a", b"four")
    with pytest.raises(InputError, match="HICP_LIMITS=4"):
        read_bytes(tmp_path / "a", "")
    monkeypatch.setenv("HICP_LIMITS", "2")
    assert read_bytes(tmp_path / "a", "") == b"four"


def test_a_sparse_file_is_refused_at_once(tmp_path):
    (tmp_path / "a").touch()
    os.truncate(tmp_path / "a", 10**12)
    with pytest.raises(InputError, match="has 1e.03 GB"):
        read_json(tmp_path / "a")


def test_a_full_disk_is_told_by_the_name_asked_for(tmp_path):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OSError, match="No space") as caught, atomic_path(tmp_path / "a"):
        full()
    assert caught.value.filename == str(tmp_path / "a") and listed(tmp_path) == os.listdir(tmp_path) == []


def test_what_is_not_checked_later_is_on_the_disk_before_it_is_there(tmp_path, monkeypatch):
    synced = []
    monkeypatch.setattr(os, "fsync", lambda descriptor: synced.append((tmp_path / "a").exists()))
    write_bytes(tmp_path / "a", b"new")
    assert synced == [False]
    write_checked(tmp_path / "b", b"kept")
    assert synced == [False] and read_checked(tmp_path / "b") == b"kept"
    (tmp_path / "b").write_bytes(b"")
    assert read_checked(tmp_path / "b") is None
