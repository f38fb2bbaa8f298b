"""Readable tables: columns in their units, values with their intervals, a column per case."""

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd

from hicp_lib.evaluation.statistics.resampling import MIN_DRAWN

# (suffix of a column, unit in its title) -> factor; unit -> decimals as text
_FACTORS = {
    ("m", "cm"): 100.0, ("m", "mm"): 1000.0, ("s", "s"): 1.0, ("s", "ms"): 1000.0, ("ms", "ms"): 1.0,
    ("share", "%"): 100.0, ("rad", "°"): float(np.degrees(1.0)),
}  # fmt: skip
_DECIMALS = {"cm": 1, "mm": 0, "s": 2, "ms": 0, "%": 0, "°": 1}


def intervals_over(table: pd.DataFrame) -> str:
    """Description of the intervals of a table with a column `n_people`, for captions.

    Examples
    --------
    >>> intervals_over(pd.DataFrame({"n_people": [12]}))
    '95 % bootstrap intervals over 12 people and their images'
    >>> intervals_over(pd.DataFrame({"n_people": [2]}))
    'no intervals, from only 2 people'
    """
    n_people = 1 if "n_people" not in table else int(table["n_people"].max())
    if 1 < n_people < MIN_DRAWN:
        return f"no intervals, from only {n_people} people"
    return f"95 % bootstrap intervals over {f'{n_people} people and their ' if n_people > 1 else ''}images"


def in_units(table: pd.DataFrame, titles: Mapping[str, str], text: bool = False) -> pd.DataFrame:
    """Columns under titles, in the unit a title names.

    Parameters
    ----------
    table : pd.DataFrame
        Units are the suffixes of its columns: `_m`, `_s`, `_ms`, `_rad`, `_share`.
    titles : Mapping[str, str]
        Column -> its title; ``"retreat [cm]"`` for `retreat_m`. A title without a unit leaves the column as
        it is.
    text : bool
        Whether to format numbers with a unit as text with its usual decimals, and NaN as a dash.

    Returns
    -------
    pd.DataFrame
        The columns of `titles`, in their order.

    Raises
    ------
    KeyError
        If a column is not in the table, or its suffix cannot be converted to the unit.

    Examples
    --------
    >>> runs = pd.DataFrame({"script": ["a"], "retreat_m": [0.123], "back_s": [np.nan]})
    >>> in_units(runs, {"script": "script", "retreat_m": "retreat [cm]"}).values.tolist()
    [['a', 12.3]]
    >>> in_units(runs, {"retreat_m": "retreat [cm]", "back_s": "back after [s]"}, text=True).values.tolist()
    [['12.3', '–']]
    """
    shown = {}
    for name, title in titles.items():
        shown[title] = table[name]
        if title.endswith("]"):
            unit = title.rpartition("[")[2][:-1]
            shown[title] = table[name] * _FACTORS[name.rpartition("_")[2], unit]
            if text:
                shown[title] = [_number(value, _DECIMALS[unit]) for value in shown[title]]
    return pd.DataFrame(shown, index=table.index)


def with_bounds(value: float, low: float, high: float, digits: int = 2) -> str:
    """A value with its interval, or alone without one; a dash for NaN.

    Parameters
    ----------
    value, low, high : float
    digits : int
        Decimals.

    Examples
    --------
    >>> with_bounds(0.714, 0.65, 0.77), with_bounds(-0.001, np.nan, np.nan), with_bounds(np.nan, 0, 0)
    ('0.71 [0.65, 0.77]', '0.00', '–')
    """
    interval = f" [{low:z.{digits}f}, {high:z.{digits}f}]" if value == value and low == low else ""
    return _number(value, digits) + interval


def bounds_of(
    rows: pd.DataFrame, columns: Sequence[str] = ("value", "low", "high"), factor: float = 1, digits: int = 2
) -> list[str]:
    """`with_bounds` of each row's value and the two ends of its interval.

    Parameters
    ----------
    rows : pd.DataFrame
    columns : sequence of str
        The value's and its interval's.
    factor : float
        Factor that converts the numbers to another unit.
    digits : int
        Decimals.

    Returns
    -------
    list of str
    """
    numbers = factor * rows[list(columns)]
    rows_of_three = numbers.itertuples(index=False, name=None)
    return [with_bounds(value, low, high, digits) for value, low, high in rows_of_three]


def in_cm(*lengths_m: Iterable[float]) -> list[str]:
    """Lengths in metres as "4.0", in centimetres; of several, row by row, "4.0 / 2.1"; a dash for NaN."""
    rows = zip(*lengths_m, strict=True)
    return [" / ".join(_number(100 * length_m, 1) for length_m in row) for row in rows]


def wide(
    rows: pd.DataFrame,
    index: Sequence[str],
    columns: str,
    text: Sequence[str] | None = None,
    order: Sequence[str] | None = None,
) -> pd.DataFrame:
    """A text for each row, with a column per value of `columns`, rows in the order they come in.

    Parameters
    ----------
    rows : pd.DataFrame
    index : Sequence[str]
        Columns that name a row of the result.
    columns : str
        The column whose values become columns; their underscores become spaces.
    text : Sequence[str], optional
        One per row; `bounds_of` the rows when left out.
    order : Sequence[str], optional
        Order of the new columns; by default that of occurrence.
    """
    index = list(index)
    if rows.empty:
        return rows[index]
    table = rows.assign(text=bounds_of(rows) if text is None else text)
    table = table.pivot(index=index, columns=columns, values="text")
    table = table[[name for name in order or dict.fromkeys(rows[columns]) if name in table]]
    table = table.rename(columns=lambda name: name.replace("_", " ")).rename_axis(columns=None)
    return rows[index].drop_duplicates(ignore_index=True).join(table, on=index)


def not_available(needed: str) -> pd.DataFrame:
    """Replaces a table that cannot be made from this recording."""
    return pd.DataFrame({"needs": [needed], "here": "not available for this recording"})


def _number(value: float, digits: int) -> str:
    return f"{value:z.{digits}f}" if math.isfinite(value) else "–"
