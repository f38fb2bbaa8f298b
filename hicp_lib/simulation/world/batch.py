"""Output folders of batches, which can be resumed."""

from collections.abc import Callable, Iterable
from itertools import chain
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json, sha256_file, write_json
from hicp_lib.core.folders import kept_beside, remove_inside


def check_numbers(**limits: tuple[object, int, int]) -> None:
    """Refuse numbers out of range.

    Parameters
    ----------
    **limits : tuple
        By its name: what was given, the lowest and the highest number allowed.

    Raises
    ------
    InputError
        For the first that is not an integer or out of range.

    Examples
    --------
    >>> check_numbers(seed=(3, 0, 10))
    """
    for name, (value, low, high) in limits.items():
        if not isinstance(value, int | np.integer) or not low <= value <= high:
            raise InputError(f"{name} is {value!r}; expected a whole number from {low} to {high}")


def keep_parts(
    out: Path, parts_dir: str, index: str, stamp: dict, n: int, made: Callable[[int], Iterable[Path]],
    once: Iterable[str],
) -> None:  # fmt: skip
    """Keep finished parts of an interrupted run; drop parts made with other settings, or beyond `n`.

    The stored stamp records which files were made: how many parts, and the names in `once`. All other files
    are left alone.

    Parameters
    ----------
    out : Path
        Output folder.
    parts_dir : str
        Name of its subfolder that records finished parts.
    index : str
        Name of its file that marks the output as complete; it is removed.
    stamp : dict
        What results depend on, JSON-able; stored there.
    n : int
        Number of parts.
    made : callable
        Files of each.
    once : iterable of str
        Names of files, relative to `out`, that are made for all together.

    Raises
    ------
    InputError
        If the folder holds something else, or a file where one would be written.
    """
    stamp_name = f"{parts_dir}/stamp.json"
    before = kept_beside(out, stamp_name, stamp=dict, n=int, once=list)
    (out / index).unlink(missing_ok=True)
    is_same, n_before = before["stamp"] == stamp, before["n"]
    for path in chain.from_iterable(map(made, range(n if is_same else 0, n_before))):
        path.unlink(missing_ok=True)
    remove_inside(out, [] if is_same else before["once"])
    for path in chain.from_iterable(map(made, range(n_before, n))):
        if path.exists():
            raise InputError(f"{path}: was not made by this command; take it away, or give another folder")
    write_json(out / stamp_name, {"stamp": stamp, "n": n, "once": list(once)})


def write_part(content: dict, part: Path, *files: Path) -> None:
    """Record that a part is finished, after writing its files.

    Parameters
    ----------
    content : dict
        Further data, JSON-able.
    part : Path
        The file of the record.
    *files : Path
        Hashed with it.
    """
    write_json(part, content | {"sha256": [sha256_file(path) for path in files]})


def read_part(part: Path, *files: Path) -> dict | None:
    """The content of `write_part`; None if it, or a file, is missing or damaged."""
    try:
        content = read_json(part)
        return content if content["sha256"] == [sha256_file(path) for path in files] else None
    except (InputError, KeyError, TypeError):
        return None
