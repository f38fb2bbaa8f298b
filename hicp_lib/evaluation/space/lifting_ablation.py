"""Effect of each step of the robust lifting: 3D error against known positions, step by step.

All steps are compared on the same keypoints of the same detections: those that the paper's method lifts.
Steps may lift more keypoints; these are counted, but not included in the errors. The person with the highest
score of an image is used.
"""

import numpy as np
import pandas as pd

from hicp_lib.core.keypoints import HANDS, NAMES
from hicp_lib.evaluation.space.stability import POSITION
from hicp_lib.lifting.robust import STEPS

GROUPS: dict[str, tuple[str, ...]] = {
    "wrists": ("left_wrist", "right_wrist"),
    "elbows": ("left_elbow", "right_elbow"),
    "fingers": tuple(NAMES[i] for i in HANDS if not NAMES[i].endswith("hand_root")),
}

N_STEPS = {"paper": 0, "+ below the surface": 1, "+ near surfaces": 2, "+ limb lengths": 3}
N_STEPS |= {"robust": len(STEPS)}
"""The paper's method, then one more step each up to all, for `hicp_lib.lifting.table.lift_found`."""

MIN_SCORE = 0.3
_KEY = ["frame", "keypoint"]


def lifting_errors(
    points: pd.DataFrame, truth: pd.DataFrame, T_base_cam: np.ndarray, min_score: float = MIN_SCORE
) -> pd.DataFrame:
    """Distance of every detected keypoint of `GROUPS` from its true position, by every method.

    Parameters
    ----------
    points : DataFrame
        One detector's keypoints as from `lift_found` with `N_STEPS`.
    truth : DataFrame
        As from `recording.read_truth`.
    T_base_cam : array, shape (n, 4, 4)
        Of the frames.
    min_score : float, optional
        Minimum score of detected keypoints.

    Returns
    -------
    DataFrame
        One row per keypoint detected with `min_score` or more, columns `frame, keypoint, group`, one per
        method in metres, NaN where it does not lift, and for the full method `off_m` (error of its depth),
        `sigma_m` and `reason`; tables of several recordings may be concatenated.
    """
    group_of = {name: group for group, names in GROUPS.items() for name in names}
    counts = (points["person"] == 0) & (points["score"] >= min_score) & points["keypoint"].isin(group_of)
    both = points[counts].merge(truth[[*_KEY, *POSITION]], on=_KEY, suffixes=("", "_true"))
    offset = both[POSITION].to_numpy() - both[[f"{axis}_true" for axis in POSITION]].to_numpy()
    off_m = abs((offset * T_base_cam[both["frame"], :3, 2]).sum(axis=1))
    both = both.assign(error_m=np.linalg.norm(offset, axis=1), off_m=off_m)
    errors = both.pivot(index=_KEY, columns="method", values="error_m").reindex(columns=list(N_STEPS))
    whole = both[both["method"] == "robust"].set_index(_KEY)[["off_m", "sigma_m", "reason"]]
    errors = errors.rename_axis(columns=None).join(whole).reset_index()
    errors.insert(2, "group", errors["keypoint"].map(group_of))
    return errors


def sigma_coverage(errors: pd.DataFrame) -> pd.DataFrame:
    """How often a depth is within one and two of its standard deviations of the truth (normal: .68, .95).

    Parameters
    ----------
    errors : DataFrame
        Of `lifting_errors`.

    Returns
    -------
    DataFrame
        One row per group x reason ("lifted" or "guessed"), columns `group, reason, n`, `sigma_m, off_m`
        (medians), `within_1_sigma, within_2_sigma` (shares).
    """
    within = {f"within_{k}_sigma": errors["off_m"] <= k * errors["sigma_m"] for k in (1, 2)}
    lifted = errors.assign(**within).dropna(subset="off_m")
    groups = lifted.groupby([pd.Categorical(lifted["group"], list(GROUPS)), "reason"], observed=True)
    table = groups[["sigma_m", "off_m"]].median().join(groups[list(within)].mean())
    table.insert(0, "n", groups.size())
    return table.rename_axis(["group", "reason"]).reset_index()


def summary(errors: pd.DataFrame) -> pd.DataFrame:
    """Errors of the paper's lifting and of each step beyond it.

    Parameters
    ----------
    errors : DataFrame
        Of `lifting_errors`.

    Returns
    -------
    DataFrame
        One row per group x method, columns `group, method, n_detected, n_lifted, n_compared` (lifted by this
        and by the paper's method), `median_m, p95_m` (95th percentile), `p95_change` (against the paper's:
        -0.4 is 40 % less).
    """
    rows = []
    for group, of_group in errors.groupby(pd.Categorical(errors["group"], list(GROUPS)), observed=True):
        for method in N_STEPS:
            both = of_group[of_group[["paper", method]].notna().all(axis=1)]
            counts = (len(of_group), of_group[method].count(), len(both))
            p95_m, paper_m = (both[name].quantile(0.95) for name in (method, "paper"))
            rows.append((group, method, *counts, both[method].median(), p95_m, p95_m / paper_m - 1))
    columns = ["group", "method", "n_detected", "n_lifted", "n_compared", "median_m", "p95_m", "p95_change"]
    return pd.DataFrame(rows, columns=columns)
