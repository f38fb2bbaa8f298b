"""Resampling of people and of their frames by how often each is drawn: statistics in every draw at once.

The first draw is the sample itself, each frame once; the others are the bootstrap's. People (*subjects*) are
drawn, and in each of those drawn its frames: from one alone, frames only. Frames of a recording are alike for
a while, so stretches of them may be drawn: a moving block bootstrap (Künsch, Annals of Statistics 1989).

Percentiles that fit many people would make the intervals of few too narrow, so theirs lie further out
(Hesterberg, The American Statistician 2015): where people differ more than their frames, those of a mean over
10 people cover it in 95 % of samples. Where people hardly differ, frames count twice, and it is 99 %.

How long the blocks of frames must be, `block_length` says.
"""

from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from hicp_lib.core.extras import needs
from hicp_lib.core.memo import memoised

PERCENTILES = (2.5, 97.5)  # of 95 % intervals
MIN_DRAWN = 10  # a percentile interval from fewer covers far less than 95 %, and from one nothing


class Draws(NamedTuple):
    """The draws of a bootstrap.

    Attributes
    ----------
    n : int
        How many.
    seed : int
        What they are drawn with.
    """

    n: int = 1000
    seed: int = 0


def draw_counts(frames: int | ArrayLike, draws: Draws, block_length: int = 1) -> np.ndarray:
    """How often each frame is drawn.

    Parameters
    ----------
    frames : int or array, shape (n,)
        Number of frames of one subject, or whose each frame is; those of a subject in the order of time.
    draws : Draws
        None are made of fewer than `MIN_DRAWN` subjects, or of one with fewer blocks of frames: there is no
        interval.
    block_length : int, optional
        Frames that are drawn together; cut to a subject's frames.

    Returns
    -------
    array of int, shape (1 + draws.n, n)
        The first row is the sample itself, each once. A subject that is drawn gives as many frames as it has:
        blocks that start anywhere, the last one cut.

    Examples
    --------
    >>> draw_counts(3, Draws())
    array([[1, 1, 1]])
    >>> draw_counts(np.repeat(np.arange(10), 2), Draws()).sum(axis=1).min()
    np.int64(20)
    """
    whose = np.zeros(frames) if isinstance(frames, int | np.integer) else np.asarray(frames)
    return _draw_counts(tuple(pd.factorize(whose)[0].tolist()), draws, block_length)


