"""Which detector for which task: the best by the numbers of a run, and those not told apart from it."""

from pathlib import Path
from typing import Any

import pandas as pd

from hicp_lib.core.files import read_json
from hicp_lib.detectors.registry import COMBINED, DETECTORS
from hicp_lib.study.table_format import bounds_of

_HANDS = "hands, head cut off"
_BY_AP = {
    "body, head in view": ("body", "basic"),
    "body, head cut off": ("body", "headless"),
    "body, .4 to 1.2 m away": ("body", "near"),
    _HANDS: ("hand", "headless"),
}


def label(detector: str) -> str:
    """A detector's name in plain words.

    Examples
    --------
    >>> label("combined:movenet-thunder+mediapipe-hands"), label("mine")
    ('MoveNet Thunder + MediaPipe Hands', 'mine')
    """
    parts = detector.removeprefix(COMBINED).split("+")
    return " + ".join(DETECTORS[part].label if part in DETECTORS else part for part in parts)


def best_first(rows: pd.DataFrame, pairs: pd.DataFrame | None = None) -> pd.DataFrame:
    """The best detector of a measure, then those not told apart from it.

    Parameters
    ----------
    rows : pd.DataFrame
        Columns `detector, value, low, high`; more is better, NaN is not measured.
    pairs : pd.DataFrame, optional
        Paired differences, `detector, other, low, high`. Where left out, intervals that overlap leave it open.

    Returns
    -------
    pd.DataFrame
        Those of `rows`, the best one first.

    Examples
    --------
    >>> rows = pd.DataFrame({"detector": ["a", "b", "c"], "value": [0.8, 0.9, 0.1]})
    >>> best_first(rows.assign(low=rows["value"] - 0.2, high=rows["value"] + 0.2))["detector"].tolist()
    ['b', 'a']
    """
    rows = rows[rows["value"].notna()].sort_values("value", ascending=False, kind="stable")
    if rows.empty:
        return rows
    if pairs is None:
        ahead = rows["low"].iloc[0] - rows["high"]
    else:
        back = pairs.assign(detector=pairs["other"], other=pairs["detector"], low=-pairs["high"])
        of_best = pd.concat([pairs, back]).merge(rows[["detector"]].head(1)).drop_duplicates("other")
        ahead = rows["detector"].map(of_best.set_index("other")["low"])
    return rows[~(ahead > 0)]


def choices(results: Path) -> pd.DataFrame:
    """For each task the best detector of a run, those not told apart from it, and its number.

    Parameters
    ----------
    results : Path
        A run's, a folder per notebook. What was not run, or measured on nobody, has no row.

    Returns
    -------
    pd.DataFrame
        Columns `task`, `best in this run`, `its number`.
    """

    def read(notebook: str, table: str, where: str) -> pd.DataFrame:
        path = results / notebook / f"{table}.parquet"
        nothing = pd.DataFrame(columns=["body", "detector", "other", "value", "low", "high"])
        return pd.read_parquet(path).query(where) if path.is_file() else nothing

    in_02, in_02b = "02_evaluation_2d", "02b_combination"
    asked: dict[str, list[Any]] = {}
    for task, (group, subset) in _BY_AP.items():
        where = f"metric == 'AP' and labelled == 'all' and group == '{group}' and subset == '{subset}'"
        asked[task] = [read(in_02, "by_definition", where), read(in_02, "pairs", where), "AP {}", 1, 2]
    hands = read(in_02b, "ingredients", "subset == 'headless'").groupby("body").tail(1)
    hands = hands.rename(columns={"AP": "value", "AP_low": "low", "AP_high": "high"})
    hands["detector"] = COMBINED + hands["body"] + "+mediapipe-hands"
    asked[_HANDS][0] = pd.concat([asked[_HANDS][0], hands])
    asked[_HANDS][1] = pd.concat([asked[_HANDS][1], read(in_02b, "gains", "subset == 'headless'")])
    heads = read("05_failure_analysis", "false_presence", "subset == 'headless' and part == 'head'")
    heads = heads.drop_duplicates("detector")  # by scores as they come
    without = heads.assign(value=1 - heads["value"], low=1 - heads["high"], high=1 - heads["low"])
    asked["no invented head"] = [without, None, "{} % of people", 100, 0]
    rows = []
    for task, (measured, pairs, words, factor, digits) in asked.items():
        best = best_first(measured, pairs)
        if len(best):
            first, *others = map(label, best["detector"])
            also = f"; not told apart: {', '.join(others)}" if others else ""
            rows.append((task, first + also, words.format(bounds_of(best, factor=factor, digits=digits)[0])))
    times_ms = read_json(results / in_02 / "values.json")["median_time_ms"]
    for first in sorted(times_ms, key=times_ms.get)[:1]:
        rows.append(("speed", label(first), f"{times_ms[first]:.0f} ms per image"))
    return pd.DataFrame(rows, columns=["task", "best in this run", "its number"])
