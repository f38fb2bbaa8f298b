"""From a top-down network's output to positions and scores; plain NumPy, all people at once.

Positions are in cells of the output's own grid (or SimCC's bins), cell centres at integers, as these networks
are trained: cell i stands for the input pixel stride * i. A keypoint whose score is not a positive number is
missing: NaN with score 0.
"""

from collections.abc import Callable

import cv2
import numpy as np

# Positions (n, k, 2) and scores (n, k) as the network gives them.
Decoded = tuple[np.ndarray, np.ndarray]


def peaks(maps: np.ndarray) -> Decoded:
    """The highest cell of each heat map (n, k, h, w) and its value.

    Examples
    --------
    >>> cells, scores = peaks(np.array([[[[0.0, 0.5, 0.1], [0.2, 0.3, 0.9]]]]))
    >>> cells.tolist(), scores.tolist()
    ([[[2.0, 1.0]]], [[0.9]])
    """
    flat = maps.reshape(*maps.shape[:2], -1)
    best = flat.argmax(axis=-1)
    scores = np.take_along_axis(flat, best[..., None], axis=-1)[..., 0].astype(float)
    return np.stack([best % maps.shape[3], best // maps.shape[3]], axis=-1).astype(float), scores


@np.errstate(invalid="ignore", over="ignore")
def decode_quarter(maps: np.ndarray, *, needs_both_axes: bool = False) -> Decoded:
    """Heat maps (n, k, h, w): the highest cell, moved a quarter cell towards its higher neighbour.

    (Newell et al., "Stacked hourglass networks", ECCV 2016.) Near the border a cell is not moved: MMPose
    decides this axis by axis, AlphaPose (`needs_both_axes`) moves along both axes or none.
    """
    cells, scores = peaks(maps)
    inner = (1 < cells) & (cells < np.array(maps.shape[:1:-1]) - 1)
    moves = inner.all(axis=-1, keepdims=True) if needs_both_axes else inner & (0 < cells[..., ::-1])
    at = _around(maps, cells)
    step = np.stack([at(1, 0) - at(-1, 0), at(0, 1) - at(0, -1)], axis=-1)
    return given(cells + 0.25 * np.sign(step) * moves, scores)


@np.errstate(invalid="ignore", over="ignore")  # a network may return infinity
def decode_dark(maps: np.ndarray, kernel: int = 11) -> Decoded:
    """Heat maps (n, k, h, w), decoded aware of their distribution (Zhang et al., DARK, CVPR 2020).

    The maps are blurred and scaled back to their old maximum; the second-order Taylor expansion of
    their logarithm at the highest cell gives the maximum of the underlying Gaussian.
    """
    cells, scores = peaks(maps)
    log = _log_around(maps, cells, scores, kernel, 1e-10, np.inf)
    middle = log(0, 0)
    gradient = 0.5 * np.stack([log(1, 0) - log(-1, 0), log(0, 1) - log(0, -1)], axis=-1)
    dxx = 0.25 * (log(2, 0) - 2 * middle + log(-2, 0))
    dyy = 0.25 * (log(0, 2) - 2 * middle + log(0, -2))
    dxy = 0.25 * (log(1, 1) - log(1, -1) - log(-1, 1) + log(-1, -1))
    inner = ((1 < cells) & (cells < np.array(maps.shape[:1:-1]) - 2)).all(axis=-1, keepdims=True)
    return given(cells + np.where(inner, _newton_step(gradient, dxx, dyy, dxy), 0.0), scores)


@np.errstate(invalid="ignore", over="ignore")
def decode_dark_udp(maps: np.ndarray, kernel: int = 11) -> Decoded:
    """Heat maps (n, k, h, w) of a network trained with unbiased data processing, as MMPose decodes them.

    As `decode_dark`, with differences of neighbouring cells, values from 0.001 to 50, and repeated borders
    instead of unmoved cells.
    """
    cells, scores = peaks(maps)
    log = _log_around(maps, cells, scores, kernel, 1e-3, 50.0)
    middle, right, left, below, above = log(0, 0), log(1, 0), log(-1, 0), log(0, 1), log(0, -1)
    gradient = 0.5 * np.stack([right - left, below - above], axis=-1)
    dxx, dyy = right - 2 * middle + left, below - 2 * middle + above
    dxy = 0.5 * (log(1, 1) - right - below + 2 * middle - left - above + log(-1, -1))
    least = np.finfo(np.float32).eps
    return given(cells + _newton_step(gradient, dxx + least, dyy + least, dxy), scores)


def decode_simcc(simcc_x: np.ndarray, simcc_y: np.ndarray) -> Decoded:
    """SimCC vectors (n, k, bins) of both axes: the highest bins, and the lower of their two values.

    (Li et al., "SimCC", ECCV 2022. MMPose takes the lower value, rtmlib the mean.)
    """
    bins = np.stack([simcc_x.argmax(axis=-1), simcc_y.argmax(axis=-1)], axis=-1).astype(float)
    return given(bins, np.minimum(simcc_x.max(axis=-1), simcc_y.max(axis=-1)).astype(float))


def decode_integral(maps: np.ndarray) -> Decoded:
    """Maps of logits (n, k, h, w): the expected position under their sigmoid, normalised to sum 1.

    (Fang et al., "AlphaPose", TPAMI 2022: symmetric integral regression.) The score is the
    sigmoid's maximum.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        heat = np.exp(-maps.astype(np.float32, copy=False))
        heat += 1
        np.reciprocal(heat, out=heat)
        along_x, along_y = heat.sum(axis=2, dtype=float), heat.sum(axis=3, dtype=float)
        total = along_y.sum(axis=-1)
        x = along_x @ np.arange(heat.shape[3]) / total
        y = along_y @ np.arange(heat.shape[2]) / total
    return given(np.stack([x, y], axis=-1), heat.max(axis=(2, 3)).astype(float))


def decode_combined(maps: np.ndarray, n_integral: int) -> Decoded:
    """Maps of which the last `n_integral` (face and hands) are for integral regression."""
    body = decode_quarter(maps[:, :-n_integral], needs_both_axes=True)
    rest = decode_integral(maps[:, -n_integral:])
    return np.concatenate([body[0], rest[0]], axis=1), np.concatenate([body[1], rest[1]], axis=1)


def decode_roi_maps(maps: np.ndarray, boxes_px: np.ndarray) -> Decoded:
    """Keypoint R-CNN's maps of logits (n, k, h, w) over boxes (n, 4: x1, y1, x2, y2), as Detectron2 does.

    Each map is enlarged to its box bicubically and its highest pixel taken. Positions (n, k, 2) have
    pixel corners at integers; the score is the peak's softmax mass, counted over the small map.
    """
    positions, masses = np.zeros((*maps.shape[:2], 2)), np.zeros(maps.shape[:2])
    for row, (roi, (x1, y1, x2, y2)) in enumerate(zip(maps, boxes_px, strict=True)):
        size = np.maximum([x2 - x1, y2 - y1], 1.0)
        pixels = np.ceil(size).astype(int)
        roi = roi.astype(np.float32)
        large = cv2.resize(np.moveaxis(roi, 0, -1), tuple(pixels.tolist()), interpolation=cv2.INTER_CUBIC)
        (cells,), (tops,) = peaks(np.moveaxis(large.reshape(*large.shape[:2], -1), -1, 0)[None])
        positions[row] = (cells + 0.5) * size / pixels + (x1, y1)
        masses[row] = 1 / np.exp(roi - tops[:, None, None]).sum(axis=(1, 2))
    return positions, masses


def given(positions: np.ndarray, scores: np.ndarray) -> Decoded:
    """Positions (n, k, 2) and scores (n, k); NaN and 0 where a score is not positive or either is NaN."""
    is_given = (scores > 0) & np.isfinite(scores) & np.isfinite(positions).all(axis=-1)
    return np.where(is_given[..., None], positions, np.nan), np.where(is_given, scores, 0.0)


def _around(maps: np.ndarray, cells: np.ndarray) -> Callable[[int, int], np.ndarray]:
    """Values of maps (n, k, h, w) next to one cell of each; the border's value beyond the border."""
    rows, (x, y) = np.ogrid[: maps.shape[0], : maps.shape[1]], np.moveaxis(cells.astype(int), -1, 0)

    def at(dx: int, dy: int) -> np.ndarray:
        inside = np.clip(y + dy, 0, maps.shape[2] - 1), np.clip(x + dx, 0, maps.shape[3] - 1)
        return maps[(*rows, *inside)].astype(float)

    return at


def _log_around(
    maps: np.ndarray, cells: np.ndarray, scores: np.ndarray, kernel: int, least: float, most: float
) -> Callable[[int, int], np.ndarray]:
    """Logarithms of the blurred maps next to a cell of each, for values clipped to [least, most]."""
    # The factor keeps the maximum; it only affects clipping.
    blurred = _blur(maps, kernel)
    factor = scores / np.maximum(blurred.max(axis=(2, 3)), np.finfo(np.float32).tiny)
    neighbours = _around(blurred, cells)
    return lambda dx, dy: np.log(np.clip(neighbours(dx, dy) * factor, least, most))


def _newton_step(gradient: np.ndarray, dxx: np.ndarray, dyy: np.ndarray, dxy: np.ndarray) -> np.ndarray:
    """Newton step from a cell to the extremum by its derivatives; zero if there is none."""
    determinant = dxx * dyy - dxy**2
    x, y = gradient[..., 0], gradient[..., 1]
    step = np.stack([dxy * y - dyy * x, dxy * x - dxx * y], axis=-1)
    is_sound = (determinant != 0)[..., None]
    return np.where(is_sound, step / np.where(is_sound, determinant[..., None], 1.0), 0.0)


def _blur(maps: np.ndarray, kernel: int) -> np.ndarray:
    """Gaussian blur of each map with zeros around it: all of them as one tall picture."""
    border = kernel // 2
    padded = np.pad(maps.astype(np.float32, copy=False), ((0, 0), (0, 0), (border, border), (0, 0)))
    tall = padded.reshape(-1, maps.shape[3])
    blurred = cv2.GaussianBlur(tall, (kernel, kernel), 0, borderType=cv2.BORDER_CONSTANT)
    return blurred.reshape(padded.shape)[:, :, border:-border]
