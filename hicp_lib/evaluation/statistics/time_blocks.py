"""Moving block bootstrap: frames of a recording are alike for a while, so stretches of them are drawn.

Künsch (Annals of Statistics 1989). The draws are weights per frame, for
`hicp_lib.evaluation.statistics.resampling`.
"""

import numpy as np

from hicp_lib.evaluation.statistics.resampling import MIN_DRAWN

_LEAST_BLOCKS = 4  # a recording is made of
_MAX_CORRELATION = 0.999


def block_length(errors: np.ndarray) -> int:
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

    Returns
    -------
    int
        From 1 to a quarter of the frames.

    Examples
    --------
    >>> block_length(np.sin(np.arange(400) / 20)[:, None])
    100
    """
    n = len(errors)
    if n < 2 * _LEAST_BLOCKS:
        return 1
    seen = np.isfinite(errors)
    medians = np.nanmedian(np.where(seen.any(axis=0), errors, 0.0), axis=0)
    signs = np.where(seen, np.sign(errors - medians), 0.0)
    together = signs[1:] * signs[:-1]
    count = (seen[1:] & seen[:-1]).sum()
    rho = np.clip(np.sin(np.pi / 2 * together.sum() / max(count, 1)), 0.0, _MAX_CORRELATION)
    length = n ** (1 / 3) * (np.sqrt(6) * rho / (1 - rho**2)) ** (2 / 3)
    return int(np.clip(np.ceil(length), 1, n // _LEAST_BLOCKS))


def draw_blocks(n_frames: int, length: int, n_resamples: int, seed: int) -> np.ndarray:
    """How often each frame is drawn.

    Parameters
    ----------
    n_frames : int
        Frames of the recording.
    length : int
        Of the blocks, in frames. Fewer than `resampling.MIN_DRAWN` of them are not drawn again.
    n_resamples : int
        Number of draws.
    seed : int
        Of the draws.

    Returns
    -------
    array of int, shape (1 + n_resamples, n_frames)
        The first row is the recording itself, each frame once. Every other row is made of blocks that start
        anywhere, the last one cut so that as many frames are drawn as there are.
    """
    rng = np.random.default_rng(seed)
    n_blocks = -(-n_frames // length)
    n_resamples = n_resamples if n_blocks >= MIN_DRAWN else 0
    starts = rng.integers(n_frames - length + 1, size=(n_resamples, n_blocks, 1))
    frames = (starts + np.arange(length)).reshape(n_resamples, n_blocks * length)[:, :n_frames]
    counts = np.zeros((1 + n_resamples, n_frames), dtype=int)
    counts[0] = 1
    np.add.at(counts, (np.arange(1, 1 + n_resamples)[:, None], frames), 1)
    return counts
