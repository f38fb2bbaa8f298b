"""Folders: hidden files pass for nothing, one command at a time fills one."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import write_bytes
from hicp_lib.core.folders import listed, locked_folder


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
