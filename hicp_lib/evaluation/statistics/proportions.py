"""Proportions of rows that are something, with intervals from drawing whole source images."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from hicp_lib.evaluation.statistics.resampling import PERCENTILES, draw_counts, with_interval

_TAIL = PERCENTILES[0] / 100  # what an interval leaves out on either side


def proportions(
    rows: pd.DataFrame, by: Sequence[str], of: str, n_resamples: int = 1000, seed: int = 0
) -> pd.DataFrame:
    """Mean of a column per group of rows, with its 95 % bootstrap interval over source images.

    Parameters
    ----------
    rows : DataFrame
        Has a column `source_image`; rows of one source image are drawn together.
    by : sequence of str
        Columns that make the groups.
    of : str
        Column of booleans or numbers; rows where it is missing are left out.
    n_resamples, seed : int, optional
        Number of bootstrap draws, and what they are drawn with.

    Returns
    -------
    DataFrame
        Columns `by, value, low, high, n` (rows), `n_images` (source images), groups in the order they first
        occur; no interval from fewer than `MIN_DRAWN` source images.

    Examples
    --------
    >>> rows = pd.DataFrame({"part": list("aab"), "source_image": [1, 1, 2], "hit": [True, False, True]})
    >>> proportions(rows, ["part"], "hit")[["part", "value", "n", "n_images"]].to_dict("list")
    {'part': ['a', 'b'], 'value': [0.5, 1.0], 'n': [2, 1], 'n_images': [1, 1]}
    """
    rows = rows[rows[of].notna()]
    table = []
    for group, part in rows.groupby(list(by), sort=False, observed=True):
        images = part["source_image"]
        interval = mean_with_interval(part[of], images, n_resamples, seed)
        table.append((*group, *interval, len(part), images.nunique()))
    return pd.DataFrame(table, columns=[*by, "value", "low", "high", "n", "n_images"])


def paired_differences(
    rows: pd.DataFrame, by: Sequence[str], over: str, of: str, n_resamples: int = 1000, seed: int = 0
) -> pd.DataFrame:
    """Mean of a column where another has one value, less that where it has another, on the same images.

    Parameters
    ----------
    rows : DataFrame
        Has a column `source_image`; rows of one source image, group and value of `over` are averaged.
    by : sequence of str
        Columns that make the groups.
    over : str
        Column whose values are compared, all with all.
    of : str
        Column of booleans or numbers; source images that lack one of a pair are left out of it.
    n_resamples, seed : int, optional
        Number of bootstrap draws, and what they are drawn with.

    Returns
    -------
    DataFrame
        Columns `by`, then `over, other, pair` ("a less b"), `value, low, high, n_images`.

    Examples
    --------
    >>> rows = pd.DataFrame({"side": list("lrlr"), "source_image": [1, 1, 2, 2], "hit": [0, 1, 1, 1]})
    >>> rows["view"] = "upper"
    >>> paired_differences(rows, ["view"], "side", "hit")[["pair", "value"]].values.tolist()
    [['l less r', -0.5], ['r less l', 0.5]]
    """
    table = []
    for group, part in rows.groupby(list(by), sort=False, observed=True):
        values = part.pivot_table(of, "source_image", over)
        for a, b in combinations(dict.fromkeys(part[over]), 2):
            less = (values[a] - values[b]).dropna()
            value, low, high = mean_with_interval(less, less.index, n_resamples, seed)
            table.append((*group, a, b, f"{a} less {b}", value, low, high, len(less)))
            table.append((*group, b, a, f"{b} less {a}", 0 - value, 0 - high, 0 - low, len(less)))
    return pd.DataFrame(table, columns=[*by, over, "other", "pair", "value", "low", "high", "n_images"])


def mean_with_interval(
    values: ArrayLike, clusters: ArrayLike, n_resamples: int = 1000, seed: int = 0
) -> tuple[float, float, float]:
    """Mean, and its 95 % percentile interval from drawing clusters.

    Flags that are all alike are alike in every draw; that does not make their share certain. There the
    interval is the exact one of a share that is 0 or 1 (Clopper and Pearson), a cluster counting once.

    Parameters
    ----------
    values : array, shape (n,)
        What is averaged.
    clusters : array, shape (n,)
        Values of equal cluster are drawn together.
    n_resamples, seed : int, optional
        Number of bootstrap draws, and what they are drawn with.

    Returns
    -------
    value, low, high : float
        NaN where there are no values; no interval from fewer than `MIN_DRAWN` clusters.

    Examples
    --------
    >>> [round(float(x), 3) for x in mean_with_interval(np.zeros(100, bool), np.arange(100))]
    [0.0, 0.0, 0.036]
    """
    values = np.asarray(values)
    if not len(values):
        return np.nan, np.nan, np.nan
    cluster, names = pd.factorize(np.asarray(clusters))
    sums = np.bincount(cluster, weights=values.astype(float), minlength=len(names))
    times = draw_counts(len(names), n_resamples, seed)
    value, low, high = with_interval(times @ sums / (times @ np.bincount(cluster, minlength=len(names))))
    if values.dtype == bool and value in (0, 1) and low == low:
        reach = _TAIL ** (1 / len(names))
        low, high = (reach, 1.0) if value else (0.0, 1 - reach)
    return value, low, high
