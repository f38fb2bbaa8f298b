"""Results cached within a process: they depend on their key only, and are read-only."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import lru_cache, wraps
from typing import Any, TypeVar

import numpy as np

_Function = TypeVar("_Function", bound=Callable)


def memoised(maxsize: int | None = None) -> Callable[[_Function], _Function]:
    """As `functools.lru_cache`, but what one caller passes or does never affects another's result.

    Numbers of NumPy become Python's: ``0.06`` and ``np.float64(0.06)`` are one key, but arrays of single
    precision stay so with the first only. For the same reason ``-0.0`` becomes ``0.0``, and ``1``, ``1.0``
    and ``True`` are different keys. A dataclass used as a key must convert its own fields (`plain_fields`).
    Arrays in the result, also within dataclasses, are read-only.

    Parameters
    ----------
    maxsize : int, optional
        How many results are cached; all when left out.

    Returns
    -------
    callable
        The decorator; what it makes has `cache_info` and `cache_clear` of `functools.lru_cache`.

    Examples
    --------
    >>> @memoised()
    ... def squares(n: int) -> np.ndarray:
    ...     return np.arange(n) ** 2
    >>> squares(3) is squares(np.int64(3)), squares(3).flags.writeable
    (True, False)
    """

    def decorate(function: _Function) -> _Function:
        @lru_cache(maxsize, typed=True)
        @wraps(function)
        def cached(*arguments, **named):
            result = function(*arguments, **named)
            _freeze(result)
            return result

        @wraps(function)
        def called(*arguments, **named):
            return cached(*map(plain, arguments), **{name: plain(value) for name, value in named.items()})

        decorated: Any = called
        decorated.cache_info, decorated.cache_clear = cached.cache_info, cached.cache_clear
        return decorated

    return decorate


def plain(value: Any) -> Any:
    """`value` with NumPy's numbers turned into Python's, and without a sign on zero; in tuples too."""
    if type(value) is not float:
        if isinstance(value, tuple):
            return tuple([plain(item) for item in value])
        if not isinstance(value, np.generic):
            return value
        value = value.item()
    return value + 0.0 if isinstance(value, float) else value


def plain_fields(instance: Any) -> None:
    """Make the fields of a frozen dataclass `plain`, in its ``__post_init__``."""
    for field in fields(instance):
        object.__setattr__(instance, field.name, plain(getattr(instance, field.name)))


def _freeze(value: Any) -> None:
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif isinstance(value, (tuple, list)):
        for item in value:
            _freeze(item)
    elif isinstance(value, dict):
        _freeze(list(value.values()))
    elif hasattr(value, "indptr"):  # SciPy's sparse arrays; SciPy may not be installed
        _freeze([value.data, value.indices, value.indptr])
    elif is_dataclass(value) and not isinstance(value, type):
        _freeze([getattr(value, field.name) for field in fields(value)])
