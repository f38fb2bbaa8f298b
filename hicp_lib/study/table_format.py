"""What the tables of several tests have in common when they are made for reading."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pandas as pd

from hicp_lib.evaluation.ap.cocoeval import METRICS


def with_bounds(value: float, low: float, high: float, digits: int = 2) -> str:
    """A value with its interval as "0.71 [0.65, 0.77]", alone where it has none; a dash where it is NaN."""
    if value != value:
        return "–"
    return f"{value:.{digits}f}" + (f" [{low:.{digits}f}, {high:.{digits}f}]" if low == low else "")


def bounds_of(rows: pd.DataFrame) -> list[str]:
    """`with_bounds` of each row's `value, low, high`."""
    return [with_bounds(*row) for row in rows[["value", "low", "high"]].itertuples(index=False, name=None)]


def in_cm(length_m: float) -> str:
    """A length in metres as centimetres, "1.2"; a dash where it is NaN."""
    return f"{100 * length_m:.1f}" if math.isfinite(length_m) else "–"


def wide(
    rows: pd.DataFrame, index: Sequence[str], columns: str, order: Sequence[str] | None = None
) -> pd.DataFrame:
    """The column `text` with a column per value of `columns`, rows in the order they come in.

    Parameters
    ----------
    index : columns that name a row of the result
    order : of the new columns, those that occur; the order they come in when left out
    """
    index = list(index)
    table = rows.pivot(index=index, columns=columns, values="text")
    table = table.reindex(list(dict.fromkeys(rows[index].itertuples(index=False, name=None))))
    table = table[[name for name in order or dict.fromkeys(rows[columns]) if name in table]]
    return table.rename_axis(columns=None).reset_index()


def metrics_text(table: pd.DataFrame, group: str) -> pd.DataFrame:
    """One group of a `compare` table for reading: "0.71 [0.65, 0.77]" per subset, detector and metric."""
    rows = table[table["group"] == group]
    rows = rows.assign(text=bounds_of(rows))
    table = wide(rows, ["subset", "detector", "n_people"], "metric", METRICS)
    return table.rename(columns={"n_people": "people"})
