"""Outputs where something else lies: inputs, a user's own files, devices, pipes, links, what is read-only."""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from hicp_lib.datasets.subsets import create_hicp
from tests.hostile.case import FULL_DISK, Case
from tests.hostile.good import CREATE, DETECT, DRAW, EVALUATE, FIT, IMPORT, LIFT
from tests.hostile.special_files import circle, listening

# Commands that write one file, TARGET.
WRITERS = {
    "detect": f"{DETECT} --out TARGET.json",
    "detect csv": f"{DETECT} --out TARGET.csv",
    "import": f"{IMPORT} --out TARGET.json",
    "export": "export --detections results.json --format coco --out TARGET.json",
    "draw": f"{DRAW} --out TARGET.html",
    "evaluate": f"{EVALUATE} --out TARGET.json",
    "evaluate parquet": f"{EVALUATE} --out TARGET.parquet",
    "calibration fit": f"{FIT} --out TARGET.csv",
    "lift": f"{LIFT} --out TARGET.parquet",
}
# Commands that fill a folder, TARGET.
FILLERS = {
    "create": f"{CREATE} --out TARGET",
    "render": "scenes render TARGET --n 1",
    "simulate": "record simulate mocap TARGET --n-frames 1",
    "import open3d": "record import TARGET --open3d open3d",
    "import bag": "record import TARGET --bag x.bag",
    "draw PNG": f"{DRAW} --out TARGET",
}


def device(path: Path) -> None:
    os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, 7))  # always full


def read_only(path: Path) -> None:
    path.write_text("mine")
    path.chmod(0o444)


def folder_of_mine(path: Path) -> None:
    path.mkdir()
    (path / "mine.txt").write_text("mine")


def link_to_nothing(path: Path) -> None:
    path.symlink_to("/nowhere/at/all")


TARGETS: dict[str, Callable[[Path], None]] = {
    "a pipe": lambda path: os.mkfifo(path), "a device": device, "a socket": listening, "read-only": read_only,
    "a folder": folder_of_mine, "a link to nothing": link_to_nothing, "a circle of links": circle,
}  # fmt: skip


# Where a user may keep something in a folder that a command fills.
PLACES = ("mine.txt", "images/mine.jpg", "rgb/mine.jpg", "basic/images/mine.jpg", "basic/mine.txt",
          "0001.png", "annotations.json", "rgb.txt")  # fmt: skip


def _target(name: str, put: Callable[[Path], None], folder: Path) -> None:
    put(folder / name)


def _full_disk(folder: Path) -> None:
    """A file system of 16 kB."""
    (folder / FULL_DISK).mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", str(folder / FULL_DISK)], check=True)


def may_mount() -> bool:
    return os.geteuid() == 0 and shutil.which("mount") is not None


def _mine_in(place: str, folder: Path) -> None:
    path = folder / place
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("mine")


def _after_another(folder: Path) -> None:
    """A data set made before, and beside its pictures one of the user's."""
    create_hicp(folder / "annotations.json", folder / "pictures", folder / "hicp", min_pixels=20_000)
    shutil.copy(folder / "pictures" / "b.jpg", folder / "hicp" / "basic" / "images" / "mine.jpg")
    (folder / "hicp" / "basic" / "notes.txt").write_text("mine")
    (folder / "hicp" / "mine.txt").write_text("mine")


def _mine_stays(*names: str) -> Callable[[Path, str], str | None]:
    def check(folder: Path, printed: str) -> str | None:
        gone = [name for name in names if not (folder / name).is_file()]
        return f"{gone} are gone" if gone else None

    return check


def _absent(name: str, folder: Path, printed: str) -> str | None:
    return f"{name} is left half-filled" if (folder / name).exists() else None


def _inputs_within(folder: Path) -> None:
    (folder / "out").mkdir()
    for name in ("pictures", "annotations.json"):
        shutil.move(folder / name, folder / "out")


def _inputs_in_basic(folder: Path) -> None:
    (folder / "out" / "basic").mkdir(parents=True)
    shutil.move(folder / "pictures", folder / "out" / "basic" / "images")
    shutil.move(folder / "annotations.json", folder / "out" / "basic")


def cases() -> Iterator[Case]:
    for writer, command in WRITERS.items():
        suffix = "." + command.rpartition(".")[2]
        for kind, put in TARGETS.items():
            made = partial(_target, "target" + suffix, put)
            yield Case(
                f"destroying: {writer}: onto {kind}", command.replace("TARGET", "target"), made, notes=True
            )
        if may_mount():
            full = command.replace("TARGET", f"{FULL_DISK}/x")
            yield Case(f"destroying: {writer}: onto a full disk", full, _full_disk, notes=True, exits=(0, 2))
    for filler, command in FILLERS.items():
        for kind in ("a pipe", "a device", "a socket", "read-only", "a link to nothing", "a circle of links"):
            made = partial(_target, "target", TARGETS[kind])
            yield Case(
                f"destroying: {filler}: into {kind}", command.replace("TARGET", "target"), made, notes=True
            )
        hidden, command_out = partial(_mine_in, "out/.DS_Store"), command.replace("TARGET", "out")
        yield Case(f"destroying: {filler}: beside .DS_Store", command_out, hidden, notes=True, exits=(0,))
        for place in PLACES:
            made = partial(_mine_in, f"out/{place}")
            name = f"destroying: {filler}: beside {place}"
            yield Case(name, command.replace("TARGET", "out"), made, notes=True, exits=(0, 2))
        if may_mount() and filler not in ("render", "simulate"):  # which render for seconds before they write
            full = command.replace("TARGET", f"{FULL_DISK}/x")
            gone = None if filler == "create" else partial(_absent, f"{FULL_DISK}/x")  # which goes on there
            yield Case(f"destroying: {filler}: onto a full disk", full, _full_disk, notes=True, check=gone)
    for places in ("rec", "open3d", "pictures", "."):
        for filler in ("import open3d", "import bag", "draw PNG"):
            if (places, filler) != (".", "draw PNG"):
                yield Case(
                    f"destroying: {filler}: into {places}",
                    FILLERS[filler].replace("TARGET", places),
                    notes=True,
                )
    report = "report --profile quick --results TARGET"
    for command in (report, *(FILLERS[filler] + "/below" for filler in ("create", "import bag", "draw PNG"))):
        made = partial(_target, "target", circle)
        yield Case(f"destroying: circle: {command}", command.replace("TARGET", "target"), made, notes=True)
    create = "dataset create --annotations out/annotations.json --images out/pictures --out out"
    yield Case("destroying: create: inputs within", create, _inputs_within, exits=(0, 2),
               check=_mine_stays("out/annotations.json", "out/pictures/a.png"))  # fmt: skip
    create = "dataset create --annotations out/basic/annotations.json --images out/basic/images --out out"
    yield Case("destroying: create: inputs in basic", create, _inputs_in_basic,
               check=_mine_stays("out/basic/annotations.json", "out/basic/images/a.png"))  # fmt: skip
    create = f"{CREATE} --out hicp --min-pixels 30000"
    mine = ("hicp/basic/images/mine.jpg", "hicp/basic/notes.txt", "hicp/mine.txt")
    yield Case(
        "destroying: create: another before",
        create,
        _after_another,
        exits=(0, 2),
        check=_mine_stays(*mine),
        notes=True,
    )
    same = {
        "export": "export --detections results.json --format coco --out results.json",
        "import": f"{IMPORT} --out results.json",
        "import over annotations": f"{IMPORT} --out annotations.json",
        "evaluate": f"{EVALUATE} --out results.json",
    }
    for name, command in same.items():
        yield Case(f"destroying: {name} over its input", command)
