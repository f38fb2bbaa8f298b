"""Temporal stability: keypoints that appear, disappear and jump between frames of a recording.

- A keypoint is *given* in a frame when its score is at least a threshold.
- The *flicker rate* is the share of keypoints given in only one of two consecutive frames, of those given in
  either.
- The *jitter* is the length of the second difference of a keypoint's positions in three consecutive frames,
  divided by the square root of 6: the average length of the error of a single frame, if errors are
  independent. Uniform motion does not contribute.

The causal filter uses past frames only: a keypoint counts as given when it was given in most of the last
`MAJORITY_OF` frames, and its position is smoothed by a One Euro filter (Casiez, Roussel and Vogel, CHI 2012;
the authors' package), which smooths less when a keypoint moves faster. Its latency is the time by which
filtered positions lag behind unfiltered ones: the least-squares factor between that lag and the velocity.

Consecutive frames show nearly the same view if the frame rate is high compared with the motion. Detectors of
hands and faces are also evaluated on the 17 body keypoints that all detectors share.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.extras import needs
from hicp_lib.core.keypoints import COCO_17
from hicp_lib.evaluation.statistics.proportions import mean_with_interval
from hicp_lib.evaluation.statistics.resampling import Draws

with needs("analysis"):
    from OneEuroFilter import OneEuroFilter

MIN_SCORE = 0.3
MAJORITY_OF = 3
MIN_CUTOFF_HZ, BETA = 1.5, 0.02  # of the One Euro filter; beta in Hz per px/s
MAX_GAP_S = 0.5  # maximum gap between consecutive frames
_ANY_RATE_HZ = 1.0  # the filter computes the real rate from the timestamps
_ALMOST_0_S = np.finfo(float).tiny  # the filter treats a timestamp of 0 as missing
_BLOCK_S = 1.0  # stretches of time that are resampled together


def best_person(found: Sequence[Detections], min_score: float = MIN_SCORE) -> np.ndarray:
    """The given body keypoints of the best-scored person of every frame: (n, 17, 2), NaN where not given."""
    tracks = np.full((len(found), len(COCO_17), 2), np.nan)
    for frame, people in enumerate(found):
        if len(people):
            best = int(people.person_scores.argmax())
            given = people.scores[best, COCO_17] >= min_score
            tracks[frame] = np.where(given[:, None], people.keypoints_px[best, COCO_17], np.nan)
    return tracks


def causal_filter(tracks_px: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """Causally filtered tracks, as described in this module.

    Parameters
    ----------
    tracks_px : array, shape (n, k, 2)
        NaN where not given.
    times_s : array, shape (n,)
        Increasing.

    Returns
    -------
    array, shape (n, k, 2)
    """
    return np.stack([_filtered_keypoint(track_px, times_s) for track_px in tracks_px.swapaxes(0, 1)], axis=1)


def _filtered_keypoint(track_px: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    given = np.isfinite(track_px).all(axis=-1)
    result = np.full_like(track_px, np.nan)
    place, seen_s, axes = np.full(2, np.nan), -np.inf, list[Any]()
    for i, time_s in enumerate(times_s):
        if given[i]:
            if time_s - seen_s > MAX_GAP_S:
                axes = [OneEuroFilter(_ANY_RATE_HZ, MIN_CUTOFF_HZ, BETA) for _ in range(2)]
            stamp_s = time_s or _ALMOST_0_S
            place = np.array([axis(float(x), stamp_s) for axis, x in zip(axes, track_px[i], strict=True)])
            seen_s = time_s
        recent = given[max(0, i + 1 - MAJORITY_OF) : i + 1]
        if 2 * recent.sum() > len(recent):
            result[i] = place
    return result


def latency_s(tracks_px: np.ndarray, filtered_px: np.ndarray, times_s: np.ndarray) -> float:
    """The lag of filtered tracks behind the unfiltered ones.

    Parameters
    ----------
    tracks_px, filtered_px : array, shape (n, k, 2)
        NaN where not given.
    times_s : array, shape (n,)
        Increasing.

    Returns
    -------
    float
        NaN where nothing moves.

    Examples
    --------
    >>> moving_px = np.arange(10.0)[:, None, None] * [[3.0, 4.0]]
    >>> round(latency_s(moving_px[1:], moving_px[:-1], np.arange(9) / 10), 3)
    0.1
    """
    steps = np.diff(times_s)[:, None, None]
    velocity = np.diff(tracks_px, axis=0) / steps
    behind = (tracks_px - filtered_px)[1:]
    both = np.isfinite(velocity) & np.isfinite(behind)
    power = (velocity[both] ** 2).sum()
    return float((velocity[both] * behind[both]).sum() / power) if power > 0 else float("nan")


def flicker(
    found: Mapping[str, Sequence[Detections]],
    times_s: np.ndarray,
    draws: Draws = Draws(),
    min_score: float = MIN_SCORE,
) -> pd.DataFrame:
    """Flicker and jitter of every detector, as detected and through the causal filter.

    Parameters
    ----------
    found : mapping of str to sequence of Detections
        Of each frame, by detector.
    times_s : array, shape (n,)
        Increasing.
    draws : Draws, optional
        Of the bootstrap.
    min_score : float, optional
        Minimum score of a given keypoint.

    Returns
    -------
    DataFrame
        Columns `detector, tracks` ("as detected", "filtered"), `measure` ("flicker rate", "jitter [px]",
        "latency [s]"), `value, low, high, n`: 95 % intervals from resampling stretches of a second; none for
        the latency.
    """
    rows = []
    for detector, run in found.items():
        raw = best_person(run, min_score)
        filtered = causal_filter(raw, times_s)
        for kind, tracks in (("as detected", raw), ("filtered", filtered)):
            for measure, (values, at_s) in _measures(tracks, times_s).items():
                interval = mean_with_interval(values, np.floor(at_s / _BLOCK_S), draws)
                rows.append((detector, kind, measure, *interval, len(values)))
            lag_s = 0.0 if kind == "as detected" else latency_s(raw, filtered, times_s)
            rows.append((detector, kind, "latency [s]", lag_s, np.nan, np.nan, len(times_s)))
    return pd.DataFrame(rows, columns=["detector", "tracks", "measure", "value", "low", "high", "n"])


def _measures(tracks_px: np.ndarray, times_s: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Values and their times: whether keypoints flicker, and the jitter."""
    given = np.isfinite(tracks_px).all(axis=-1)
    close = (np.diff(times_s) <= MAX_GAP_S)[:, None]
    either = (given[1:] | given[:-1]) & close
    # 6 is the sum of the squares of 1, -2, 1: of the second difference.
    jumps = np.linalg.norm(np.diff(tracks_px, n=2, axis=0), axis=-1) / np.sqrt(6)
    jumped = np.isfinite(jumps) & close[1:] & close[:-1]
    at_s = np.broadcast_to(times_s[:, None], given.shape)
    changes = (given[1:] != given[:-1])[either]
    return {"flicker rate": (changes, at_s[1:][either]), "jitter [px]": (jumps[jumped], at_s[2:][jumped])}
