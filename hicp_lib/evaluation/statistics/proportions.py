"""Shares of rows that are something, with intervals from drawing whole source images."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from hicp_lib.evaluation.statistics.resampling import draw_counts, with_interval


def shares(
    rows: pd.DataFrame, by: Sequence[str], of: str, n_resamples: int = 1000, seed: int = 0
) -> pd.DataFrame:
    """Mean of a column per group of rows, with its 95 % bootstrap interval over source images.

    Parameters
    ----------
    rows : has a column `source_image`; rows of one source image are drawn together
    by : columns that make the groups
    of : column of booleans or numbers; rows where it is missing are left out

    Returns
    -------
    DataFrame, columns `by, value, low, high, n` (rows), `n_images` (source images), groups in the order
    they first occur
    """
    rows = rows[rows[of].notna()]
    table = []
    for group, part in rows.groupby(list(by), sort=False, observed=True):
        value, low, high = mean_with_interval(part[of], part["source_image"], n_resamples, seed)
        table.append((*group, value, low, high, len(part), part["source_image"].nunique()))
    return pd.DataFrame(table, columns=[*by, "value", "low", "high", "n", "n_images"])


def mean_with_interval(
    values: np.ndarray, clusters: np.ndarray, n_resamples: int = 1000, seed: int = 0
) -> tuple[float, float, float]:
    """Mean of values (n,), and its 95 % percentile interval from drawing clusters (n,); NaN for none."""
    if not len(values):
        return np.nan, np.nan, np.nan
    cluster, names = pd.factorize(np.asarray(clusters))
    sums = np.bincount(cluster, weights=np.asarray(values, float), minlength=len(names))
    times = draw_counts(len(names), n_resamples, seed)
    value, low, high = with_interval(times @ sums / (times @ np.bincount(cluster, minlength=len(names))))
    return float(value), float(low), float(high)
