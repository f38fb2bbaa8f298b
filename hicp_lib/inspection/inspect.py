"""Identify a file or a folder, among the kinds in `data/kinds.toml`, by its content and not by its name."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.files import read_json
from hicp_lib.core.folders import listed
from hicp_lib.detectors.runtime.to_file import IMAGE_SUFFIXES
from hicp_lib.inspection import people, pixels, recorded
from hicp_lib.inspection.facts import Facts, tables, under_name
from hicp_lib.recordings.tum import names_poses

_HEAD_BYTES, _HEAD_LINES = 8192, 40
_PRINTED = {*b"\t\r\n\f\x1a", *range(32, 256)}  # characters of texts, in any code page
_NUMBER = re.compile(r"[-+]?[\d.]+(e[-+]?\d+)?", re.IGNORECASE)


_MODULES = {"people": people, "pixels": pixels, "recorded": recorded}
Kind = dict[str, Any]  # a row of data/kinds.toml, which explains its keys


def identify(path: Path) -> tuple[Kind, Path]:
    """The kind of a file or a folder.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Kind
    path : Path
        What to describe: for a folder with a single JSON file, that file.

    Raises
    ------
    InputError
        If it cannot be read, or is of an unknown kind.
    """
    if path.is_dir():
        return _folder(path)
    if not path.is_file():
        raise InputError(f"{path}: is neither a file nor a folder; check the path")
    with open(path, "rb") as file:
        head = file.read(_HEAD_BYTES)
    for kind in tables()["kind"]:
        if kind["by"] == "bytes" and re.match("|".join(kind["marks"]), head.decode("latin-1"), re.DOTALL):
            return kind, path
    if re.match(rb"(\xef\xbb\xbf)?\s*[\[{]", head):
        return _json(path), path
    if not head.strip() or set(head) - _PRINTED:
        wrong = f"is of no kind that is known; it begins with {head[:8]!r}" if head.strip() else "is empty"
        raise InputError(f"{path}: {wrong}")
    return _of("text", _marks_of_text(path, head.decode("utf-8-sig", errors="replace")), path), path


def _of(by: str, marks: set[str], path: Path) -> Kind:
    for kind in tables()["kind"]:
        if kind["by"] == by and marks.issuperset(kind["marks"]):
            return kind
    held = ", ".join(mark[:40] for mark in sorted(marks)[:6]) or "nothing"
    raise InputError(f"{path}: {by} of no kind that is known; it has {held}")


def _json(path: Path) -> Kind:
    value = read_json(path)
    if isinstance(value, dict):
        return _of("object", set(value), path)
    rows = value if all(isinstance(row, dict) for row in value) else []
    marks = set.intersection(*map(set, rows)) if rows else {"no objects"} if value == [] else set()
    marks |= _marks_of_results(rows) if {"image_id", "keypoints"} <= marks else set()
    return _of("list", marks, path)


def _marks_of_results(rows: list[dict]) -> set[str]:
    """Names as ids are typical of AlphaPose; flags, with -1, -1, 0 for missing keypoints, of OpenPose."""
    flat = [row["keypoints"] for row in rows if isinstance(row["keypoints"], list)]
    are_flags = all(value in (0, 1) for of in flat for value in of[2::3])
    are_flags = are_flags and any(of[i : i + 3] == [-1, -1, 0] for of in flat for i in range(0, len(of), 3))
    return {"flags"} if are_flags else {"box"} if isinstance(rows[0]["image_id"], str) else set()


def _marks_of_text(path: Path, head: str) -> set[str]:
    """Columns of the first line, and types of the first rows."""
    lines = [line.strip() for line in head.splitlines()[:_HEAD_LINES] if line.strip()]
    rows = [[bool(_NUMBER.fullmatch(word)) for word in line.split()] for line in lines if line[0] != "#"]
    marks = {name.strip(' "') for name in lines[0].split(",")}
    marks |= {f"row of {len(row)}" for row in rows[:2] if all(row)} | {
        line.split("\t")[0].upper() for line in lines
    }
    marks |= {"time and name"} if rows[:1] == [[True, False]] else set()
    return marks | ({"named poses"} if names_poses(path) else set())


def _folder(folder: Path) -> tuple[Kind, Path]:
    names = set(listed(folder))
    images = {"an image" for name in names if name.lower().endswith(IMAGE_SUFFIXES)}
    files = [folder / n for n in sorted(names) if n.endswith(".json") and not n.endswith(".images.json")]
    try:
        return _of("folder", names | images, folder), folder
    except InputError:
        kind = _json(files[0]) if files else {}
        if not kind.get("each") and len(files) != 1:
            raise
        return kind, folder if kind.get("each") else files[0]


def inspect(path: str | Path) -> Facts:
    """Say what a file or a folder is, and what it needs to be used.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Facts
        With `problem` if the kind is known but the content cannot be used.

    Raises
    ------
    InputError
        If it cannot be read, or is of an unknown kind.
    """
    kind, path = identify(Path(path))
    try:
        facts = _describe(kind, path)
    except Exception as error:  # the libraries raise many kinds
        facts = Facts(problem=one_line(error).removeprefix(f"{path}: "))
    fixed = {} if facts.problem or facts.kind else kind.get("needs", {})
    needs = {of: f"{fixed.get(of, '')} {facts.needs.get(of, '')}".strip() for of in {**fixed, **facts.needs}}
    return replace(facts, path=str(path), kind=facts.kind or kind["name"], needs=needs)


def _describe(kind: Kind, path: Path) -> Facts:
    describe = getattr(_MODULES[kind["describe_in"]], kind["describe"])
    suffix, each, given = kind.get("suffix", ""), kind.get("each"), kind.get("given", {})
    if path.is_dir() or not each and suffix in ("", path.suffix.lower()):
        return describe(path, **given)
    with under_name(path, f"file{suffix or '.json'}") as other:
        facts = describe(other.parent if each else other, **given)
    notes = [f"commands take it under a name that ends in {suffix}"] if suffix else []
    return replace(facts, notes=[*facts.notes, *notes])
