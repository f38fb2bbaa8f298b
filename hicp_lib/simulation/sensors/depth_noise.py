"""What errors of stereo matching have in common: they are smooth over the matching window."""

from __future__ import annotations

from statistics import NormalDist

import cv2
import numpy as np

from hicp_lib.core.memo import memoised

Rng = np.random.Generator
_TILE_PX = 1536


def correlated_noise(shape: tuple[int, int], window_px: int, rng: Rng) -> np.ndarray:
    """Normal noise of variance 1, smooth over a matching window, float32: a random piece of the kept one."""
    tile = _noise_tile(window_px)
    start = rng.integers(tile.shape)
    rows, columns = (np.arange(n) + first for n, first in zip(shape, start, strict=True))
    return tile.take(rows, axis=0, mode="wrap").take(columns, axis=1, mode="wrap")


@memoised(4)
def _noise_tile(window_px: int) -> np.ndarray:
    """Square noise that goes on at its other side: drawing it anew would cost more than matching."""
    white = np.random.default_rng(window_px).standard_normal((_TILE_PX, _TILE_PX), np.float32)
    sigma = np.sqrt((window_px**2 - 1) / 12)  # the window's own standard deviation
    if sigma == 0:
        return white
    reach = int(3 * sigma)
    kernel = cv2.getGaussianKernel(2 * reach + 1, sigma)
    smooth = cv2.sepFilter2D(np.pad(white, reach, mode="wrap"), -1, kernel, kernel)
    return smooth[reach:-reach, reach:-reach] / np.float32((kernel**2).sum())


def patches(shape: tuple[int, int], share: float, window_px: int, rng: Rng) -> np.ndarray:
    """Patches as large as a matching window that cover a share of the image."""
    if not 0 < share < 1:
        return np.full(shape, share >= 1)
    return correlated_noise(shape, window_px, rng) > NormalDist().inv_cdf(1 - share)
