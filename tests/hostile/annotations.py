"""Annotations, results and files of other tools in JSON that say what cannot be."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from tests.hostile.case import Case
from tests.hostile.good import READERS

# What no JSON file of these should be, whichever it is.
TEXTS = {
    "nothing but a brace": b"{",
    "100,000 lists in each other": b"[" * 100_000,
    "100,000 objects in each other": b'{"a":' * 100_000,
    "UTF-16": '[{"image_id": 1}]'.encode("utf-16"),
    "no text": b"\xff\xfe\xfd",
    "a number of a million digits": b"[" + b"9" * 1_000_000 + b"]",
    "null": b"null",
    "a text": b'"annotations"',
    "a number": b"7",
    "a list of nulls": b"[null, null]",
    "a list of lists": b"[[], [[]]]",
    "true": b"true",
    "an empty object": b"{}",
    "NaN": b"NaN",
    "two values": b"[] []",
}
IN_JSON = ("create annotations", "keypoint map", "import openpose", "import alphapose", "import mmpose",
           "import coco", "export", "evaluate detections", "draw detections", "calibration fit",
           "import open3d", "check camera")  # fmt: skip
# A map of no names, and an object without people, are files of nobody.
MEANS_NOBODY = {("keypoint map", "an empty object"), ("import openpose", "an empty object")}

Change = Callable[[Any], Any]


def put(*where: Any, value: Any) -> Change:
    """A change of one value; `where` leads to it."""

    def change(content: Any) -> Any:
        at = content
        for step in where[:-1]:
            at = at[step]
        at[where[-1]] = value
        return content

    return change


HUGE = 10**20
ODD_NUMBERS = {
    "NaN": float("nan"),
    "inf": float("inf"),
    "1e308": 1e308,
    "a text": "7",
    "null": None,
    "a list": [1],
}
ODD_IDS = {
    "of 20 digits": HUGE,
    "a fraction": 1.5,
    "a text": "one",
    "null": None,
    "an object": {},
    "true": True,
}
ODD_NAMES = {
    "out of the folder": "../annotations.json",
    "absolute": "/etc/passwd",
    "with NUL": "a\0.png",
    "empty": "",
    "a folder": ".",
    "a number": 3,
    "null": None,
    "of 5,000 characters": "a" * 5000 + ".png",
}


def annotation_changes() -> Iterator[tuple[str, Change]]:
    for kind, name in ODD_NAMES.items():
        yield f"file name {kind}", put("images", 0, "file_name", value=name)
    for kind, value in ODD_IDS.items():
        yield f"image id {kind}", put("images", 0, "id", value=value)
        yield f"person's image id {kind}", put("annotations", 0, "image_id", value=value)
    for kind, value in ODD_NUMBERS.items():
        yield f"keypoint {kind}", put("annotations", 0, "keypoints", 0, value=value)
        yield f"flag {kind}", put("annotations", 0, "keypoints", 2, value=value)
        yield f"box {kind}", put("annotations", 0, "bbox", 2, value=value)
        yield f"area {kind}", put("annotations", 0, "area", value=value)
        yield f"width {kind}", put("images", 0, "width", value=value)
    yield "width of 1e12", put("images", 0, "width", value=10**12)
    yield "box of negative size", put("annotations", 0, "bbox", value=[40, 30, -240, -340])
    yield "box of two numbers", put("annotations", 0, "bbox", value=[40, 30])
    yield "keypoints of 7 numbers", put("annotations", 0, "keypoints", value=[1.0] * 7)
    yield "keypoints of 1,000,000 numbers", put("annotations", 0, "keypoints", value=[1.0] * 999_999)
    yield "keypoint names twice", put("categories", 0, "keypoints", value=["nose"] * 136)
    yield "keypoint names of numbers", put("categories", 0, "keypoints", value=list(range(136)))
    yield "images an object", put("images", value={})
    yield "the same image twice", put("images", 1, "id", value=1)


def result_changes() -> Iterator[tuple[str, Change]]:
    for kind, value in ODD_IDS.items():
        yield f"image id {kind}", put(0, "image_id", value=value)
    for kind, value in ODD_NUMBERS.items():
        yield f"keypoint {kind}", put(0, "keypoints", 0, value=value)
        yield f"score {kind}", put(0, "score", value=value)
    yield "score of -1e300", put(0, "score", value=-1e300)
    yield "keypoints of 4 numbers", put(0, "keypoints", value=[1.0] * 4)
    yield "an image nobody knows", put(0, "image_id", value=77)


def _change(target: str, change: Change, folder: Path) -> None:
    path = folder / target
    path.write_text(json.dumps(change(json.loads(path.read_text()))))


def _write(target: str, content: bytes, folder: Path) -> None:
    if target.startswith("rec"):
        pass
    (folder / target).write_bytes(content)


# Not needed by the command, or no fault: what is right is not to fail, and what else is tested elsewhere.
TOLERATED = ("area", "width", "the same image twice", "box", "true", "file name", "flag", "keypoint 1e308",
             "score", "null")  # fmt: skip

# What is exported is not compared with images; an import says whom it leaves out.
TAKES_OTHERS = (("export", "an image nobody knows"), ("import coco", "an image nobody knows"),
                ("import coco", "image id a text"))  # fmt: skip


def _exits(kind: str) -> tuple[int, ...]:
    return (0, 2) if any(part in kind for part in TOLERATED) else (2,)


def cases() -> Iterator[Case]:
    for reader in IN_JSON:
        command, target = READERS[reader]
        for kind, content in TEXTS.items():
            exits = (0, 2) if (reader, kind) in MEANS_NOBODY else (2,)
            yield Case(f"JSON: {reader}: {kind}", command, partial(_write, target, content), exits=exits)
    for kind, change in annotation_changes():
        make = partial(_change, "annotations.json", change)
        for reader in ("create annotations", "evaluate annotations", "draw detections"):
            yield Case(
                f"annotations: {reader}: {kind}", READERS[reader][0], make, exits=_exits(kind), notes=True
            )
        yield Case(f"annotations: inspect: {kind}", "inspect annotations.json", make, exits=(0, 2))
    for kind, change in result_changes():
        make = partial(_change, "results.json", change)
        for reader in ("evaluate detections", "export", "draw detections", "import coco"):
            exits = (0,) if (reader, kind) in TAKES_OTHERS else _exits(kind)
            yield Case(f"results: {reader}: {kind}", READERS[reader][0], make, exits=exits, notes=True)
        yield Case(f"results: inspect: {kind}", "inspect results.json", make, exits=(0, 2))
