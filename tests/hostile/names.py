"""Names and texts that are commands to a terminal, a browser or a shell."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from hicp_lib.recordings.qualisys import MotionCapture, write_tsv
from tests.hostile.annotations import put
from tests.hostile.case import Case
from tests.hostile.good import READERS, write_c3d

TEXTS = {
    "clears the screen": "\x1b[2J\x1b[Hok",
    "sets the title": "\x1b]0;title\x07",
    "C1 control": "\x9b31mred",
    "a new line": "a\nhicp: all is well",
    "carriage return": "bad\rgood",
    "backspaces": "bad\b\b\bgood",
    "right to left": "a\u202egnp.exe",
    "a script": "<svg onload=alert(1)>",
    "the end of a script": "</script><script>alert(1)</script>",
    "a shell": "$(touch x); `touch x`",
    "an option": "--out",
    "a space and a hash": "a b#c",
}


def _rename(text: str, content: bytes | None, folder: Path) -> None:
    path = folder / "pictures" / "a.png"
    path.write_bytes(path.read_bytes() if content is None else content)
    path.rename(folder / "pictures" / f"{text.replace('/', '|')}.png")


def _renamed_recording(text: str, folder: Path) -> None:
    (folder / "open3d").rename(folder / text.replace("/", "|"))


def _name_everywhere(text: str, folder: Path) -> None:
    _rename(text, None, folder)
    for name in ("annotations.json", "results.json"):
        value = (folder / name).read_text().replace('"a.png"', json.dumps(text.replace("/", "|") + ".png"))
        (folder / name).write_text(value)


def _changed(name: str, change, folder: Path) -> None:
    (folder / name).write_text(json.dumps(change(json.loads((folder / name).read_text()))))


def _markers(write, name: str, text: str, folder: Path) -> None:
    (folder / name).unlink()
    points = np.full((40, 2, 3), 0.5)
    write(folder / name, MotionCapture(np.arange(40) / 100, (text, "wrist"), points, 100.0))


def _undecodable(folder: Path) -> None:
    os.rename(folder / "pictures" / "a.png", os.fsencode(folder / "pictures") + b"/\xff\xfe.png")


def cases() -> Iterator[Case]:
    detect, draw = READERS["pictures"][0], READERS["draw detections"][0]
    for kind, text in TEXTS.items():
        name = text.replace("/", "|")
        common = {"exits": (0, 2), "notes": True}
        yield Case(
            f"name: of a picture: {kind}", detect + " --by-image", partial(_rename, text, None), **common
        )
        yield Case(f"name: of a broken picture: {kind}", detect, partial(_rename, text, b"no"), **common)
        yield Case(
            f"name: in annotations: {kind}",
            READERS["create annotations"][0],
            partial(_name_everywhere, text),
            **common,
        )
        yield Case(f"name: drawn: {kind}", draw, partial(_name_everywhere, text), **common)
        by_image = READERS["evaluate annotations"][0] + " --by-image"
        yield Case(f"name: evaluated: {kind}", by_image, partial(_name_everywhere, text), **common)
        yield Case(f"name: not there: {kind}", ["inspect", f"./{name}"])
        yield Case(
            f"name: of a detector: {kind}",
            ["detect", "--detector", text, "--images", "pictures", "--out", "out.json"],
        )
        yield Case(f"name: of a parameter: {kind}", ["report", "-p", text, "1", "--results", "out"])
        yield Case(f"name: of a profile: {kind}", ["report", "--profile", text, "--results", "out"])
        yield Case(f"name: of a notebook: {kind}", ["report", "--only", text, "--results", "out"])
        yield Case(f"name: of a weight: {kind}", ["models", "fetch", f"x{text}"])
        yield Case(
            f"name: of a group: {kind}", [*READERS["evaluate annotations"][0].split()[:-1], f"x{text}"]
        )
        keypoints = partial(_changed, "annotations.json", put("categories", 0, "keypoints", 0, value=text))
        yield Case(f"name: of a keypoint: {kind}", READERS["create annotations"][0], keypoints)
        yield Case(f"name: of a keypoint, inspected: {kind}", "inspect annotations.json", keypoints)
        yield Case(
            f"name: of a TSV marker: {kind}",
            "inspect mocap.tsv",
            partial(_markers, write_tsv, "mocap.tsv", text),
            **common,
        )
        yield Case(
            f"name: of a C3D marker: {kind}",
            "inspect mocap.c3d",
            partial(_markers, write_c3d, "mocap.c3d", text),
            **common,
        )
        yield Case(f"name: of an Open3D folder: {kind}", ["record", "import", "out", "--open3d", f"./{name}"],
                   partial(_renamed_recording, text), exits=(0,), notes=True)  # fmt: skip
        making = ["record", "import", f"out/{name}", "--open3d", "open3d"]
        yield Case(f"name: of a recording to make: {kind}", making, exits=(0, 2), notes=True)
    yield Case("name: of a picture: no text", detect, _undecodable, exits=(0, 2), notes=True)
    yield Case("name: drawn: no text", draw, _undecodable, exits=(0, 2), notes=True)
    yield Case("name: inspected: no text", "inspect pictures", _undecodable, exits=(0, 2))
