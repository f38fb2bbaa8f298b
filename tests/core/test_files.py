"""Files: only regular ones are read and written, writes are whole, folders are filled by one process."""

import errno
import os
import subprocess
import sys
import time

import pytest

from hicp_lib.core import files
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import (
    atomic_path,
    listed,
    locked_folder,
    read_bytes,
    read_checked,
    read_json,
    sha256_file,
    write_bytes,
    write_checked,
)


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


def test_lists_pass_over_hidden_files_and_sort_numbers_as_numbers(tmp_path):
    for name in ("b10.PNG", "b9.png", ".partial-0123456789abcdef.png", "a.txt"):
        (tmp_path / name).touch()
    assert listed(tmp_path) == ["a.txt", "b9.png", "b10.PNG"]
    assert listed(tmp_path, (".png", ".jpg")) == ["b9.png", "b10.PNG"]
    with pytest.raises(InputError, match="a.txt: cannot be read"):
        listed(tmp_path / "a.txt")


HOLD = "import sys; from hicp_lib.core.files import locked_folder as l\nwith l(sys.argv[1]): {}"


def held(folder, then="print(1, flush=True); sys.stdin.read()"):
    """A process that holds a folder until its input ends."""
    started = [sys.executable, "-c", HOLD.format(then), str(folder)]
    return subprocess.Popen(started, stdin=subprocess.PIPE, stdout=subprocess.PIPE)


def test_one_process_at_a_time_fills_a_folder(tmp_path):
    with held(tmp_path / "a") as process:
        assert process.stdout.readline() == b"1\n"
        with pytest.raises(InputError, match="another command writes there"), locked_folder(tmp_path / "a"):
            pass
        process.kill()
        process.wait()
        with locked_folder(tmp_path / "a"):
            assert os.listdir(tmp_path / "a") == []  # no file of the lock's


def test_a_folder_in_the_cache_is_waited_for(tmp_path, monkeypatch):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path))
    with held(tmp_path / "a") as process:
        assert process.stdout.readline() == b"1\n"
        with held(tmp_path / "a", "print(2, flush=True)") as second:
            time.sleep(0.5)
            assert second.poll() is None
            process.communicate()
            assert second.communicate()[0] == b"2\n"


def test_a_folder_made_for_nothing_goes_again(tmp_path):
    for folder in (tmp_path / "new", tmp_path):
        with pytest.raises(ZeroDivisionError), locked_folder(folder):
            raise ZeroDivisionError
    assert os.listdir(tmp_path) == []
    (tmp_path / "a").touch()
    with pytest.raises(InputError, match="a: is a file, or lies in one"), locked_folder(tmp_path / "a"):
        pass


def test_old_temporary_files_go_and_those_in_use_stay(tmp_path):
    old, new, mine = (
        tmp_path / "images" / name for name in (".partial-" + 16 * "0", ".partial-" + 16 * "1", ".partial")
    )
    for path in (old, new, mine):
        write_bytes(path, b"half")
    for path in (old, mine):
        os.utime(path, (0, 0))
    with locked_folder(tmp_path):
        assert [path.exists() for path in (old, new, mine)] == [False, True, True]
