"""Files that are none: where a file is read, a pipe, a device, a socket, a folder, a circle of links."""

from __future__ import annotations

import os
import shutil
import socket
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from tests.hostile.case import Case
from tests.hostile.good import READERS

# A picture of many that cannot be read is told and passed over; so is motion capture beside a recording.
PASSES_OVER = ("pictures", "draw picture", "check c3d", "check tsv")

NOT_GOOD = ("detect person model", "task bundle")  # which have no good file


def expected(reader: str) -> dict:
    """Exit codes and notes that are right where a reader's file is bad."""
    return {"notes": True, "exits": (0, 2)} if reader in PASSES_OVER else {}


def prepare(folder: Path) -> None:
    """What readers need beside the good folder."""
    (folder / "set").mkdir()
    shutil.copy(folder / "annotations.json", folder / "set")
    (folder / "set" / "images").symlink_to("../pictures")
    for name in ("mocap.c3d", "mocap.tsv"):
        shutil.copy(folder / name, folder / "rec")


def fifo(path: Path) -> None:
    os.mkfifo(path)


def zero(path: Path) -> None:
    path.symlink_to("/dev/zero")


def listening(path: Path) -> None:
    here = os.getcwd()
    os.chdir(path.parent)  # the names of sockets are short
    try:
        socket.socket(socket.AF_UNIX).bind(path.name)
    finally:
        os.chdir(here)


def a_folder(path: Path) -> None:
    path.mkdir()


def circle(path: Path) -> None:
    path.symlink_to(path.name)


def nothing(path: Path) -> None:
    path.write_bytes(b"")


def vast(path: Path) -> None:
    with open(path, "wb") as file:
        file.truncate(200 * 2**30)


def noise(path: Path) -> None:
    path.write_bytes(bytes(range(256)) * 64)


KINDS = {
    "fifo": fifo, "endless device": zero, "socket": listening, "folder": a_folder, "circle of links": circle,
    "0 bytes": nothing, "200 GB of zeros": vast, "noise": noise,
}  # fmt: skip


def _replace(target: str, put, folder: Path) -> None:
    prepare(folder)
    path = folder / target
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
    put(path)


def cases() -> Iterator[Case]:
    for reader, (command, target) in READERS.items():
        if reader not in NOT_GOOD:  # else what is wrong with a change of it would show nothing
            yield Case(f"good: {reader}", command, prepare, exits=(0,), notes=True)
        for kind, put in KINDS.items():
            if reader == "detect folder" and put in (a_folder, nothing, noise):
                continue
            make = partial(_replace, target, put)
            yield Case(f"special file: {reader}: {kind}", command, make, **expected(reader))