@memoised(4)
def _draw_counts(subjects: tuple[int, ...], draws: tuple[int, int], block_length: int) -> np.ndarray:
    n_resamples, seed = draws
    rng, sizes = np.random.default_rng(seed), np.bincount(subjects)
    n_units = len(sizes) if len(sizes) > 1 else -(-len(subjects) // block_length)
    n_resamples = n_resamples if n_units >= MIN_DRAWN else 0
    counts = np.ones((1 + n_resamples, len(subjects)), dtype=int)
    times = np.ones((n_resamples, 1), dtype=int)
    if len(sizes) > 1:
        times = rng.multinomial(len(sizes), np.full(len(sizes), 1 / len(sizes)), size=n_resamples)
    for k, n in enumerate(sizes):
        counts[1:, np.equal(subjects, k)] = _draw_blocks(n, min(block_length, n), times[:, k], rng)
    return counts


def _draw_blocks(n: int, length: int, times: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """How often each of a subject's n frames is drawn, (draws, n), where it is drawn `times` (draws,)."""
    if length == 1:
        return rng.multinomial(n * times, np.full(n, 1 / n))
    draw = np.repeat(np.arange(len(times)), times)
    n_blocks = -(-n // length)
    starts = rng.integers(n - length + 1, size=(len(draw), n_blocks, 1))
    frames = (starts + np.arange(length)).reshape(len(draw), n_blocks * length)[:, :n]
    counts = np.zeros((len(times), n), dtype=int)
    np.add.at(counts, (draw[:, None], frames), 1)
    return counts


def with_interval(draws: np.ndarray, n_people: int = 1) -> tuple[Any, Any, Any]:
    """The value in the first draw, and the bounds of the 95 % percentile interval of the others.

    Parameters
    ----------
    draws : array, shape (n_draws, ...)
        Draws in which nothing counts (NaN) are left out.
    n_people : int, optional
        How many subjects the values are of: of several, the percentiles are those with which a mean's
        interval is as wide as Student's. No interval from none, or from two to `MIN_DRAWN` - 1.

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
    some = np.isfinite(others).any(axis=0) & (n_people == 1 or n_people >= MIN_DRAWN)
    bounds[:, some] = np.nanpercentile(others[:, some], _percentiles(n_people), axis=0)
    return draws[0], *bounds


@memoised()
def _percentiles(n_people: int) -> tuple[float, float]:
    if n_people < 2:
        return PERCENTILES
    with needs("analysis"):
        from scipy.stats import t  # a second to load, and not in every installation
    reach = np.sqrt(n_people / (n_people - 1)) * t.ppf(PERCENTILES[1] / 100, n_people - 1)
    tail = 100 * NormalDist().cdf(-reach)
    return tail, 100 - tail


def weighted_median(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Medians of values that are each counted as often as its weight says; NaN is left out.

    Parameters
    ----------
    values : array, shape (n,) or (draws, n)
        One row per draw when every draw has its own.
    weights : array, shape (draws, n)
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
    # The first that reach half of the weight, and go beyond; of an odd number it is one twice.
    half = total[:, None] / 2
    places = [reached.argmax(axis=1) for reached in (counts >= half, counts > half)]
    lower, upper = (rows[row, order[row, place]] for place in places)
    return np.where(total > 0, (lower + upper) / 2, np.nan)


_LEAST_BLOCKS = 4  # a recording is made of
_MAX_CORRELATION = 0.999


def block_length(errors: np.ndarray, subjects: ArrayLike | None = None) -> int:
    """Length of the blocks, in frames, for medians and fractions of `errors`.

    What a median or a fraction averages over time is on which side of a bound each error lies, and outliers
    must not matter. So the serial correlation is taken from the *signs* of the errors about their median,
    by the arcsine law of normal processes: rho = sin(pi/2 * correlation of neighbouring signs). As if of
    an autoregressive process, the length is n^(1/3) (sqrt(6) rho / (1 - rho^2))^(2/3): Carlstein's rule
    (Annals of Statistics 1986) in the form of Sherman, Speed and Speed (1998).

    Parameters
    ----------
    errors : array, shape (n_frames, n_series)
        NaN where missing; their correlations are averaged.
    subjects : array, shape (n_frames,), optional
        Whose each frame is; of one subject when left out. Each has medians of its own, and as neighbours
        count frames of one subject only.

    Returns
    -------
    int
        From 1 to a quarter of the frames, of the subject with the fewest.

    Examples
    --------
    >>> block_length(np.sin(np.arange(400) / 20)[:, None])
    100
    """
    whose = np.zeros(len(errors)) if subjects is None else np.asarray(subjects)
    names, sizes = np.unique(whose, return_counts=True)
    n = min(sizes, default=0)
    if n < 2 * _LEAST_BLOCKS:
        return 1
    alike, count = np.sum([_neighbours(errors[whose == name]) for name in names], axis=0)
    rho = np.clip(np.sin(np.pi / 2 * alike / max(count, 1)), 0.0, _MAX_CORRELATION)
    length = n ** (1 / 3) * (np.sqrt(6) * rho / (1 - rho**2)) ** (2 / 3)
    return int(np.clip(np.ceil(length), 1, n // _LEAST_BLOCKS))


def _neighbours(errors: np.ndarray) -> tuple[float, int]:
    """Sum of the products of neighbours' signs about the median, and number of pairs of them."""
    seen = np.isfinite(errors)
    medians = np.nanmedian(np.where(seen.any(axis=0), errors, 0.0), axis=0)
    signs = np.where(seen, np.sign(errors - medians), 0.0)
    return (signs[1:] * signs[:-1]).sum(), (seen[1:] & seen[:-1]).sum()
