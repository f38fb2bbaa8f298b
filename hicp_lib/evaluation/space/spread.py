"""Stability and accuracy of still people's keypoints as distances: spread, bias and error.

Beside the shares of `hicp_lib.evaluation.space.stability`, of the same `LiftedViews`.
"""

import numpy as np
import pandas as pd

from hicp_lib.evaluation.space.stability import CASE, LiftedViews, of_each
from hicp_lib.evaluation.statistics.resampling import Draws, draw_counts, weighted_median, with_interval

_LEAST_IMAGES = 3  # of a person: of one, the distance to their median is 0


def spread_and_bias(lifted: LiftedViews, draws: Draws = Draws()) -> pd.DataFrame:
    """Stability and accuracy as distances, over the images in which a keypoint was found.

    Parameters
    ----------
    lifted : LiftedViews
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `view, detector, method, part, n_images` (in which it was found), `n_people` (of spread and
        bias; no intervals from fewer than `MIN_DRAWN` of several), then in metres,
        each with `_low` and `_high` beside it: `spread_m`, the median distance to the subject's median
        position; with `truth` also `bias_m`, how far a subject's median position is from the true one, mean
        over subjects, and `error_m`, the median distance to the truth. For a hand, the mean of each over its
        keypoints; NaN where nothing was found. Spread and bias are of those subjects in at least three of
        whose images the keypoint was found; of n images the spread comes out a share of about 1 / n too
        small, as the median lies between them.
    """
    rows = []
    for case, part, whose, found_m, true_m in lifted.cases():
        weights, n_people = draw_counts(whose, draws), _n_people(found_m, whose)
        n_images = np.isfinite(found_m[..., 0]).sum(axis=0).mean()
        labels = [*CASE, "part", "n_images", "n_people"]
        row = dict(zip(labels, (*case, part, n_images, n_people), strict=True))
        several = n_people > 1 or len(set(whose)) == 1
        for name, drawn in _distances_drawn(found_m, true_m, weights, whose).items():
            interval = with_interval(drawn, n_people if several else 0)
            row |= zip((name, f"{name}_low", f"{name}_high"), interval, strict=True)
        rows.append(row)
    return pd.DataFrame(rows)


def _n_people(found_m: np.ndarray, subjects: np.ndarray) -> int:
    """In how many a keypoint of the part is found in `_LEAST_IMAGES`."""
    counts = [np.isfinite(found_m[of, :, 0]).sum(axis=0).max() for of in of_each(subjects)]
    return int(np.sum(np.array(counts) >= _LEAST_IMAGES))


def _distances_drawn(
    found_m: np.ndarray, true_m: np.ndarray | None, weights: np.ndarray, subjects: np.ndarray
) -> dict[str, np.ndarray]:
    """Spread, bias and error in every draw, shape (draws,), mean over the keypoints found.

    Medians are taken anew in every draw.
    """
    draws: dict[str, list[np.ndarray]] = {"spread_m": [], "bias_m": [], "error_m": []}
    for k, found in enumerate(found_m.swapaxes(0, 1)):
        people = [of for of in of_each(subjects) if np.isfinite(found[of, 0]).sum() >= _LEAST_IMAGES]
        if not people:
            continue
        off_m, biases_m = np.full(weights.shape, np.nan), np.full((len(people), len(weights)), np.nan)
        for of, bias_m in zip(people, biases_m, strict=True):
            medians = [weighted_median(found[of, i], weights[:, of]) for i in range(3)]
            median_m = np.stack(medians, axis=1)
            off_m[:, of] = np.linalg.norm(found[of] - median_m[:, None], axis=-1)
            if true_m is not None:  # the same in all images of somebody who keeps still
                bias_m[:] = np.linalg.norm(median_m - true_m[of, k].mean(axis=0), axis=1)
        draws["spread_m"].append(weighted_median(off_m, weights))
        if true_m is not None:
            times = np.where(np.isfinite(biases_m), [weights[:, of].mean(axis=1) for of in people], 0.0)
            with np.errstate(invalid="ignore"):
                draws["bias_m"].append((times * np.nan_to_num(biases_m)).sum(axis=0) / times.sum(axis=0))
            draws["error_m"].append(weighted_median(np.linalg.norm(found - true_m[:, k], axis=1), weights))
    names = ("spread_m",) if true_m is None else tuple(draws)
    nothing = [np.full(len(weights), np.nan)]
    return {name: np.mean(draws[name] or nothing, axis=0) for name in names}
