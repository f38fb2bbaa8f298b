"""Compare a run with the reference run, value by value, for everything that its pages show.

The reference run of a profile lies in `data/reference/PROFILE/`, a folder per notebook: its `values.json`,
the tables it shows, and its stamp; `tools/reference.py` writes it.
"""

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from hicp_lib.core.files import read_json

TOLERANCE = 1e-6  # relative, since other processors round differently
WITHIN_TOLERANCE = ["same", "within 1e-6", "within the interval"]
VERDICTS = [*WITHIN_TOLERANCE, "outside"]
MEASURED_NAME = "time"
"""Name of the one figure or table of a page that draws or lists times."""
Output = tuple[Any, float, float]
_BOUND = re.compile(r"(?:.*_)?(low|high)(?:_.*)?")


def is_measured(name: str) -> bool:
    """Whether a table, a column or a value contains measured times, which cannot be repeated.

    Examples
    --------
    >>> [is_measured(name) for name in ("time", "median_time_ms", "time_ms_basic", "times")]
    [True, True, True, False]
    """
    return name == MEASURED_NAME or "time_ms" in name


def outputs(folder: Path, tables: list[str]) -> dict[str, Output]:
    """The values and tables of a notebook, by name: value and bounds of the interval, or NaN.

    Bounds are the columns `low` and `high` (or `x_low`, `low_m` ...) after that of the value; they are not
    outputs themselves.

    Parameters
    ----------
    folder : Path
        Of its results.
    tables : list of str
        File names of tables; missing ones have no outputs.

    Returns
    -------
    dict of str to (object, float, float)
    """
    found = {name: (value, math.nan, math.nan) for name, value in _leaves(read_json(folder / "values.json"))}
    for file in tables:
        table = pd.read_parquet(folder / file) if (folder / file).is_file() else pd.DataFrame()
        columns = list(table)
        for k, column in enumerate(columns):
            if _BOUND.fullmatch(column) or is_measured(column):
                continue
            bounds = columns[k + 1 : k + 3]
            if [match[1] for name in bounds if (match := _BOUND.fullmatch(name))] != ["low", "high"]:
                bounds = []
            for row, cells in enumerate(
                zip(*(table[name].tolist() for name in (column, *bounds)), strict=True)
            ):
                if isinstance(cells[0], int | float):
                    value, low, high = cells if bounds else (cells[0], math.nan, math.nan)
                    found[f"{Path(file).stem}, {column}, row {row + 1}"] = value, low, high
    return found


def _leaves(value: Any, at: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, item in value.items():
            if not is_measured(key):
                yield from _leaves(item, f"{at}.{key}".lstrip("."))
    else:
        yield at, value


def verdict(reference: Output | None, own: Output | None) -> str:
    """One of `VERDICTS`.

    Examples
    --------
    >>> [verdict((0.5, 0.4, 0.6), (own, 0.0, 1.0)) for own in (0.5, 0.5 + 1e-8, 0.55, 0.7)]
    ['same', 'within 1e-6', 'within the interval', 'outside']
    """
    if reference is None or own is None:
        return VERDICTS[3]
    (value, low, high), (mine, *_) = reference, own
    if repr(value) == repr(mine):  # NaN is NaN
        return VERDICTS[0]
    if not (isinstance(value, int | float) and isinstance(mine, int | float)):
        return VERDICTS[3]
    if math.isclose(value, mine, rel_tol=TOLERANCE):
        return VERDICTS[1]
    return VERDICTS[2] if low <= mine <= high else VERDICTS[3]


def compare(reference: Path, results: Path) -> tuple[pd.DataFrame, dict[str, str]]:
    """Every output of the reference run, or of this one, with the other's.

    Parameters
    ----------
    reference, results : Path
        Each with a folder per notebook.

    Returns
    -------
    pd.DataFrame
        A row per output: `notebook`, `output`, `reference`, `own`, `verdict`.
    dict of str to str
        Why a notebook is not compared, by its name.
    """
    rows, left_out = [], {}
    for folder in sorted(path.parent for path in reference.glob("*/provenance.json")):
        own = results / folder.name
        if not (own / "provenance.json").is_file():
            left_out[folder.name] = "was not run"
            continue
        given = [read_json(path / "provenance.json")["parameters"] for path in (folder, own)]
        if given[0] != given[1]:
            left_out[folder.name] = "was run with other parameters"
            continue
        tables = [path.name for path in sorted(folder.glob("*.parquet"))]
        one, other = outputs(folder, tables), outputs(own, tables)
        for name in one | other:
            pair = one.get(name), other.get(name)
            shown = [None if output is None else output[0] for output in pair]
            rows.append((folder.name, name, *shown, verdict(*pair)))
    return pd.DataFrame(rows, columns=["notebook", "output", "reference", "own", "verdict"]), left_out
