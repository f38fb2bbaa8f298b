"""How long the blocks of frames must be that `hicp_lib.evaluation.statistics.resampling` draws together."""

import numpy as np
from numpy.typing import ArrayLike

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
