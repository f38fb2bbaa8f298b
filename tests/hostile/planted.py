"""Modules planted where one works: none of them is ever executed."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from tests.hostile.case import Case
from tests.hostile.good import DETECT, DRAW, MMPOSE
from tests.hostile.judge import MARKER
from tests.hostile.special_files import prepare

MODULES = """papermill jupyter_book multiprocessing ezc3d resource numpy random onnxruntime json sitecustomize
usercustomize cv2 mediapipe absl rosbags pip click hicp_lib sqlite3 pandas open3d distributed tornado zipfile
struct signal ctypes psutil tempfile""".split()
COMMANDS = {
    "check of a C3D": "record check rec",
    "inspect of a C3D": "inspect mocap.c3d",
    "import of a bag": "record import out --bag x.bag",
    "detect": f"{DETECT} --out out.json --workers 2",
    "MediaPipe": "detect --detector mediapipe --images pictures --out out.json",
    "a network of one's own": f"{MMPOSE} --out out.json",
    "render": "scenes render out --n 2 --workers 2",
    "draw": f"{DRAW} --out out.html",
    "list of models": "models list",
    "doctor": "doctor",
}


def plant(where: str, folder: Path) -> None:
    """Modules that leave a mark."""
    prepare(folder)
    marker = folder.parent / MARKER
    (folder / where).mkdir(exist_ok=True)
    for name in MODULES:
        (folder / where / f"{name}.py").write_text(
            f"open({str(marker)!r}, 'a').write({name!r})\nraise SystemExit(7)\n"
        )
    (folder / ".git").mkdir()
    config = f"[core]\n\tfsmonitor = touch {marker}; false\n\thooksPath = .\n\trepositoryformatversion = 0\n"
    (folder / ".git" / "config").write_text(config)
    for name in ("git", "python", "python3", "pip"):
        program = folder / name
        program.write_text(f"#!/bin/sh\ntouch {marker}\n")
        program.chmod(0o755)


def cases() -> Iterator[Case]:
    for kind, command in COMMANDS.items():
        exits = (0, 1, 2) if kind == "doctor" else (0, 2) if "check" in kind else (0,)
        yield Case(f"planted: {kind}", command, partial(plant, "."), exits=exits, notes=True, fresh=True)
