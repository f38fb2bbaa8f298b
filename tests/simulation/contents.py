"""What a result is down to its bytes, and the results that a process keeps, held against their keys."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from types import FunctionType, MethodType
from typing import Any

import numpy as np
from scipy import sparse


def content(*values: Any) -> str:
    """SHA-256 of values to the last bit: arrays with their types, dataclasses, what functions enclose."""
    return hashlib.sha256(b"\0".join(_parts(values))).hexdigest()


def _parts(value: Any) -> list[bytes]:
    if isinstance(value, np.ndarray):
        return [f"{value.dtype} {value.shape}".encode(), np.ascontiguousarray(value).tobytes()]
    if isinstance(value, sparse.sparray):
        return _parts((value.data, value.indices, value.indptr))
    if isinstance(value, (list, tuple)):
        return [b"[", *(part for item in value for part in _parts(item)), b"]"]
    if isinstance(value, dict):
        return _parts([*value.items()])
    if is_dataclass(value) and type(value).__name__ != "Motion":  # which is drawn as far as it was asked for
        return _parts([getattr(value, field.name) for field in fields(value)])
    if isinstance(value, MethodType):
        return _parts((value.__func__, value.__self__))
    if isinstance(value, FunctionType):
        cells = [cell.cell_contents for cell in value.__closure__ or ()]
        return [value.__qualname__.encode(), *_parts(cells)]
    if isinstance(value, functools.partial):
        return _parts((value.func, value.args, value.keywords))
    known = (bool, int, float, str, bytes, Path, np.generic, type(None))
    return [repr((type(value), value) if isinstance(value, known) else type(value)).encode()]


@dataclass(frozen=True)
class Kept:
    """A result that was kept: what made it of what, and what it was then."""

    function: Callable
    arguments: tuple
    named: dict
    result: Any
    content: str

    def problems(self) -> list[str]:
        """What is wrong: a key that equals another's, a changed result, one that is not its key's."""
        called = f"{self.function.__module__}.{self.function.__qualname__}{self.arguments}"[:300]
        impure = [value for value in (*self.arguments, *self.named.values()) if not is_exact(value)]
        found = [f"{called}: {value!r} is no key" for value in impure]
        if content(self.result) != self.content:
            found.append(f"{called}: its result was changed")
        if content(self.function(*self.arguments, **self.named)) != self.content:
            found.append(f"{called}: is something else when made again")
        return found


def is_exact(value: Any) -> bool:
    """Whether a value equals only its own kind: no number of NumPy's, no -0.0; or is only itself."""
    if type(value) in (tuple, frozenset):
        return all(map(is_exact, value))
    if type(value) is float:
        return str(value) != "-0.0"
    if type(value) in (bool, int, str, bytes, type(None)) or isinstance(value, Path):
        return True
    if type(value).__hash__ is object.__hash__:
        return True
    return is_dataclass(value) and all(is_exact(getattr(value, field.name)) for field in fields(value))


def watch_caches() -> list[Kept]:
    """What the project's functions keep from now on; called before they are imported."""
    kept, lru_cache = [], functools.lru_cache

    def watched(maxsize: int | None = 128, typed: bool = False) -> Callable:
        if callable(maxsize):
            return watched()(maxsize)

        def decorate(function: Callable) -> Callable:
            if not function.__module__.startswith("hicp_lib."):
                return lru_cache(maxsize, typed)(function)

            @functools.wraps(function)
            def noted(*arguments: Any, **named: Any) -> Any:
                result = function(*arguments, **named)
                kept.append(Kept(function, arguments, named, result, content(result)))
                return result

            return lru_cache(maxsize, typed)(noted)

        return decorate

    functools.lru_cache = watched
    return kept
