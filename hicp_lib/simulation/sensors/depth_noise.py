"""Noise of stereo matching, which is smooth over the matching window."""

from statistics import NormalDist

import cv2
import numpy as np

from hicp_lib.core.memo import memoised

Rng = np.random.Generator
_TILE_PX = 1536


def correlated_noise(shape: tuple[int, int], window_px: int, rng: Rng) -> np.ndarray:
    """Normal noise, smooth over a matching window: a random piece of the cached tile.

    Parameters
    ----------
    shape : tuple of int
    window_px : int
    rng : numpy.random.Generator

    Returns
    -------
    array, dtype float32
        Mean 0, variance 1.
    """
    tile = _noise_tile(window_px)
    start = rng.integers(tile.shape)
    rows, columns = (np.arange(n) + first for n, first in zip(shape, start, strict=True))
    return tile.take(rows, axis=0, mode="wrap").take(columns, axis=1, mode="wrap")


@memoised(4)
def _noise_tile(window_px: int) -> np.ndarray:
    """A periodic noise tile: new noise would cost more than matching."""
    white = np.random.default_rng(window_px).standard_normal((_TILE_PX, _TILE_PX), np.float32)
    sigma = np.sqrt((window_px**2 - 1) / 12)  # the window's own standard deviation
    if sigma == 0:
        return white
    reach = int(3 * sigma)
    kernel = cv2.getGaussianKernel(2 * reach + 1, sigma)
    smooth = cv2.sepFilter2D(np.pad(white, reach, mode="wrap"), -1, kernel, kernel)
    return smooth[reach:-reach, reach:-reach] / np.float32((kernel**2).sum())


def patches(shape: tuple[int, int], share: float, window_px: int, rng: Rng) -> np.ndarray:
    """Patches of the size of a matching window that cover a fraction of the image.

    Parameters
    ----------
    shape : tuple of int
    share : float
        0 to 1.
    window_px : int
    rng : numpy.random.Generator

    Returns
    -------
    array of bool

    Examples
    --------
    >>> holes = patches((480, 640), 0.3, 7, np.random.default_rng(0))
    >>> abs(float(holes.mean()) - 0.3) < 0.02
    True
    """
    if not 0 < share < 1:
        return np.full(shape, share >= 1)
    return correlated_noise(shape, window_px, rng) > NormalDist().inv_cdf(1 - share)
