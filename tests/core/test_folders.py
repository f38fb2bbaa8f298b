"""Folders: hidden files pass for nothing, one command at a time fills one."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import atomic_path, remove_left, write_bytes
from hicp_lib.core.folders import filled_folder, listed, locked_folder


def test_lists_pass_over_hidden_files_and_sort_numbers_as_numbers(tmp_path):
    for name in ("b10.PNG", "b9.png", ".partial-0123456789abcdef.png", "a.txt"):
        (tmp_path / name).touch()
    assert listed(tmp_path) == ["a.txt", "b9.png", "b10.PNG"]
    assert listed(tmp_path, (".png", ".jpg")) == ["b9.png", "b10.PNG"]
    with pytest.raises(InputError, match="a.txt: cannot be read"):
        listed(tmp_path / "a.txt")


HOLD = "import sys; from hicp_lib.core.folders import locked_folder as l\nwith l(sys.argv[1]): {}"


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


def test_what_killed_writers_left_goes_and_what_is_written_stays(tmp_path):
    names = (".partial-" + 16 * "0", ".partial-" + 16 * "1", ".partial")
    left, old, mine = (tmp_path / "images" / name for name in names)
    for path in (left, mine):
        write_bytes(path, b"half")
    (old / "rgb").mkdir(parents=True)
    with atomic_path(tmp_path / "a.txt") as written, filled_folder(tmp_path / "new") as inner:
        (inner / "b.txt").write_text("b")
        written.write_text("a")
        with locked_folder(tmp_path):
            assert [path.exists() for path in (left, old, mine)] == [False, False, True]
    assert (tmp_path / "a.txt").read_text() == "a" and os.listdir(tmp_path / "new") == ["b.txt"]


def test_without_locks_only_old_temporary_files_go(tmp_path, monkeypatch):
    fcntl = pytest.importorskip("fcntl")
    monkeypatch.setattr(fcntl, "flock", lambda *_: os.open(tmp_path / "no lock", os.O_RDONLY))
    old, new = (tmp_path / (".partial-" + 16 * digit) for digit in "01")
    for path in (old, new):
        write_bytes(path, b"half")
    os.utime(old, (0, 0))
    remove_left(tmp_path)
    assert [path.exists() for path in (old, new)] == [False, True]


def test_a_folder_is_filled_wholly_or_not_at_all(tmp_path):
    out = tmp_path / "out"
    for hidden in ([], [".DS_Store"]):
        for name in hidden:
            out.mkdir()
            (out / name).touch()
        with pytest.raises(OSError, match=r"out/a\.txt'$"), filled_folder(out) as inner:
            (inner / "b.txt").write_text("b")
            (inner / "a.txt").touch(exist_ok=False)
            os.open(inner / "a.txt", os.O_CREAT | os.O_EXCL)
        with pytest.raises(InputError, match=rf"^{out}/a is none$"), filled_folder(out) as inner:
            raise InputError(f"{inner}/a is none")
        assert (os.listdir(out) if out.exists() else []) == hidden
    with filled_folder(out) as inner:
        (inner / "images").mkdir()
        (inner / "images" / "1.png").touch()
        (inner / "a.txt").touch()
        assert listed(out) == []
    assert listed(out) == ["a.txt", "images"] and listed(out / "images") == ["1.png"]
    with pytest.raises(InputError, match="out: is there already"), filled_folder(out):
        pass
