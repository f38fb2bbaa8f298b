"""Calibration of scores: how often a keypoint with a given score is correct, and scores converted to that.

The reliability of a detector's scores is the hit rate of its keypoints (see `keypoint_hits`) against the
score (Niculescu-Mizil and Caruana, "Predicting good probabilities with supervised learning", ICML 2005); the
expected calibration error is the mean distance between the two over bins of the score, weighted with the
keypoints in them (Guo et al., "On calibration of modern neural networks", ICML 2017). The calibration is
isotonic regression, the best monotone curve in the least-squares sense, so it never reverses the order of two
keypoints of a detector.

It is fitted on one half of the source images and evaluated on the other. Raw scores are kept, for the paper's
thresholds; `Calibration.apply` makes new detections.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.extras import needs
from hicp_lib.core.keypoints import GROUPS
from hicp_lib.evaluation.cases import labelled
from hicp_lib.evaluation.statistics.resampling import Draws, draw_counts, with_interval

with needs("analysis"):
    from scipy.optimize import isotonic_regression

N_BINS = 10


@dataclass(frozen=True)
class Calibration:
    """A calibration curve from scores to hit rates.

    Attributes
    ----------
    scores : array, shape (n,)
        Increasing.
    rates : array, shape (n,)
        Non-decreasing hit rates at `scores`; linear between, constant beyond.

    Examples
    --------
    >>> curve = Calibration.fit(np.array([0.2, 0.4, 0.6]), np.array([0, 1, 1]))
    >>> curve(np.array([0.1, 0.3, 0.9]))
    array([0. , 0.5, 1. ])
    """

    scores: np.ndarray
    rates: np.ndarray

    @classmethod
    def fit(cls, scores: np.ndarray, hits: np.ndarray) -> Calibration:
        """Isotonic regression of hits on scores.

        Parameters
        ----------
        scores : array, shape (n,)
            Of keypoints whose truth is known.
        hits : array of bool, shape (n,)
            Whether they are correct.

        Returns
        -------
        Calibration

        Raises
        ------
        InputError
            If there are no scores to fit to.
        """
        if not len(scores):
            raise InputError("no scored keypoints of labelled people; give more images to calibrate on")
        # Equal scores become one point of the curve; otherwise the order of rows would matter.
        levels, place, counts = np.unique(scores, return_inverse=True, return_counts=True)
        rates = isotonic_regression(np.bincount(place, weights=hits) / counts, weights=counts).x
        # Of each constant segment the curve needs only the ends.
        inner = np.zeros(len(levels), dtype=bool)
        inner[1:-1] = (rates[1:-1] == rates[:-2]) & (rates[1:-1] == rates[2:])
        return cls(levels[~inner], np.clip(rates[~inner], 0, 1))

    def __call__(self, scores: np.ndarray) -> np.ndarray:
        """Expected hit rates at scores of any shape."""
        return np.interp(scores, self.scores, self.rates)

    def apply(self, found: Detections, group: str) -> Detections:
        """The detections with a group's keypoint scores calibrated; a missing keypoint keeps 0."""
        keypoints = GROUPS[group]
        given = np.isfinite(found.keypoints_px[:, keypoints]).all(axis=-1)
        scores = found.scores.copy()
        scores[:, keypoints] = np.where(given, self(scores[:, keypoints]), 0.0)
        return replace(found, scores=scores)


def split_half(groups: pd.Series, seed: int = 0) -> np.ndarray:
    """A random half of the groups.

    Parameters
    ----------
    groups : Series, shape (n,)
        Source image of each row; rows of one image are never on both sides.
    seed : int, optional
        Of the draw.

    Returns
    -------
    array of bool, shape (n,)
        True for rows to fit on, False for the other half.

    Examples
    --------
    >>> split_half(pd.Series(["a", "a", "b"])).tolist() in ([True, True, False], [False, False, True])
    True
    """
    names = np.sort(groups.unique())
    chosen = np.random.default_rng(seed).permutation(len(names)) < (len(names) + 1) // 2
    return groups.isin(names[chosen]).to_numpy()


