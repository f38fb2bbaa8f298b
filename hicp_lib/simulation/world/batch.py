"""Folders that many results at once are written to."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json, write_json


def check_numbers(**limits: tuple[object, int, int]) -> None:
    """Refuse numbers out of range.

    Parameters
    ----------
    **limits : tuple
        By its name: what was given, the lowest and the highest number allowed.

    Raises
    ------
    InputError
        For the first that is no whole number or lies outside.

    Examples
    --------
    >>> check_numbers(seed=(3, 0, 10))
    """
    for name, (value, low, high) in limits.items():
        if not isinstance(value, int | np.integer) or not low <= value <= high:
            raise InputError(f"{name} is {value!r}; expected a whole number from {low} to {high}")


def keep_parts(out: Path, parts_dir: str, stamp: dict, made: Iterable[str]) -> None:
    """Keep what an interrupted run finished; drop what was made with something else.

    Parameters
    ----------
    out : Path
        Folder that is written to.
    parts_dir : str
        Name of the folder in it that says what is finished.
    stamp : dict
        What results depend on, JSON-able; kept there.
    made : iterable of str
        Patterns of the files that are made, relative to `out`.
    """
    stamp_file = out / parts_dir / "stamp.json"
    if stamp_file.exists() and read_json(stamp_file) == stamp:
        return
    for pattern in (f"{parts_dir}/*.json", *made):
        for path in out.glob(pattern):
            path.unlink()
    write_json(stamp_file, stamp)


def check_output(out: Path, marker: str, purpose: str, made: str) -> None:
    """Refuse a folder that holds something else.

    Parameters
    ----------
    out : Path
    marker : str
        Name of a folder that is only in what was made here.
    purpose, made : str
        What the folder is for and what is done to files there, in the words of the message.

    Raises
    ------
    InputError
        If `out` is a file, or holds files and no `marker`.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; give a folder {purpose}")
    if out.is_dir() and any(out.iterdir()) and not (out / marker).is_dir():
        raise InputError(f"{out}: holds files that were not {made}; give an empty or new folder")
