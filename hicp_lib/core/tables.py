"""External tables: CSV and Parquet, with columns selected by name."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import pandas as pd

from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.extras import require
from hicp_lib.core.files import read_bytes
from hicp_lib.core.limited import raised

_MAX_COLUMNS = 1000  # pandas takes minutes to rename ten thousand equal names
_CELLS, _CELLS_PER_BYTE = 5e6, 20  # a compressed megabyte can expand to billions
# Numbers are read to the last bit; pandas 3.1 and later do so without being asked, and warn of the question.
_IS_OLD = tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1)
_EXACT: dict[str, Any] = {"float_precision": "round_trip"} if _IS_OLD else {}


def read_table(path: str | Path, columns: Sequence[str], **options: Any) -> pd.DataFrame:
    """Read a table in which some columns must occur exactly once: Parquet by its suffix, else CSV.

    Parameters
    ----------
    path : str or Path
    columns : sequence of str
    **options : object
        Of pandas' reader of CSV.

    Returns
    -------
    pd.DataFrame

    Raises
    ------
    InputError
        If it cannot be read, a column is missing or duplicated, or the table is implausibly large for its
        file.
    """
    expected = f"expected a table with {', '.join(columns)}"
    content = read_bytes(path, expected)
    if is_parquet := Path(path).suffix == ".parquet":
        require("analysis", "pyarrow")
    try:
        if is_parquet:
            from pyarrow.parquet import ParquetFile

            file = ParquetFile(BytesIO(content))
            found, n_cells = file.schema_arrow.names, file.metadata.num_rows * file.metadata.num_columns
            if n_cells > raised(_CELLS + _CELLS_PER_BYTE * len(content)):
                raise ValueError(f"{n_cells} cells in {len(content)} bytes")
            table = file.read().to_pandas()
        else:
            first = content.partition(b"\n")[0].decode("utf-8-sig", errors="replace")
            found = [name.strip(' "\r') for name in first.split(",")]
            if len(found) > _MAX_COLUMNS:
                raise ValueError(f"{len(found)} columns")
            table = pd.read_csv(BytesIO(content), skipinitialspace=True, **_EXACT, **options)
    except Exception as error:  # the libraries raise many kinds
        raise InputError(f"{path}: cannot be read as a table ({one_line(error)}); {expected}") from None
    for name in columns:
        if (n := found.count(name)) != 1:
            wrong = f"has column {name!r} {n} times" if n else f"has no column {name!r}"
            raise InputError(f"{path}: {wrong}; {expected}")
    return table
