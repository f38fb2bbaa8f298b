"""Resampling of images by how often each is drawn: medians and shares in every draw at once.

The first draw is the sample itself, each image once; the others are the bootstrap's.
"""

from typing import Any

import numpy as np

from hicp_lib.core.memo import memoised

PERCENTILES = (2.5, 97.5)  # of 95 % intervals
MIN_DRAWN = 10  # a percentile interval from fewer covers far less than 95 %, and from one nothing


@memoised(4)
def draw_counts(n: int, n_resamples: int, seed: int) -> np.ndarray:
    """How often each image is drawn.

    Parameters
    ----------
    n : int
        Number of images. Fewer than `MIN_DRAWN` are not drawn again: there is no interval.
    n_resamples : int
        Number of draws.
    seed : int
        Of the draws.

    Returns
    -------
    array of int, shape (1 + n_resamples, n)
        The first row is the sample itself, each once.

    Examples
    --------
    >>> draw_counts(3, 1000, seed=0)
    array([[1, 1, 1]])
    >>> draw_counts(10, 1000, seed=0).sum(axis=1).min()
    np.int64(10)
    """
    n_resamples = n_resamples if n >= MIN_DRAWN else 0
    drawn = np.random.default_rng(seed).multinomial(n, np.full(n, 1 / n), size=n_resamples)
    return np.concatenate([np.ones((1, n), dtype=int), drawn])


def with_interval(draws: np.ndarray) -> tuple[Any, Any, Any]:
    """The value in the first draw, and the bounds of the 95 % percentile interval of the others.

    Parameters
    ----------
    draws : array, shape (n_draws, ...)
        Draws in which nothing counts (NaN) are left out.

    Returns
    -------
    value, low, high : float or array, shape (...)
        NaN where no draw is left.

    Examples
    --------
    >>> [float(x) for x in with_interval(np.array([0.5, 0.0, 1.0, np.nan]))]
    [0.5, 0.025, 0.975]
    """
    others = draws[1:]
    bounds = np.full((2, *draws.shape[1:]), np.nan)
    some = np.isfinite(others).any(axis=0)
    bounds[:, some] = np.nanpercentile(others[:, some], PERCENTILES, axis=0)
    return draws[0], *bounds


def weighted_median(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Medians of values that are each counted as often as its weight says; NaN is left out.

    Parameters
    ----------
    values : array, shape (n,) or (draws, n)
        One row per draw when every draw has its own.
    weights : array of int, shape (draws, n)
        How often each counts.

    Returns
    -------
    array, shape (draws,)
        What `np.nanmedian` of the repeated values is; NaN where none was drawn.

    Examples
    --------
    >>> weighted_median(np.array([1.0, 2.0, np.nan, 9.0]), np.array([[1, 1, 1, 1], [2, 0, 5, 0]]))
    array([2., 1.])
    """
    rows = np.atleast_2d(values)
    some = np.flatnonzero(np.isfinite(rows).any(axis=0))
    if len(some) == 0:
        return np.full(len(weights), np.nan)
    rows = rows[:, some]
    order = np.argsort(rows, axis=1)  # NaN last
    columns = some[order]
    drawn = weights.take(columns[0], axis=1) if len(rows) == 1 else np.take_along_axis(weights, columns, 1)
    n_finite = np.isfinite(rows).sum(axis=1)[:, None]
    if n_finite.min() < len(some):
        drawn = np.where(np.arange(len(some)) < n_finite, drawn, 0)
    counts = np.cumsum(drawn, axis=1)
    total = counts[:, -1]
    row = np.arange(len(weights)) if len(rows) > 1 else 0
    # The first that reach the ranks in the middle; with an odd number it is one rank twice.
    places = [(counts >= rank[:, None]).argmax(axis=1) for rank in ((total + 1) // 2, total // 2 + 1)]
    lower, upper = (rows[row, order[row, place]] for place in places)
    return np.where(total > 0, (lower + upper) / 2, np.nan)