def calibration_study(
    hits: pd.DataFrame, draws: Draws = Draws()
) -> tuple[pd.DataFrame, pd.DataFrame, dict[tuple[str, str], Calibration]]:
    """Fit a calibration per detector and group on half of the source images, evaluate it on the other half.

    A detector without scored keypoints in both halves is left out.

    Parameters
    ----------
    hits : DataFrame
        `keypoint_hits.all_hits`, or rows of `keypoint_hits` with columns `detector, group, source_image`.
    draws : Draws, optional
        Of the bootstrap; its seed also selects the half.

    Returns
    -------
    errors : DataFrame
        Columns `detector, group, n_keypoints, n_images, hit_rate, raw, raw_low, raw_high, calibrated,
        calibrated_low, calibrated_high, change, change_low, change_high`: expected calibration errors on the
        half held out with 95 % bootstrap intervals over source images.
    curves : DataFrame
        Columns `detector, group, scores` ("raw" or "calibrated") and those of `reliability`.
    calibrations : dict of (str, str) to Calibration
        By detector and group.
    """
    fits_on = split_half(hits["source_image"], draws.seed)
    errors, curves, calibrations = [], [], {}
    for (detector, group), rows in hits.assign(fit=fits_on).groupby(["detector", "group"], sort=False):
        to_fit, held_out = rows[rows["fit"]], rows[~rows["fit"]]
        if to_fit.empty or held_out.empty:
            continue
        calibration = Calibration.fit(to_fit["score"].to_numpy(), to_fit["hit"].to_numpy())
        kinds = {"raw": held_out, "calibrated": held_out.assign(score=calibration(held_out["score"]))}
        counts = (len(held_out), held_out["source_image"].nunique(), held_out["hit"].mean())
        errors.append((detector, group, *counts, *_errors(kinds, draws)))
        for kind, table in kinds.items():
            curve = reliability(table["score"], table["hit"], table["source_image"], draws)
            curves.append(labelled(curve, detector=detector, group=group, scores=kind))
        calibrations[detector, group] = calibration
    names = ["detector", "group", "n_keypoints", "n_images", "hit_rate"] + [
        f"{kind}{end}" for kind in ("raw", "calibrated", "change") for end in ("", "_low", "_high")
    ]
    none = pd.DataFrame(columns=["detector", "group", "scores"])
    return pd.DataFrame(errors, columns=names), pd.concat(curves or [none], ignore_index=True), calibrations


def calibration_table(calibrations: Mapping[tuple[str, str], Calibration]) -> pd.DataFrame:
    """Calibrations as a table: columns `detector, group, score, rate`, a row per corner of a curve."""
    points = ((case, zip(its.scores, its.rates, strict=True)) for case, its in calibrations.items())
    rows = [(*case, *point) for case, of_case in points for point in of_case]
    return pd.DataFrame(rows, columns=["detector", "group", "score", "rate"])


def calibrations_of(table: pd.DataFrame) -> dict[tuple[str, str], Calibration]:
    """Calibrations by (detector, group) from a saved `calibration_table`."""
    cases = table.groupby(["detector", "group"], sort=False)
    return {case: Calibration(rows["score"].to_numpy(), rows["rate"].to_numpy()) for case, rows in cases}


def _errors(kinds: Mapping[str, pd.DataFrame], draws: Draws) -> Iterator[float]:
    """Value and interval of each kind's calibration error and, on the same resamples, of their difference."""
    samples = []
    for rows in kinds.values():
        sums = _sums(rows["score"], rows["hit"], rows["source_image"])
        samples.append(_error(_resampled(sums, draws)))
    samples.append(samples[1] - samples[0])
    for drawn in samples:
        yield from with_interval(drawn)


def reliability(
    scores: np.ndarray, hits: np.ndarray, groups: np.ndarray, draws: Draws = Draws()
) -> pd.DataFrame:
    """Hit rate per bin of the score, with 95 % bootstrap intervals over groups.

    Parameters
    ----------
    scores : array, shape (n,)
        In [0, 1].
    hits : array of bool, shape (n,)
        Whether the keypoints are right.
    groups : array, shape (n,)
        Their source images.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        One row per non-empty bin, columns `bin` (0-9), `score` (mean), `rate, low, high, count`.
    """
    sums = _sums(scores, hits, groups)
    count, score_sum, _ = sums.sum(axis=0)
    drawn, n_groups = _resampled(sums, draws), np.count_nonzero(sums[:, 0], axis=0)
    with np.errstate(invalid="ignore"):
        rate, low, high = with_interval(drawn[:, 2] / drawn[:, 0], n_frames=n_groups)
        columns = {"score": score_sum / count, "rate": rate, "low": low, "high": high}
    table = pd.DataFrame({"bin": np.arange(N_BINS), **columns, "count": count.astype(int)})
    return table[count > 0].reset_index(drop=True)


def _sums(scores: np.ndarray, hits: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Count, sum of scores and sum of hits per group and bin: shape (n_groups, 3, 10)."""
    scores, hits = np.asarray(scores, float), np.asarray(hits, float)
    group, names = pd.factorize(np.asarray(groups))
    place = group * N_BINS + np.clip((scores * N_BINS).astype(int), 0, N_BINS - 1)
    size = len(names) * N_BINS
    sums = [np.bincount(place, weights=w, minlength=size) for w in (np.ones(len(scores)), scores, hits)]
    return np.stack(sums).reshape(3, len(names), N_BINS).swapaxes(0, 1)


def _resampled(sums: np.ndarray, draws: Draws) -> np.ndarray:
    """Sums (1 + draws, 3, 10) of all groups, then of groups resampled with replacement."""
    return np.tensordot(draw_counts(len(sums), draws), sums, axes=1)


def _error(sums: np.ndarray) -> np.ndarray:
    """Expected calibration error of sums (..., 3, 10)."""
    count, score_sum, hit_sum = np.moveaxis(sums, -2, 0)
    return np.abs(hit_sum - score_sum).sum(axis=-1) / count.sum(axis=-1)
