"""External tables: CSV and Parquet, with columns selected by name."""

import os
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import pandas as pd

from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.extras import require
from hicp_lib.core.files import MAX_BYTES, regular_file
from hicp_lib.core.limited import raised

_MAX_COLUMNS = 1000  # pandas takes minutes to rename ten thousand equal names
_MOST_HEADER_BYTES = 2**24
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
    (table,) = read_table_in_parts(path, columns, **options)
    return table


def read_table_in_parts(
    path: str | Path, columns: Sequence[str], n_rows: int | None = None, **options: Any
) -> Iterator[pd.DataFrame]:
    """As `read_table`, some rows at a time, so that memory need not hold them all.

    Parameters
    ----------
    path : str or Path
    columns : sequence of str
    n_rows : int, optional
        Of a part, at most; all in one if left out.
    **options : object
        As of `read_table`.

    Yields
    ------
    pd.DataFrame

    Raises
    ------
    InputError
        As `read_table`; parts may have come before.
    """
    expected = f"expected a table with {', '.join(columns)}"
    regular_file(path, expected, raised(MAX_BYTES))
    if is_parquet := Path(path).suffix == ".parquet":
        require("analysis", "pyarrow")
    try:
        with open(path, "rb") as file:
            found, parts = _parquet(file, n_rows) if is_parquet else _csv(file, n_rows, options)
            wrong = [(name, n) for name in columns if (n := found.count(name)) != 1]
            yield from () if wrong else parts
    except Exception as error:  # the libraries raise many kinds
        raise InputError(f"{path}: cannot be read as a table ({one_line(error)}); {expected}") from None
    for name, n in wrong:
        problem = f"has column {name!r} {n} times" if n else f"has no column {name!r}"
        raise InputError(f"{path}: {problem}; {expected}")


def _parquet(file: BinaryIO, n_rows: int | None) -> tuple[list[str], Iterable[pd.DataFrame]]:
    """Names of columns, and the table in parts."""
    from pyarrow.parquet import ParquetFile

    table, n_bytes = ParquetFile(file), os.fstat(file.fileno()).st_size
    n_cells = table.metadata.num_rows * table.metadata.num_columns
    if n_cells > raised(_CELLS + _CELLS_PER_BYTE * n_bytes):
        raise ValueError(f"{n_cells} cells in {n_bytes} bytes")
    parts = table.iter_batches(n_rows) if n_rows else map(ParquetFile.read, [table])
    return table.schema_arrow.names, (part.to_pandas(ignore_metadata=True) for part in parts)


def _csv(file: BinaryIO, n_rows: int | None, options: dict) -> tuple[list[str], Iterable[pd.DataFrame]]:
    """As `_parquet`."""
    first = file.readline(_MOST_HEADER_BYTES).decode("utf-8-sig", errors="replace")
    file.seek(0)
    found = [name.strip(' "\r\n') for name in first.split(",")]
    if len(found) > _MAX_COLUMNS:
        raise ValueError(f"{len(found)} columns")
    # With an index, pandas moves all titles by one column where rows have more fields than titles.
    reader = pd.read_csv(file, skipinitialspace=True, index_col=False, iterator=True, **_EXACT, **options)
    return found, _parts(reader, n_rows)


def _parts(reader: Any, n_rows: int | None) -> Iterator[pd.DataFrame]:
    part = None
    with suppress(StopIteration):
        while part is None or n_rows:
            with warnings.catch_warnings(action="error", category=pd.errors.ParserWarning):  # untitled fields
                part = reader.read(n_rows)
            yield part
