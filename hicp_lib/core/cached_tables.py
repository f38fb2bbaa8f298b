"""Tables cached on disk: what was made once of the same inputs with the same code is read, not made again.

A notebook that is opened after a report so shows the report's numbers, and soon, whatever threads its
process has.
"""

import inspect
import io
from collections.abc import Callable
from typing import Any

import pandas as pd

from hicp_lib.core.cache import key
from hicp_lib.core.files import cache_dir, read_checked, write_checked


def cached(make: Callable[..., pd.DataFrame], *arguments: Any, **named: Any) -> pd.DataFrame:
    """The table ``make(*arguments, **named)``, made only if it is not there.

    The key is all it depends on (`hicp_lib.core.cache.key`): the function and what it imports, and its
    inputs. A damaged file is never an answer: the table is made again. What is returned was read from what
    the file holds, the first time too.

    Parameters
    ----------
    make : callable
        A function of `hicp_lib` whose result follows from its inputs.
    *arguments, **named : any
        Its inputs, as `hicp_lib.core.cache.key` takes them.

    Returns
    -------
    DataFrame

    Raises
    ------
    TypeError
        For an input whose content is not known.
    """
    given = inspect.signature(make).bind(*arguments, **named)
    given.apply_defaults()
    result_key = key([make, cached], function=make.__qualname__, arguments=given.arguments)
    path = cache_dir() / "tables" / make.__name__ / f"{result_key[:32]}.bin"
    payload = read_checked(path)
    if payload is None:
        payload = make(*arguments, **named).to_parquet()
        write_checked(path, payload)
    return pd.read_parquet(io.BytesIO(payload))
