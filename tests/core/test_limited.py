"""A reader in a limited process: its answer, its refusal, or one line why it has neither."""

from __future__ import annotations

import os
import time
from pathlib import Path

import psutil
import pytest

from hicp_lib.core import limited
from hicp_lib.core.errors import InputError
from hicp_lib.core.limited import limited_child, limited_parts, raised


def answer(path, *more):
    print("chatter of a library")
    os.write(1, b"and of native code\n")
    return [Path(path).name, *more]


def refuse(path):
    raise InputError(f"{path}: is none")


def spin(path):
    while True:
        pass


def go_on(path):
    """Computes for longer than it may at one thing, but says that it goes on."""
    for _ in range(8):
        start_s = time.process_time()
        while time.process_time() < start_s + 0.2:
            pass
        limited.went_on()
    return "done"


def never_end(path):
    while True:
        limited.went_on()


def grow(path):
    return len(bytes(3 * 2**30))


def crash(path):
    os.abort()


def err(path):
    raise KeyError("header")


def count(path, n, end):
    """Computes for longer in all than it may at one thing."""
    for k in range(n):
        start_s = time.process_time()
        while time.process_time() < start_s + 0.2:
            pass
        yield bytes([k]) * 100_000
    {"refuses": refuse, "crashes": crash, "goes": leave, "is done": str}[end](path)


def leave(path):
    os._exit(0)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(bytes(100))
    return path


def test_what_it_answers_and_refuses(file):
    assert limited_child(file, answer, 2, [None, 0.5]) == ["a.bin", 2, [None, 0.5]]
    assert limited_child(file.parent, answer) == [file.parent.name]
    with pytest.raises(InputError, match="a.bin: is none"):
        limited_child(file, refuse)


@pytest.mark.parametrize(
    ("end", "said"),
    [("refuses", "a.bin: is none"), ("crashes", "gave up .SIGABRT."), ("goes", "gave up"), ("is done", "")],
)
def test_parts_come_one_by_one_and_then_what_is_wrong(file, monkeypatch, end, said):
    monkeypatch.setenv("HICP_LIMITS", "0.1")
    parts = limited_parts(file, count, 3, end)
    for k in range(3):
        assert next(parts) == bytes([k]) * 100_000
    with pytest.raises(InputError, match=said) if said else pytest.raises(StopIteration):
        next(parts)


def test_who_has_enough_parts_ends_the_process(file):
    before = psutil.Process().children()  # of other tests
    parts = limited_parts(file, count, 10**6, "is done")
    assert next(parts)
    process = [child for child in psutil.Process().children() if child not in before]
    parts.close()
    assert process and not any(one.is_running() for one in process)


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (spin, "a.bin: reading takes more than 0.4 s; .*HICP_LIMITS=4"),
        (never_end, "a.bin: reading takes more than"),
        (grow, "a.bin: reading takes more than 0.08. GB of memory; .*HICP_LIMITS=4"),
        (crash, "a.bin: its reader gave up .SIGABRT."),
        (err, "a.bin: its reader gave up .KeyError: 'header'."),
        (leave, "a.bin: its reader gave up"),
    ],
)
def test_what_it_cannot_tell_is_told_in_one_line(file, monkeypatch, function, said):
    monkeypatch.setenv("HICP_LIMITS", "0.1")
    start_s = time.monotonic()
    with pytest.raises(InputError, match=said) as told:
        limited_child(file, function)
    assert "\n" not in str(told.value) and time.monotonic() < start_s + 60


def test_who_goes_on_has_longer(file, monkeypatch):
    monkeypatch.setenv("HICP_LIMITS", "0.1")  # 0.4 s at one thing; as many more in all as the file is long
    file.write_bytes(bytes(600_000))
    assert limited_child(file, go_on) == "done"


def test_the_limit_can_be_raised(file, monkeypatch):
    monkeypatch.setenv("HICP_LIMITS", "8")
    assert limited_child(file, grow) == 3 * 2**30 and raised(2) == 16
    for nonsense in ("0", "-1", "nan", "inf", "much"):
        monkeypatch.setenv("HICP_LIMITS", nonsense)
        with pytest.raises(InputError, match="HICP_LIMITS is"):
            raised(2)


@pytest.mark.parametrize("kind", ["missing", "fifo", "device", "fifo in a folder", "empty folder", "loop"])
def test_only_files_are_read(tmp_path, kind):
    path = tmp_path / "x"
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "loop":
        path.symlink_to(path)
    elif "folder" in kind:
        path.mkdir()
        if "fifo" in kind:
            os.mkfifo(path / "x.db3")
    with pytest.raises(InputError, match="x: is neither a file nor a folder of files"):
        limited_child(path, answer)


def test_nothing_is_imported_from_the_working_folder(file, monkeypatch):
    for name in ("json.py", "numpy.py", "resource.py", "hicp_lib.py"):
        (file.parent / name).write_text("open('planted', 'w')")
    monkeypatch.chdir(file.parent)
    assert limited_child(file, answer) == ["a.bin"]
    assert not Path("planted").exists()
