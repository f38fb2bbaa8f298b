"""What a design can tell: how much people differ beside their frames, and the least difference it detects."""

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
