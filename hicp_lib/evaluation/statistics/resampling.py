"""Bootstrap of people and their frames, as counts of how often each is drawn, for all draws at once.

The first draw is the sample itself, each frame once; the others are the bootstrap's. People (*subjects*) are
resampled, and then the frames of each; with one subject, frames only. Neighbouring frames of a recording are
correlated, so stretches of them can be resampled: a moving block bootstrap (Künsch, Annals of Statistics
1989).

With few people, the usual percentiles would make intervals too narrow, so wider ones are used (Hesterberg,
The American Statistician 2015): where people differ more than their frames, the intervals of a mean over 10
people cover it in 95 % of samples. Where people hardly differ, the variance of frames is counted twice, and
the coverage is 99 %. `block_length` gives the length of the blocks of frames.
"""

from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from hicp_lib.core.extras import needs
from hicp_lib.core.memo import memoised

PERCENTILES = (2.5, 97.5)  # of 95 % intervals
MIN_DRAWN = 10  # a percentile interval from fewer has a coverage far below 95 %, from one none


class Draws(NamedTuple):
    """Settings of a bootstrap.

    Attributes
    ----------
    n : int
        Number of draws.
    seed : int
        Seed of the random numbers.
    """

    n: int = 1000
    seed: int = 0


def draw_counts(frames: int | ArrayLike, draws: Draws, block_length: int = 1) -> np.ndarray:
    """How often each frame is drawn.

    Parameters
    ----------
    frames : int or array, shape (n,)
        Number of frames of one subject, or the subject of each frame; frames of a subject in the order of
        time.
    draws : Draws
        With fewer than `MIN_DRAWN` subjects, or one subject with fewer blocks of frames, there are none, and
        so no interval.
    block_length : int, optional
        Frames that are drawn together; at most a subject's frames.

    Returns
    -------
    array of int, shape (1 + draws.n, n)
        The first row is the sample itself, each frame once. A drawn subject gives as many frames as it has,
        in blocks that start anywhere, the last one cut.

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
    """How often each of a subject's n frames is drawn, (draws, n), if it is drawn `times` (draws,)."""
    if length == 1:
        return rng.multinomial(n * times, np.full(n, 1 / n))
    draw = np.repeat(np.arange(len(times)), times)
    n_blocks = -(-n // length)
    starts = rng.integers(n - length + 1, size=(len(draw), n_blocks, 1))
    frames = (starts + np.arange(length)).reshape(len(draw), n_blocks * length)[:, :n]
    counts = np.zeros((len(times), n), dtype=int)
    np.add.at(counts, (draw[:, None], frames), 1)
    return counts


def with_interval(draws: np.ndarray, n_people: int = 1, n_frames: ArrayLike = 0) -> tuple[Any, Any, Any]:
    """The value in the first draw, and the bounds of the 95 % percentile interval of the others.

    A share of 0 or 1 is so in every draw, but it is not certain. Its interval is the exact one (Clopper and
    Pearson), where each subject counts once, or each frame if there is only one subject.

    Parameters
    ----------
    draws : array, shape (n_draws, ...)
        Draws without a value (NaN) are left out.
    n_people : int, optional
        Number of subjects: with several, the percentiles are those that make a mean's interval as wide as
        Student's. No interval with none, or with two to `MIN_DRAWN` - 1.
    n_frames : int or array, shape (...), optional
        For shares: what was resampled of one subject; no interval from fewer than `MIN_DRAWN`. By default the
        draws are no shares.

    Returns
    -------
    value, low, high : float or array, shape (...)
        NaN if no draw is left.

    Examples
    --------
    >>> [float(x) for x in with_interval(np.array([0.5, 0.0, 1.0, np.nan]))]
    [0.5, 0.025, 0.975]
    >>> [round(float(x), 3) for x in with_interval(np.zeros(1000), n_people=12, n_frames=96)]
    [0.0, 0.0, 0.265]
    """
    others = draws[1:]
    bounds = np.full((2, *draws.shape[1:]), np.nan)
    is_share = np.greater(n_frames, 0)
    n_units = np.where(n_people == 1, n_frames, n_people)
    enough = (n_units >= MIN_DRAWN) | (~is_share & (n_people == 1))
    some = np.isfinite(others).any(axis=0) & enough
    bounds[:, some] = np.nanpercentile(others[:, some], _percentiles(n_people), axis=0)
    exact, reach = some & is_share, (PERCENTILES[0] / 100) ** (1 / np.maximum(n_units, 1))
    low = np.where(exact & (draws[0] == 1), reach, bounds[0])
    high = np.where(exact & (draws[0] == 0), 1 - reach, bounds[1])
    return draws[0], low[()], high[()]


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
    """Medians of values repeated by their weights; NaN is left out.

    Parameters
    ----------
    values : array, shape (n,) or (draws, n)
        One row per draw when every draw has its own.
    weights : array, shape (draws, n)
        How often each value is repeated.

    Returns
    -------
    array, shape (draws,)
        The `np.nanmedian` of the repeated values; NaN if none was drawn.

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
    # The first values that reach half of the weight, and exceed it; the same one for an odd number.
    half = total[:, None] / 2
    places = [reached.argmax(axis=1) for reached in (counts >= half, counts > half)]
    lower, upper = (rows[row, order[row, place]] for place in places)
    return np.where(total > 0, (lower + upper) / 2, np.nan)


_LEAST_BLOCKS = 4  # minimum number of blocks in a recording
_MAX_CORRELATION = 0.999


def block_length(errors: np.ndarray, subjects: ArrayLike | None = None) -> int:
    """Length of the blocks, in frames, for medians and fractions of `errors`.

    A median or a fraction depends on the side of a bound on which each error lies, and must not depend on
    outliers. So the serial correlation is estimated from the *signs* of the errors about their median, by the
    arcsine law of normal processes: rho = sin(pi/2 * correlation of neighbouring signs). For an
    autoregressive process, the length is n^(1/3) (sqrt(6) rho / (1 - rho^2))^(2/3): Carlstein's rule (Annals
    of Statistics 1986) in the form of Sherman, Speed and Speed (1998).

    Parameters
    ----------
    errors : array, shape (n_frames, n_series)
        NaN where missing; their correlations are averaged.
    subjects : array, shape (n_frames,), optional
        The subject of each frame; by default one. Each has its own medians, and only frames of the same
        subject are neighbours.

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
