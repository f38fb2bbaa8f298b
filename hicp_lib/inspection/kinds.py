"""Which kind of `data/kinds.toml` a file or a folder is, by its content: its name is not believed."""

import re
import tomllib
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.recordings.tum import names_poses

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".webp", ".tif", ".tiff")
_HEAD_BYTES, _HEAD_LINES = 8192, 40
_PRINTED = {*b"\t\r\n\f\x1a", *range(32, 256)}  # what texts are made of, in any code page
_NUMBER = re.compile(r"[-+]?[\d.]+(e[-+]?\d+)?", re.IGNORECASE)


@dataclass(frozen=True)
class Kind:
    """Of file, as `data/kinds.toml` explains its fields.

    Attributes
    ----------
    name, by, describe : str
    marks : list of str
    suffix : str
    each : bool
    given, needs : dict of str to str
    """

    name: str
    by: str
    describe: str
    marks: list[str]
    suffix: str = ""
    each: bool = False
    given: dict[str, str] = field(default_factory=dict)
    needs: dict[str, str] = field(default_factory=dict)


@cache
def _kinds() -> list[Kind]:
    return [
        Kind(**row) for row in tomllib.loads((DATA_DIR / "kinds.toml").read_text(encoding="utf-8"))["kind"]
    ]


def identify(path: Path) -> tuple[Kind, Path]:
    """The kind of a file or a folder.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Kind
    path : Path
        What to describe: of a folder that holds nothing else, its JSON file.

    Raises
    ------
    InputError
        If it cannot be read, or is of no kind that is known.
    """
    if path.is_dir():
        return _folder(path)
    if not path.is_file():
        raise InputError(f"{path}: is no file and no folder; check the path")
    with open(path, "rb") as file:
        head = file.read(_HEAD_BYTES)
    for kind in _kinds():
        if kind.by == "bytes" and any(
            re.match(mark, head.decode("latin-1"), re.DOTALL) for mark in kind.marks
        ):
            return kind, path
    if re.match(rb"(\xef\xbb\xbf)?\s*[\[{]", head):
        return _json(path), path
    if not head.strip() or set(head) - _PRINTED:
        raise InputError(f"{path}: is empty, or of no kind that is known; it begins with {head[:8]!r}")
    return _of("text", _marks_of_text(path, head.decode("utf-8-sig", errors="replace")), path), path


def _of(by: str, marks: set[str], path: Path) -> Kind:
    for kind in _kinds():
        if kind.by == by and marks.issuperset(kind.marks):
            return kind
    raise InputError(
        f"{path}: {by} of no kind that is known; it has {', '.join(sorted(marks)[:6]) or 'nothing'}"
    )


def _json(path: Path) -> Kind:
    value = read_json(path)
    if isinstance(value, dict):
        return _of("object", set(value), path)
    rows = value if all(isinstance(row, dict) for row in value) else []
    marks = set.intersection(*map(set, rows)) if rows else {"no objects"} if value == [] else set()
    return _of(
        "list", marks | (_marks_of_results(rows) if {"image_id", "keypoints"} <= marks else set()), path
    )


def _marks_of_results(rows: list[dict]) -> set[str]:
    """A name for an id is AlphaPose's way; flags, with -1, -1, 0 for what was not found, are OpenPose's."""
    flat = [row["keypoints"] for row in rows if isinstance(row["keypoints"], list)]
    are_flags = all(value in (0, 1) for of in flat for value in of[2::3])
    are_flags = are_flags and any(of[i : i + 3] == [-1, -1, 0] for of in flat for i in range(0, len(of), 3))
    return {"flags"} if are_flags else {"box"} if isinstance(rows[0]["image_id"], str) else set()


def _marks_of_text(path: Path, head: str) -> set[str]:
    """Columns of the first line, and what the first rows are made of."""
    lines = [line.strip() for line in head.splitlines()[:_HEAD_LINES] if line.strip()]
    rows = [[bool(_NUMBER.fullmatch(word)) for word in line.split()] for line in lines if line[0] != "#"]
    marks = {name.strip(' "') for name in lines[0].split(",")} | {
        f"row of {len(row)}" for row in rows[:2] if all(row)
    }
    marks |= {line.split("\t")[0].upper() for line in lines} & {"NO_OF_MARKERS"}
    marks |= {"named poses"} if names_poses(path) else set()
    return marks | ({"time and name"} if rows[:1] == [[True, False]] else set())


def _folder(folder: Path) -> tuple[Kind, Path]:
    names = {path.name for path in folder.iterdir()}
    images = {"an image" for name in names if name.lower().endswith(IMAGE_SUFFIXES)}
    files = [folder / n for n in sorted(names) if n.endswith(".json") and not n.endswith(".images.json")]
    try:
        return _of("folder", names | images, folder), folder
    except InputError:
        kind = _json(files[0]) if files else None
        if kind is None or len(files) > 1 and not kind.each:
            raise
        return kind, folder if kind.each else files[0]
