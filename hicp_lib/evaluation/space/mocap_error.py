"""Errors of lifted keypoints against motion capture (paper section IV-C, Tables III and IV).

The reference of a joint is the mean of its two markers, as in the paper. Simulated recordings also know
the joint's centre, which no marker can sit on; errors against it are reported beside.

Throughout, `errors` is the table of `mocap_errors`: one row per detector, method, joint and *frame*, also
where nothing was found, so that what is missing counts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from hicp_lib.core.camera import transform
from hicp_lib.core.errors import InputError
from hicp_lib.evaluation.space.stability import THRESHOLDS_M
from hicp_lib.evaluation.statistics.resampling import weighted_median, with_interval
from hicp_lib.evaluation.statistics.time_blocks import block_length, draw_blocks
from hicp_lib.mocap.synchronisation import interpolate_mocap
from hicp_lib.recordings.qualisys import MotionCapture

# Elbows and wrists are in the paper's tables; shoulders are reported apart.
TABLE_JOINTS = ("left_elbow", "right_elbow", "left_wrist", "right_wrist")
JOINTS = (*TABLE_JOINTS, "left_shoulder", "right_shoulder")
MARKERS: dict[str, tuple[str, str]] = {
    joint: (f"{part}_{side}_1", f"{part}_{side}_2") for joint in JOINTS for side, part in [joint.split("_")]
}
MIN_SCORES = (0.3, 0.1)
POSITION = ["x_m", "y_m", "z_m"]
_CASE = ["detector", "method", "keypoint"]
_BINS: dict[str, list[float] | None] = {
    "distance_m": [0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 4.0],
    "score": [0.1, 0.3, 0.5, 0.7, 0.9, 1.001],
    "sight": None,
}


def marker_means(
    mocap: MotionCapture, stamps_s: np.ndarray, T_base_mocap: np.ndarray, joints: Sequence[str] = JOINTS
) -> pd.DataFrame:
    """Where motion capture has the joints at the camera's stamps: the mean of each joint's two markers.

    Parameters
    ----------
    stamps_s : array, shape (n,), on the motion capture's clock
    T_base_mocap : array, shape (4, 4)

    Returns
    -------
    DataFrame, n rows per joint, columns `frame, keypoint, x_m, y_m, z_m` (base frame); NaN where one of
    the two markers is missing

    Raises
    ------
    InputError
        If a joint's markers are not among the names.
    """
    missing = [name for joint in joints for name in MARKERS[joint] if name not in mocap.names]
    if missing:
        raise InputError(
            f"motion capture has no marker {missing[0]!r}; name the markers {MARKERS['left_elbow'][0]}, "
            f"{MARKERS['left_elbow'][1]} and so on, two per joint"
        )
    columns = [mocap.names.index(name) for joint in joints for name in MARKERS[joint]]
    points_m = interpolate_mocap(mocap.times_s, mocap.points_m[:, columns], stamps_s)
    means_m = transform(T_base_mocap, points_m.reshape(len(stamps_s), -1, 2, 3).mean(axis=2))
    frame, joint = np.divmod(np.arange(means_m.shape[0] * len(joints)), len(joints))
    table = pd.DataFrame(means_m.reshape(-1, 3), columns=POSITION)
    return table.assign(frame=frame, keypoint=np.array(joints)[joint])[["frame", "keypoint", *POSITION]]


def mocap_errors(
    points: pd.DataFrame, reference: pd.DataFrame, truth: pd.DataFrame | None = None
) -> pd.DataFrame:
    """Distances of the lifted joints from motion capture, and from the true joint centres.

    Parameters
    ----------
    points : `lift_recording`'s table with columns `detector, method` before its own; the person with the
        best score of a frame counts
    reference : as from `marker_means`
    truth : as from `read_truth`; None where it is not known

    Returns
    -------
    DataFrame, a row per detector, method and row of `reference`: columns `detector, method, frame,
    keypoint, x_m, y_m, z_m, score` (0 where not detected), `reference_x_m, reference_y_m, reference_z_m,
    error_m` (NaN where not lifted or the reference is missing), `centre_error_m` (NaN without truth)
    """
    keys = ["frame", "keypoint"]
    at = reference.rename(columns={name: f"reference_{name}" for name in POSITION})
    centres = pd.DataFrame(columns=[*keys, *POSITION]) if truth is None else truth[[*keys, *POSITION]]
    at = at.merge(centres.rename(columns={name: f"centre_{name}" for name in POSITION}), on=keys, how="left")
    tables = []
    for (detector, method), rows in points[points["person"] == 0].groupby(["detector", "method"], sort=False):
        table = at.merge(rows[[*keys, *POSITION, "score"]], on=keys, how="left").fillna({"score": 0.0})
        for name, column in (("reference", "error_m"), ("centre", "centre_error_m")):
            other = table[[f"{name}_{axis}" for axis in POSITION]].to_numpy(float)
            table[column] = np.linalg.norm(table[POSITION].to_numpy(float) - other, axis=1)
        table = table.drop(columns=[f"centre_{axis}" for axis in POSITION])
        tables.append(table.assign(detector=detector, method=method))
    result = pd.concat(tables, ignore_index=True)
    return result[["detector", "method", *result.columns.drop(["detector", "method"])]]


def median_errors(
    errors: pd.DataFrame,
    min_scores: Sequence[float] = MIN_SCORES,
    n_resamples: int = 1000,
    seed: int = 0,
) -> pd.DataFrame:
    """Count and median distance of the keypoints above a score: Tables III and IV.

    Returns
    -------
    DataFrame, columns `detector, method, keypoint, min_score, count` (frames with the keypoint above the
    score, lifted, and motion capture), `n_frames` (with motion capture), `median_m, low_m, high_m` (95 %
    moving block bootstrap), `centre_median_m` (against the joint's centre), `block_frames`
    """
    rows = []
    length = _block_length(errors)
    for case, part in errors.groupby(_CASE, sort=False):
        weights = draw_blocks(len(part), length, n_resamples, seed)
        for min_score in min_scores:
            values = np.where(part["score"] > min_score, part["error_m"], np.nan)
            centre = part.loc[part["score"] > min_score, "centre_error_m"].median()
            numbers = with_interval(weighted_median(values, weights))
            counts = (int(np.isfinite(values).sum()), int(part["reference_x_m"].notna().sum()))
            rows.append((*case, min_score, *counts, *map(float, numbers), centre, length))
    columns = [*_CASE, "min_score", "count", "n_frames", "median_m", "low_m", "high_m"]
    return pd.DataFrame(rows, columns=[*columns, "centre_median_m", "block_frames"])


def fractions_within(
    errors: pd.DataFrame,
    min_score: float = 0.1,
    thresholds_m: Sequence[float] = THRESHOLDS_M,
    n_resamples: int = 1000,
    seed: int = 0,
) -> pd.DataFrame:
    """Fraction of the frames with motion capture in which a joint was found within a distance of it.

    Returns
    -------
    DataFrame, columns `detector, method, keypoint, threshold_m, value, low, high` (95 % moving block
    bootstrap)
    """
    rows = []
    length = _block_length(errors)
    for case, part in errors.groupby(_CASE, sort=False):
        weights = draw_blocks(len(part), length, n_resamples, seed) * part["reference_x_m"].notna().to_numpy()
        total = np.maximum(weights.sum(axis=1), 1)
        found_m = np.where(part["score"] > min_score, part["error_m"], np.nan)
        for threshold_m in thresholds_m:
            shares = (weights * (found_m <= threshold_m)).sum(axis=1) / total
            rows.append((*case, threshold_m, *map(float, with_interval(shares))))
    return pd.DataFrame(rows, columns=[*_CASE, "threshold_m", "value", "low", "high"])


def errors_by(
    errors: pd.DataFrame, column: str, edges: Sequence[float] | None = None, min_score: float = 0.1
) -> pd.DataFrame:
    """Median and quartiles of the error by another column: distance, score, sight.

    Parameters
    ----------
    edges : bins of a number, each closed on the left; None where the column holds labels

    Returns
    -------
    DataFrame, columns `detector, method, part` ("elbow", both sides together), `by` (the column), `bin`
    (as text), `middle` (of the bin; NaN for labels), `n, median_m, lower_m, upper_m`
    """
    found = errors[(errors["score"] > min_score) & errors["error_m"].notna()]
    part = found["keypoint"].str.split("_").str[1].rename("part")
    bins = found[column] if edges is None else pd.cut(found[column], list(edges), right=False)
    keys = [found["detector"], found["method"], part, bins.rename("bin")]
    grouped = found["error_m"].groupby(keys, sort=False, observed=True)
    table = grouped.quantile([0.25, 0.5, 0.75]).unstack().set_axis(["lower_m", "median_m", "upper_m"], axis=1)
    table = table.assign(n=grouped.size(), by=column).reset_index().sort_values("bin", kind="stable")
    table["middle"] = np.nan if edges is None else np.array([b.mid for b in table["bin"]], dtype=float)
    table["bin"] = [str(b) if edges is None else f"{b.left:g} to {b.right:g}" for b in table["bin"]]
    columns = ["detector", "method", "part", "by", "bin", "middle", "n", "median_m", "lower_m", "upper_m"]
    return table[columns].sort_values(["detector", "method", "part"], kind="stable", ignore_index=True)


def error_dependence(errors: pd.DataFrame, min_score: float = 0.1) -> pd.DataFrame:
    """`errors_by` distance, score and line of sight, one after the other.

    `errors` with the columns `distance_m, sight` of `hicp_lib.evaluation.space.occlusion.lines_of_sight`.
    """
    return pd.concat([errors_by(errors, column, edges, min_score) for column, edges in _BINS.items()])


def _block_length(errors: pd.DataFrame) -> int:
    """One length for the whole table, so that its rows are comparable."""
    series = errors.pivot_table(index="frame", columns=_CASE, values="error_m", dropna=False)
    return block_length(series.to_numpy(float))
