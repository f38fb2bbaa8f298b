"""Tables cached on disk: a table made by the same code from the same inputs is read, not made again.

So a notebook that is opened after a report shows the report's numbers quickly, independent of its process's
threads.
"""

import inspect
import io
from collections.abc import Callable
from typing import Any

import pandas as pd

from hicp_lib.core.cache import key
from hicp_lib.core.files import cache_dir, read_checked, write_checked


def cached(make: Callable[..., pd.DataFrame], *arguments: Any, **named: Any) -> pd.DataFrame:
    """The table ``make(*arguments, **named)``, made only if it is not in the cache.

    The key is all it depends on (`hicp_lib.core.cache.key`): the function and what it imports, and its
    inputs. If the file is damaged, the table is made again. The returned table is always read from the file's
    content, also the first time.

    Parameters
    ----------
    make : callable
        A function of `hicp_lib` whose result depends on its inputs only.
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
