"""Which kind of `data/kinds.toml` a file or a folder is, by its content: its name is not believed."""

import tomllib
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_bytes, read_json
from hicp_lib.recordings.tum import names_poses

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".webp", ".tif", ".tiff")
_HEAD_BYTES, _HEAD_LINES = 8192, 40
_PRINTED = {*b"\t\r\n\f\x1a", *range(32, 256)}  # what texts are made of, in any code page


@dataclass(frozen=True)
class Kind:
    """Of file, as `data/kinds.toml` explains its fields.

    Attributes
    ----------
    name, by, describe : str
    marks : list of str
    at : int
    suffix : str
    each : bool
    given, needs : dict of str to str
    """

    name: str
    by: str
    describe: str
    marks: list[str]
    at: int = 0
    suffix: str = ""
    each: bool = False
    given: dict[str, str] = field(default_factory=dict)
    needs: dict[str, str] = field(default_factory=dict)


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
    head = read_bytes(path, "check the path")[:_HEAD_BYTES] if path.exists() else None
    if not head or not head.strip():
        raise InputError(
            f"{path}: {'is no file and no folder; check the path' if head is None else 'is empty'}"
        )
    is_text = not set(head) - _PRINTED
    for kind in _kinds("bytes"):
        if head[kind.at :].startswith(tuple(mark.encode("latin-1") for mark in kind.marks)):
            if len(kind.marks[0]) > 1 or not is_text:  # a single byte says something of binary files only
                return kind, path
    if head.removeprefix(b"\xef\xbb\xbf").lstrip()[:1] in (b"{", b"["):
        return _json(path), path
    if is_text:
        return _of("text", _marks_of_text(path, head.decode("utf-8-sig", errors="replace")), path), path
    raise InputError(f"{path}: is of no kind that is known; it begins with {head[:8]!r}")


@cache
def _kinds(by: str) -> list[Kind]:
    rows = tomllib.loads((DATA_DIR / "kinds.toml").read_text(encoding="utf-8"))["kind"]
    return [kind for row in rows if (kind := Kind(**row)).by == by]


def _of(by: str, marks: set[str], path: Path) -> Kind:
    for kind in _kinds(by):
        if marks.issuperset(kind.marks):
            return kind
    raise InputError(
        f"{path}: {by} of no kind that is known; it has {', '.join(sorted(marks)[:6]) or 'nothing'}"
    )


def _json(path: Path) -> Kind:
    value: Any = read_json(path)
    if isinstance(value, dict):
        return _of("object", set(value), path)
    if not all(isinstance(row, dict) for row in value):
        raise InputError(f"{path}: list of no kind that is known; expected a list of objects")
    marks = set.intersection(*map(set, value)) if value else set()
    if {"image_id", "keypoints"} <= marks:
        marks |= _marks_of_results(value)
    elif value and not _of("list", marks, path).marks:
        raise InputError(f"{path}: list of no kind that is known; it has {', '.join(sorted(marks)[:6])}")
    return _of("list", marks, path)


def _marks_of_results(rows: list[dict]) -> set[str]:
    """Names for `image_id` are AlphaPose's; flags, and -1, -1, 0 for what was not found, are OpenPose's."""
    lists = [row["keypoints"] for row in rows if isinstance(row["keypoints"], list)]
    scores, triples = (
        {str(value) for of in lists for value in of[2::3]},
        [of[i : i + 3] for of in lists for i in range(0, len(of), 3)],
    )
    marks = {"box"} if isinstance(rows[0]["image_id"], str) and "file_name" not in rows[0] else set()
    return marks | (
        {"flags for scores"} if scores <= {"0", "1", "0.0", "1.0"} and [-1, -1, 0] in triples else set()
    )


def _marks_of_text(path: Path, head: str) -> set[str]:
    """Columns of the first line, and what the first rows are made of."""
    lines = [line.strip() for line in head.splitlines()[:_HEAD_LINES] if line.strip()]
    rows = [line.split() for line in lines if not line.startswith("#")]
    marks = {name.strip(' "') for name in lines[0].split(",")}
    marks |= {"NO_OF_MARKERS" for line in lines if line.split("\t")[0].upper() == "NO_OF_MARKERS"}
    marks |= {"named poses"} if names_poses(path) else set()
    marks |= {f"rows of {len(row)} numbers" for row in rows[:2] if _are_numbers(row)}
    if rows and len(rows[0]) == 2 and _are_numbers(rows[0][:1]) and not _are_numbers(rows[0][1:]):
        marks.add("rows of a number and a name")
    return marks


def _are_numbers(words: list[str]) -> bool:
    try:
        return bool([float(word) for word in words])
    except ValueError:
        return False


def _folder(folder: Path) -> tuple[Kind, Path]:
    names = {path.name for path in folder.iterdir()}
    marks = names | (
        {"images by their suffix"} if any(n.lower().endswith(IMAGE_SUFFIXES) for n in names) else set()
    )
    files = [folder / n for n in sorted(names) if n.endswith(".json") and not n.endswith(".images.json")]
    try:
        return _of("folder", marks, folder), folder
    except InputError:
        kind = _json(files[0]) if files else None
        if kind is None or len(files) > 1 and not kind.each:
            raise
        return kind, folder if kind.each else files[0]
