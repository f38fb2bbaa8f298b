"""Stability and accuracy of a still person's keypoints as distances: spread, bias and error.

Beside the shares of `hicp_lib.evaluation.space.stability`, over the same `points` and views.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from hicp_lib.evaluation.space.stability import CASE, MIN_SCORE, cases, distances, median_position
from hicp_lib.evaluation.statistics.resampling import draw_counts, weighted_median, with_interval


def spread_and_bias(
    points: pd.DataFrame,
    n_frames: Mapping[str, int],
    truth: Mapping[str, pd.DataFrame] | None = None,
    min_score: float = MIN_SCORE,
    n_resamples: int = 1000,
    seed: int = 0,
) -> pd.DataFrame:
    """Stability and accuracy as distances, over the images in which a keypoint was found.

    Parameters
    ----------
    points : DataFrame
        What was lifted, as the module `stability` says.
    n_frames : mapping of str to int
        Number of images, by view.
    truth : mapping of str to DataFrame, optional
        By view, a table with `frame, keypoint, x_m, y_m, z_m`.
    min_score : float, optional
        Keypoints above it count.
    n_resamples, seed : int, optional
        Number of bootstrap draws, and what they are drawn with.

    Returns
    -------
    DataFrame
        Columns `view, detector, method, part, n_images` (in which it was found), then in metres, each with
        `_low` and `_high` beside it: `spread_m`, the median distance to the median position; with `truth`
        also `bias_m`, how far the median position is from the true one, and `error_m`, the median distance to
        the truth. For a hand, the mean of each over its keypoints; NaN where nothing was found.
    """
    rows = []
    for case, part, found_m, true_m in cases(points, n_frames, truth, min_score):
        n_images = np.isfinite(found_m[..., 0]).sum(axis=0).mean()
        row = dict(zip([*CASE, "part", "n_images"], (*case, part, n_images), strict=True))
        weights = draw_counts(len(found_m), n_resamples, seed)
        for name, draws in _distances_drawn(found_m, true_m, weights).items():
            row |= zip((name, f"{name}_low", f"{name}_high"), with_interval(draws), strict=True)
        rows.append(row)
    return pd.DataFrame(rows)


def _distances_drawn(
    found_m: np.ndarray, true_m: np.ndarray | None, weights: np.ndarray
) -> dict[str, np.ndarray]:
    """Spread, bias and error in every draw, shape (draws,), mean over the keypoints found."""
    draws: dict[str, list[np.ndarray]] = {"spread_m": [], "bias_m": [], "error_m": []}
    for k in np.flatnonzero(np.isfinite(found_m[..., 0]).any(axis=0)):
        found = found_m[:, k]
        draws["spread_m"].append(weighted_median(distances(found, None, weights), weights))
        if true_m is not None:
            true = true_m[:, k]
            draws["bias_m"].append(np.linalg.norm(median_position(found - true, weights), axis=1))
            draws["error_m"].append(weighted_median(distances(found, true, weights), weights))
    names = ("spread_m",) if true_m is None else tuple(draws)
    nothing = [np.full(len(weights), np.nan)]
    return {name: np.mean(draws[name] or nothing, axis=0) for name in names}
