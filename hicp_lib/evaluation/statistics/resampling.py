"""Resampling of images by how often each is drawn: medians and shares in every draw at once.

The first draw is the sample itself, each image once; the others are the bootstrap's.
"""

from __future__ import annotations

import numpy as np

PERCENTILES = (2.5, 97.5)  # of 95 % intervals
MIN_DRAWN = 10  # a percentile interval from fewer covers far less than 95 %, and from one nothing


def draw_counts(n: int, n_resamples: int, seed: int) -> np.ndarray:
    """How often each of `n` images is drawn, shape (1 + n_resamples, n); the first row is once each.

    Fewer than `MIN_DRAWN` images are not drawn again: the first row is all, and there is no interval.
    """
    n_resamples = n_resamples if n >= MIN_DRAWN else 0
    drawn = np.random.default_rng(seed).multinomial(n, np.full(n, 1 / n), size=n_resamples)
    return np.concatenate([np.ones((1, n), dtype=int), drawn])


def with_interval(draws: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The value in the first draw, and the bounds of the 95 % percentile interval of the others.

    `draws` has the draws along its first axis. Draws in which nothing counts (NaN) are left out; NaN where
    no draw is left.
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
    values : array, shape (n,), or (draws, n) when every draw has its own
    weights : array, shape (draws, n), whole numbers

    Returns
    -------
    array, shape (draws,): what `np.nanmedian` of the repeated values is; NaN where none was drawn
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
