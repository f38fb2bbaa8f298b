"""Read COCO files of any size in blocks, converting keypoints to arrays on the way.

A number takes 8 bytes in an array, but 32 as a Python object, plus 5 to 20 for its text.
"""

import re
import secrets
from collections.abc import Iterator
from itertools import accumulate, chain, count
from mmap import mmap
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import orjson

from hicp_lib.core.files import MAX_BYTES, read_json, regular_file
from hicp_lib.core.limited import raised

_KEY = b'"keypoints"'
_LIST = re.compile(rb'(?<=[{,\s])"keypoints"\s*:\s*\[([^][{}"]+)\]')
_BLOCK_BYTES = 2**24
_MAX_BYTES = 4 * MAX_BYTES  # of a file; arrays of its numbers need less than half


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
    mark, parts, arrays, places = secrets.token_hex(16), list[bytes](), list[np.ndarray](), count()
    place = f'"keypoints":"{mark}%d"'.encode()
    try:
        with open(regular_file(path, "give the path of a JSON file", raised(_MAX_BYTES)), "rb") as file:
            for block in _blocks(file):
                found = _arrays(_LIST.findall(block))
                parts.append(_LIST.sub(lambda _: place % next(places), block) if found else block)
                arrays += found
        data = orjson.loads(b"".join(parts))
    except (OSError, orjson.JSONDecodeError):
        return read_json(path)  # raises the error
    people = data.get("annotations") if isinstance(data, dict) else data
    rows = [row for row in people if isinstance(row, dict)] if isinstance(people, list) else []
    marked = [row for row in rows if isinstance(of := row.get("keypoints"), str) and of.startswith(mark)]
    for row in marked:
        row["keypoints"] = arrays[int(row["keypoints"].removeprefix(mark))]
    return data if len(marked) == len(arrays) else read_json(path)


def _blocks(file: BinaryIO) -> Iterator[bytes]:
    """A file's content in blocks that do not split lists of keypoints shorter than a block."""
    rest = b""
    while block := file.read(_BLOCK_BYTES):
        rest += block
        cut = max(rest.rfind(_KEY) - 1, 0) or max(len(rest) - len(_KEY), 0)
        yield rest[:cut]
        rest = rest[cut:]
    yield rest


def _arrays(texts: list[bytes]) -> list[np.ndarray]:
    """Arrays from the texts of lists; None if one contains anything but numbers."""
    lists = orjson.loads(b"[[" + b"],[".join(texts) + b"]]")
    if not set(map(type, chain.from_iterable(lists))) <= {int, float}:  # numpy would accept True as 1
        return []
    ends = list(accumulate(map(len, lists)))
    # Memory pages of their own, which return to the system as soon as the lists are no longer needed.
    numbers = np.frombuffer(mmap(-1, max(8 * ends[-1], 1)), count=ends[-1])
    numbers[:] = np.fromiter(chain.from_iterable(lists), float, ends[-1])
    return np.split(numbers, ends[:-1])
