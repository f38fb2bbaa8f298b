"""Proportions of rows with a property, with intervals from resampling people, then whole source images."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from hicp_lib.core.extras import needs
from hicp_lib.evaluation.statistics.resampling import Draws, draw_counts, with_interval

ALPHA, POWER = 0.05, 0.8


def proportions(
    rows: pd.DataFrame, by: Sequence[str], of: str, draws: Draws = Draws(), are_shares: bool = True
) -> pd.DataFrame:
    """Mean of a column per group of rows, with its 95 % bootstrap interval.

    Parameters
    ----------
    rows : DataFrame
        With a column `source_image`; rows of one source image are resampled together. With a column
        `subject`, subjects are resampled, then source images of each.
    by : sequence of str
        Columns that make the groups.
    of : str
        Column of booleans or numbers; rows where it is missing are left out.
    draws : Draws, optional
        Of the bootstrap.
    are_shares : bool, optional
        Whether the values are shares from 0 to 1 (`mean_with_interval`), not differences of them.

    Returns
    -------
    DataFrame
        Columns `by, value, low, high, n` (rows), `n_images` (source images) and, of rows with subjects,
        `n_people`, groups in the order of first occurrence; no interval from fewer than `MIN_DRAWN` subjects,
        or source images of one.

    Examples
    --------
    >>> rows = pd.DataFrame({"part": list("aab"), "source_image": [1, 1, 2], "hit": [True, False, True]})
    >>> proportions(rows, ["part"], "hit")[["part", "value", "n", "n_images"]].to_dict("list")
    {'part': ['a', 'b'], 'value': [0.5, 1.0], 'n': [2, 1], 'n_images': [1, 1]}
    """
    rows = rows[rows[of].notna()]
    units = ["source_image", "subject"] if "subject" in rows else ["source_image"]
    table = []
    for group, part in rows.groupby(list(by), sort=False, observed=True):
        interval = mean_with_interval(part[of], part["source_image"], draws, part.get("subject"), are_shares)
        table.append((*group, *interval, len(part), *part[units].nunique()))
    counts = ["n_images", "n_people"][: len(units)]
    return pd.DataFrame(table, columns=[*by, "value", "low", "high", "n", *counts])


def paired_differences(
    rows: pd.DataFrame, by: Sequence[str], over: str, of: str, draws: Draws = Draws()
) -> pd.DataFrame:
    """Differences of a column's mean between the values of another column, on the same images.

    Parameters
    ----------
    rows : DataFrame
        With a column `source_image`; rows of one source image, group and value of `over` are averaged. With a
        column `subject`, subjects are resampled, then source images of each.
    by : sequence of str
        Columns that make the groups.
    over : str
        Column whose values are compared, all with all.
    of : str
        Column of booleans or numbers; source images that lack one value of a pair are left out.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `by`, then `over, other, pair` ("a less b"), `value, low, high, n_images` and, of rows with
        subjects, `n_people, detectable` (`smallest_difference`).

    Examples
    --------
    >>> rows = pd.DataFrame({"side": list("lrlr"), "source_image": [1, 1, 2, 2], "hit": [0, 1, 1, 1]})
    >>> rows["view"] = "upper"
    >>> paired_differences(rows, ["view"], "side", "hit")[["pair", "value"]].values.tolist()
    [['l less r', -0.5], ['r less l', 0.5]]
    """
    table = []
    units = ["source_image", "subject"] if "subject" in rows else ["source_image"]
    for group, part in rows.groupby(list(by), sort=False, observed=True):
        values = part.pivot_table(of, units, over)
        for a, b in combinations(dict.fromkeys(part[over]), 2):
            less = (values[a] - values[b]).dropna().rename("less").reset_index()
            whose = less.get("subject")
            value, low, high = mean_with_interval(less["less"], less["source_image"], draws, whose)
            counts: list[float] = [len(less)]
            if whose is not None:
                counts += [whose.nunique(), smallest_difference(less.groupby(whose)["less"].mean())]
            table.append((*group, a, b, f"{a} less {b}", value, low, high, *counts))
            table.append((*group, b, a, f"{b} less {a}", 0 - value, 0 - high, 0 - low, *counts))
    names = ["n_images", "n_people", "detectable"][: 2 * len(units) - 1]
    return pd.DataFrame(table, columns=[*by, over, "other", "pair", "value", "low", "high", *names])


def mean_with_interval(
    values: ArrayLike, clusters: ArrayLike, draws: Draws = Draws(), subjects: ArrayLike | None = None,
    are_shares: bool | None = None,
) -> tuple[float, float, float]:  # fmt: skip
    """Mean, and its 95 % percentile interval from resampling subjects, then clusters of each.

    A mean share of 0 or 1 has an exact interval (`with_interval`). It holds for flags, and for shares of
    several keypoints as well: their chance to be 1 is at most their mean.

    Parameters
    ----------
    values : array, shape (n,)
        The values to average.
    clusters : array, shape (n,)
        Values of the same cluster are resampled together.
    draws : Draws, optional
        Of the bootstrap.
    subjects : array, shape (n,), optional
        The subject of each value; by default one for all.
    are_shares : bool, optional
        Whether the values are shares, from 0 to 1; by default if they are booleans.

    Returns
    -------
    value, low, high : float
        NaN where there are no values; no interval from fewer than `MIN_DRAWN` subjects, or clusters of one.

    Examples
    --------
    >>> [round(float(x), 3) for x in mean_with_interval(np.zeros(100, bool), np.arange(100))]
    [0.0, 0.0, 0.036]
    """
    values = np.asarray(values)
    if not len(values):
        return np.nan, np.nan, np.nan
    subjects = np.zeros(len(values)) if subjects is None else subjects
    units = pd.DataFrame({"subject": np.asarray(subjects), "cluster": np.asarray(clusters)})
    cluster = units.groupby(["subject", "cluster"], sort=False).ngroup().to_numpy()
    whose = units["subject"][np.unique(cluster, return_index=True)[1]]
    times, n_people = draw_counts(whose, draws), whose.nunique()
    sums = np.bincount(cluster, weights=values.astype(float))
    n_clusters = len(whose) if (values.dtype == bool if are_shares is None else are_shares) else 0
    return with_interval(times @ sums / (times @ np.bincount(cluster)), n_people, n_clusters)


def variance_components(values: ArrayLike, subjects: ArrayLike) -> tuple[float, float]:
    """Variance between subjects, and between frames of one: one-way random-effects analysis of variance.

    With K subjects of n frames each, the variance of the mean is between / K + within / (K n).

    Parameters
    ----------
    values : array, shape (n_values,)
        NaN is left out.
    subjects : array, shape (n_values,)
        The subject of each value.

    Returns
    -------
    between, within : float
        In the values' unit squared. NaN if there is only one subject, or one value of each; negative
        estimates become 0.

    Examples
    --------
    >>> [float(x) for x in variance_components([1, 3, 11, 13], ["a", "a", "b", "b"])]
    [49.0, 2.0]
    """
    table = pd.DataFrame({"value": np.asarray(values, float), "subject": np.asarray(subjects)}).dropna()
    of = table.groupby("subject")["value"].agg(["mean", "size", "var"])
    n, k = len(table), len(of)
    if k < 2 or n == k:
        return np.nan, np.nan
    within = (of["var"].fillna(0) * (of["size"] - 1)).sum() / (n - k)
    between = (of["size"] * (of["mean"] - table["value"].mean()) ** 2).sum() / (k - 1)
    frames = (n - (of["size"] ** 2).sum() / n) / (k - 1)  # frames per subject, if all have the same number
    return max((between - within) / frames, 0.0), within


def component_table(rows: pd.DataFrame, by: Sequence[str], of: str) -> pd.DataFrame:
    """Variances between views, people within a view, and images of a person, per group of rows.

    Parameters
    ----------
    rows : DataFrame
        With columns `view, subject`, a row per image.
    by : sequence of str
        Columns that make the groups.
    of : str
        Column of numbers or flags.

    Returns
    -------
    DataFrame
        Columns `by, views, people, images` (`variance_components`), `n_people`.
    """
    table = []
    for group, part in rows.groupby(list(by), sort=False, observed=True):
        apart = part[of] - part.groupby("view")[of].transform("mean")
        people = part.groupby(["view", "subject"]).ngroup()
        views, _ = variance_components(part[of], part["view"])
        table.append((*group, views, *variance_components(apart, people), part["subject"].nunique()))
    return pd.DataFrame(table, columns=[*by, "views", "people", "images", "n_people"])


def smallest_difference(differences_by_subject: ArrayLike, power: float = POWER) -> float:
    """The smallest true mean difference that this number of subjects could detect.

    Parameters
    ----------
    differences_by_subject : array, shape (n_people,)
        One mean difference of each; NaN is left out.
    power : float, optional
        With this probability a paired t-test, two-sided at 5 %, would find it.

    Returns
    -------
    float
        In the differences' unit. NaN with fewer than two, and if all are equal, since their spread is then
        unknown.

    Examples
    --------
    >>> round(smallest_difference([0.0, 1.0] * 6), 2)
    0.46
    """
    with needs("analysis"):
        from scipy.stats import t  # a second to load
    differences = np.asarray(differences_by_subject, float)
    differences = differences[np.isfinite(differences)]
    n = len(differences)
    if n < 2 or np.ptp(differences) == 0:
        return np.nan
    reach = t.ppf(1 - ALPHA / 2, n - 1) + t.ppf(power, n - 1)
    return float(reach * differences.std(ddof=1) / np.sqrt(n))
