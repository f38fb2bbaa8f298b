"""Read COCO files of any size: the list of people in parts, their keypoints as arrays.

A number takes 8 bytes in an array, but 32 as a Python object, plus 5 to 20 for its text.
"""

import re
from collections.abc import Iterator
from contextlib import suppress
from itertools import accumulate, chain, islice
from mmap import mmap
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from hicp_lib.core.files import MAX_BYTES, read_json, regular_file
from hicp_lib.core.limited import raised

_START_OF_LIST = re.compile(rb'\A\s*(?=\[)|"annotations"\s*:\s*(?=\[)')
_BLOCK_BYTES = 2**22
_MAX_BYTES = 4 * MAX_BYTES  # of a file; arrays of its numbers need less than half
_MOST_STARTS = 8  # that are tried: a file may have many inner lists of that name
_EXPECTED = "give the path of a JSON file"


def read_people(path: str | Path) -> Any:
    """As `hicp_lib.core.files.read_json`, with lists of numbers that people have as `keypoints` as arrays.

    Parameters
    ----------
    path : str or Path
        The file: a list of objects, or an object that has one as `annotations`.

    Returns
    -------
    Any
        Only `keypoints` lists of plain numbers become arrays; the numbers are not checked.

    Raises
    ------
    InputError
        As `read_json`, but of a file four times as large.
    """
    people: list = []
    for part in _parts(path):
        some = _people_in(part)
        _make_arrays(some)
        people += some
    if isinstance(part, dict) and people:
        part["annotations"] = people
    return people if isinstance(part, list) else part


def read_people_in_parts(path: str | Path) -> Iterator[Any]:
    """As `read_json`, but a list comes as several shorter ones, so that memory need not hold all of it.

    Parameters
    ----------
    path : str or Path
        The file.

    Yields
    ------
    Any
        Lists, or once what the file holds instead of a list.

    Raises
    ------
    InputError
        As `read_people`; lists may have come before.
    """
    with open(regular_file(path, _EXPECTED, raised(_MAX_BYTES)), "rb") as file:
        is_list = file.read(_BLOCK_BYTES).lstrip()[:1] == b"["
    yield from _parts(path) if is_list else [read_people(path)]


def _parts(path: str | Path) -> Iterator[Any]:
    """The people of a file in several lists; last, all else in it, with the last people."""
    head, text, n = None, b"", 0  # the text before the list and from it on, the people read
    try:
        with open(regular_file(path, _EXPECTED, raised(_MAX_BYTES)), "rb") as file:
            while block := file.read(max(_BLOCK_BYTES, len(text))):
                text += block
                if head is None and (head := _before_list(text)) is not None:
                    text = text[len(head) :]
                end = text.rfind(b"}") + 1 if head is not None else 0
                with suppress(orjson.JSONDecodeError):  # ends within an object: more is needed
                    people = orjson.loads(text[:end] + b"]")[n > 0 :]
                    text, n = b"[0" + text[end:], n + len(people)
                    yield people
        last, n_before = orjson.loads((head or b"") + text), min(n, 1)
    except (OSError, orjson.JSONDecodeError):
        last, n_before = read_json(path), n  # raises the error
    del _people_in(last)[:n_before]
    yield last


def _before_list(text: bytes) -> bytes | None:
    """The text before a file's list of people, if that has begun."""
    for found in islice(_START_OF_LIST.finditer(text), _MOST_STARTS):
        with suppress(orjson.JSONDecodeError):  # of an inner object
            before = text[: found.end()]
            orjson.loads(before + b"0}" if before.strip() else b"0")
            return before
    return None


def _people_in(value: Any) -> list:
    people = value.get("annotations") if isinstance(value, dict) else value
    return people if isinstance(people, list) else []


def _make_arrays(people: list) -> None:
    """Make arrays of their lists of keypoints, if these contain nothing but numbers."""
    rows = [row for row in people if isinstance(row, dict) and isinstance(row.get("keypoints"), list)]
    lists = [row["keypoints"] for row in rows]
    ends = list(accumulate(map(len, lists), initial=0))
    # Memory pages of their own, which return to the system as soon as the lists are no longer needed.
    numbers = np.frombuffer(mmap(-1, max(8 * ends[-1], 1)), count=ends[-1])
    with suppress(OverflowError):  # an integer too large for floats
        if set(map(type, chain.from_iterable(lists))) <= {int, float}:  # numpy would accept True as 1
            numbers[:] = np.fromiter(chain.from_iterable(lists), float, ends[-1])
            for row, start, end in zip(rows, ends, ends[1:], strict=False):
                row["keypoints"] = numbers[start:end]
