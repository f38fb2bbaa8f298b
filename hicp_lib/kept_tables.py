"""Tables kept on disk: what was made once of the same inputs with the same code is read, not made again.

A notebook that is opened after a report so shows the report's numbers, and soon, whatever threads its
process has.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from hicp_lib.files import cache_dir, sha256_bytes, write_bytes
from hicp_lib.provenance import data_sha256, digest, input_sha256, installed_sha256, library_sha256


def kept(make: Callable[..., pd.DataFrame], *arguments: Any, **named: Any) -> pd.DataFrame:
    """The table ``make(*arguments, **named)``, made only if it is not in the cache.

    The key is all it depends on: the function, its inputs by content, the library, its data and what is
    installed. A recording counts by the names, sizes and times of its files. A damaged file is never an
    answer: the table is made again. What is returned was read from the file, the first time too.

    Parameters
    ----------
    make : a function of `hicp_lib` whose result follows from its inputs

    Raises
    ------
    TypeError
        For an input whose content is not known.
    """
    given = inspect.signature(make).bind(*arguments, **named)
    given.apply_defaults()
    key = digest([make.__module__, make.__qualname__, _content(given.arguments), _code()])
    path = cache_dir() / "tables" / make.__name__ / f"{key[:32]}.bin"
    table = _read(path)
    if table is None:
        made = pa.BufferOutputStream()
        pq.write_table(pa.Table.from_pandas(make(*arguments, **named)), made)
        payload = made.getvalue().to_pybytes()
        write_bytes(path, sha256_bytes(payload).encode() + payload)
        table = _read(path)
    return table


def _read(path: Path) -> pd.DataFrame | None:
    """The table of a file that is a SHA-256 and the Parquet it is of; None if it is absent or damaged."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    stated, payload = content[:64], content[64:]
    if sha256_bytes(payload).encode() != stated:
        return None
    return pq.read_table(pa.BufferReader(payload)).to_pandas()


@cache
def _code() -> list[str]:
    return [library_sha256(), data_sha256(), installed_sha256()]


def _content(value: Any) -> Any:
    """What JSON can hold and differs where `value` differs."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        if value.dtype.hasobject:
            return _content(value.tolist())
        return [str(value.dtype), value.shape, sha256_bytes(np.ascontiguousarray(value).tobytes())]
    if isinstance(value, pd.DataFrame):
        hashes = pd.util.hash_pandas_object(value).to_numpy()
        return [[str(name), str(kind)] for name, kind in value.dtypes.items()] + [
            sha256_bytes(hashes.tobytes())
        ]
    if isinstance(value, Path):
        state = value.stat()
        return input_sha256(value) if value.is_dir() else [value.name, state.st_size, state.st_mtime_ns]
    if isinstance(value, Mapping):
        return [[_content(name), _content(item)] for name, item in value.items()]
    if isinstance(value, Sequence):
        return [_content(item) for item in value]
    if is_dataclass(value):
        return [type(value).__name__, {f.name: _content(getattr(value, f.name)) for f in fields(value)}]
    raise TypeError(f"the content of {type(value).__name__} is not known; no table of it can be kept")
