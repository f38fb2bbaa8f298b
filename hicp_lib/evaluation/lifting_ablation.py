"""What each step of lifting beyond the paper brings: 3D error against known positions, step by step.

All steps are compared on the same keypoints of the same detections: those the paper's method lifts. Steps
may lift more of them, which is counted beside the errors and not in them. The person with the best score of
an image counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import pandas as pd

from hicp_lib.detectors.base import Detections
from hicp_lib.errors import InputError
from hicp_lib.keypoints import HANDS, NAMES
from hicp_lib.rgbd.keypoints3d import Lifting, lift_recording
from hicp_lib.rgbd.recording import Recording
from hicp_lib.rgbd.robust_lifting import STEPS, lift_robust

GROUPS: dict[str, tuple[str, ...]] = {
    "wrists": ("left_wrist", "right_wrist"),
    "elbows": ("left_elbow", "right_elbow"),
    "fingers": tuple(NAMES[i] for i in HANDS if not NAMES[i].endswith("hand_root")),
}

METHODS: dict[str, str | Lifting] = {
    "paper": "paper",
    "+ below the surface": partial(lift_robust, steps=STEPS[:1]),
    "+ near surfaces": partial(lift_robust, steps=STEPS[:2]),
    "+ limb lengths": partial(lift_robust, steps=STEPS[:3]),
    "+ hand shapes": lift_robust,
}
"""The paper's method, then one step more each."""

MIN_SCORE = 0.3
_KEY = ["frame", "keypoint"]
_POSITION = ["x_m", "y_m", "z_m"]


def lifting_ablation(
    recording: Recording,
    detections: Sequence[Detections],
    truth: pd.DataFrame | None,
    min_score: float = MIN_SCORE,
) -> pd.DataFrame:
    """Errors of the paper's lifting and of each step beyond it.

    Parameters
    ----------
    detections : of each frame, in the recording's order
    truth : as `recording.read_truth` gives it
    min_score : detected keypoints count from this score

    Returns
    -------
    DataFrame, one row per group x method, columns group, method, n_detected, n_lifted, n_compared (lifted
        by this and by the paper's method), median_m, p95_m (95th percentile), p95_change (against the
        paper's: -0.4 is 40 % less)

    Raises
    ------
    InputError
        If the recording has no truth, or the detections do not fit it.
    """
    if truth is None:
        raise InputError(f"{recording.folder}: no true positions; only simulated recordings have them")
    errors = lifting_errors(recording, detections, truth, min_score)
    return summary(errors)


def lifting_errors(
    recording: Recording, detections: Sequence[Detections], truth: pd.DataFrame, min_score: float = MIN_SCORE
) -> pd.DataFrame:
    """Distance of every detected keypoint of `GROUPS` from its true position, by every method.

    Returns
    -------
    DataFrame, one row per keypoint detected with `min_score` or more, columns frame, keypoint, group, and one
        per method in metres, NaN where it does not lift; those of several recordings may be put together
    """
    group_of = {name: group for group, names in GROUPS.items() for name in names}
    errors = []
    for name, method in METHODS.items():
        table = lift_recording(recording, detections, method)
        counts = (table["person"] == 0) & (table["score"] >= min_score) & table["keypoint"].isin(group_of)
        both = table[counts].merge(truth[[*_KEY, *_POSITION]], on=_KEY, suffixes=("", "_true"))
        offset = both[_POSITION].to_numpy() - both[[f"{axis}_true" for axis in _POSITION]].to_numpy()
        errors.append(pd.Series(np.linalg.norm(offset, axis=1), both.set_index(_KEY).index, name=name))
    joined = pd.concat(errors, axis=1).reset_index()
    joined.insert(2, "group", joined["keypoint"].map(group_of))
    return joined


def summary(errors: pd.DataFrame) -> pd.DataFrame:
    """The table of `lifting_ablation` from errors of `lifting_errors`."""
    rows = [
        {"group": group, "method": method, **_row(of_group, method)}
        for group, of_group in errors.groupby(pd.Categorical(errors["group"], list(GROUPS)), observed=True)
        for method in METHODS
    ]
    columns = ["group", "method", "n_detected", "n_lifted", "n_compared", "median_m", "p95_m", "p95_change"]
    return pd.DataFrame(rows, columns=columns)


def _row(errors: pd.DataFrame, method: str) -> dict[str, float]:
    both = errors[["paper", method]].notna().all(axis=1)
    compared = errors.loc[both, method]
    row = {"n_detected": len(errors), "n_lifted": errors[method].count(), "n_compared": len(compared)}
    p95_m, paper_m = compared.quantile(0.95), errors.loc[both, "paper"].quantile(0.95)
    return row | {"median_m": compared.median(), "p95_m": p95_m, "p95_change": p95_m / paper_m - 1}
