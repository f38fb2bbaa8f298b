"""What a design can tell: how much people differ beside their frames, and the least difference it detects."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from hicp_lib.core.extras import needs

ALPHA, POWER = 0.05, 0.8


def variance_components(values: ArrayLike, subjects: ArrayLike) -> tuple[float, float]:
    """Variance between subjects, and between frames of one: analysis of variance, one way, random effects.

    With K subjects of n frames each, the mean has the variance between / K + within / (K n).

    Parameters
    ----------
    values : array, shape (n_values,)
        NaN is left out.
    subjects : array, shape (n_values,)
        Whose each is.

    Returns
    -------
    between, within : float
        In the values' unit squared. NaN where there is only one subject, or one value of each; what comes out
        below 0 is 0.

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
    frames = (n - (of["size"] ** 2).sum() / n) / (k - 1)  # of each, if all have as many
    return max((between - within) / frames, 0.0), within


def component_table(rows: pd.DataFrame, by: Sequence[str], of: str) -> pd.DataFrame:
    """Variances between views, between people within a view, and between images of one, of groups of rows.

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
    """The smallest true mean difference that so many subjects would show.

    Parameters
    ----------
    differences_by_subject : array, shape (n_people,)
        One mean difference of each; NaN is left out.
    power : float, optional
        With this probability a paired t-test, two-sided at 5 %, would find it.

    Returns
    -------
    float
        In the differences' unit. NaN from fewer than two, and where all are alike: nothing is known there of
        how they spread.

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
