"""Errors of lifted keypoints against motion capture (paper section IV-C, Tables III and IV).

The reference of a joint is the mean of its two markers, as in the paper. Simulated recordings also know
the joint's centre, which no marker can sit on; errors against it are reported beside.

Throughout, `errors` is the table of `mocap_errors`: one row per detector, method, joint and *frame*, also
where nothing was found, so that what is missing counts.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from hicp_lib.core.camera import transform
from hicp_lib.core.errors import InputError
from hicp_lib.evaluation.cases import labelled
from hicp_lib.evaluation.space.stability import POSITION, THRESHOLDS_M
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
    mocap : MotionCapture
        With two markers per joint (`MARKERS`).
    stamps_s : array, shape (n,)
        On the motion capture's clock.
    T_base_mocap : array, shape (4, 4)
        Takes the motion capture's coordinates to the base frame.
    joints : sequence of str, optional
        Keys of `MARKERS`.

    Returns
    -------
    DataFrame
        n rows per joint, columns `frame, keypoint, x_m, y_m, z_m` (base frame); NaN where one of the two
        markers is missing.

    Raises
    ------
    InputError
        If a joint's markers are not among the names.
    """
    names = [name for joint in joints for name in MARKERS[joint]]
    missing = [name for name in names if name not in mocap.names]
    if missing:
        raise InputError(
            f"motion capture has no marker {missing[0]!r}; name the markers "
            f"{', '.join(MARKERS['left_elbow'])} and so on, two per joint"
        )
    columns = [mocap.names.index(name) for name in names]
    points_m = interpolate_mocap(mocap.times_s, mocap.points_m[:, columns], stamps_s)
    means_m = transform(T_base_mocap, points_m.reshape(len(stamps_s), -1, 2, 3).mean(axis=2))
    index = pd.MultiIndex.from_product([range(len(stamps_s)), joints], names=["frame", "keypoint"])
    return pd.DataFrame(means_m.reshape(-1, 3), index, POSITION).reset_index()


def mocap_errors(
    points: pd.DataFrame, reference: pd.DataFrame, truth: pd.DataFrame | None = None
) -> pd.DataFrame:
    """Distances of the lifted joints from motion capture, and from the true joint centres.

    Parameters
    ----------
    points : DataFrame
        `lift_recording`'s table with columns `detector, method` before its own; the person with the best
        score of a frame counts.
    reference : DataFrame
        As from `marker_means`.
    truth : DataFrame, optional
        As from `read_truth`; None where it is not known.

    Returns
    -------
    DataFrame
        A row per detector, method and row of `reference`: columns `detector, method, frame, keypoint, x_m,
        y_m, z_m, score` (0 where not detected), `reference_x_m, reference_y_m, reference_z_m, error_m` (NaN
        where not lifted or the reference is missing), `centre_error_m` (NaN without truth).
    """
    keys = ["frame", "keypoint"]
    centres = pd.DataFrame(columns=[*keys, *POSITION]) if truth is None else truth[[*keys, *POSITION]]
    at = reference.rename(columns={name: f"reference_{name}" for name in POSITION})
    at = at.merge(centres.rename(columns={name: f"centre_{name}" for name in POSITION}), on=keys, how="left")
    tables = []
    for (detector, method), rows in points[points["person"] == 0].groupby(["detector", "method"], sort=False):
        table = at.merge(rows[[*keys, *POSITION, "score"]], on=keys, how="left").fillna({"score": 0.0})
        for name, column in (("reference", "error_m"), ("centre", "centre_error_m")):
            other = table[[f"{name}_{axis}" for axis in POSITION]].to_numpy(float)
            table[column] = np.linalg.norm(table[POSITION].to_numpy(float) - other, axis=1)
        table = table.drop(columns=[f"centre_{axis}" for axis in POSITION])
        tables.append(labelled(table, detector=detector, method=method))
    return pd.concat(tables, ignore_index=True)


def median_errors(
    errors: pd.DataFrame, min_scores: Sequence[float] = MIN_SCORES, n_resamples: int = 1000, seed: int = 0
) -> pd.DataFrame:
    """Count and median distance of the keypoints above a score: Tables III and IV.

    Parameters
    ----------
    errors : DataFrame
        `mocap_errors`.
    min_scores : sequence of float, optional
        Keypoints above each count.
    n_resamples, seed : int, optional
        Number of bootstrap draws, and what they are drawn with.

    Returns
    -------
    DataFrame
        Columns `detector, method, keypoint, min_score, count` (frames with the keypoint above the score,
        lifted, and motion capture), `n_frames` (with motion capture), `median_m, low_m, high_m` (95 % moving
        block bootstrap), `centre_median_m` (against the joint's centre), `block_frames`.
    """
    rows = []
    length = _block_length(errors)
    for case, part in errors.groupby(_CASE, sort=False):
        weights = draw_blocks(len(part), length, n_resamples, seed)
        for min_score in min_scores:
            found = part.where(part["score"] > min_score)
            numbers = with_interval(weighted_median(found["error_m"].to_numpy(), weights))
            counts = (found["error_m"].count(), part["reference_x_m"].count())
            rows.append((*case, min_score, *counts, *numbers, found["centre_error_m"].median(), length))
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

    Parameters
    ----------
    errors : DataFrame
        `mocap_errors`.
    min_score : float, optional
        Keypoints above it count as found.
    thresholds_m : sequence of float, optional
        The distances.
    n_resamples, seed : int, optional
        Number of bootstrap draws, and what they are drawn with.

    Returns
    -------
    DataFrame
        Columns `detector, method, keypoint, threshold_m, value, low, high` (95 % moving block bootstrap).
    """
    rows = []
    length = _block_length(errors)
    for case, part in errors.groupby(_CASE, sort=False):
        weights = draw_blocks(len(part), length, n_resamples, seed) * part["reference_x_m"].notna().to_numpy()
        total = np.maximum(weights.sum(axis=1), 1)
        found_m = np.where(part["score"] > min_score, part["error_m"], np.nan)
        for threshold_m in thresholds_m:
            fractions = (weights * (found_m <= threshold_m)).sum(axis=1) / total
            rows.append((*case, threshold_m, *with_interval(fractions)))
    return pd.DataFrame(rows, columns=[*_CASE, "threshold_m", "value", "low", "high"])


def errors_by(
    errors: pd.DataFrame, column: str, edges: Sequence[float] | None = None, min_score: float = 0.1
) -> pd.DataFrame:
    """Median and quartiles of the error by another column: distance, score, occlusion.

    Parameters
    ----------
    errors : DataFrame
        `mocap_errors`, with the column.
    column : str
        What the error is grouped by.
    edges : sequence of float, optional
        Bins of a number, each closed on the left; None where the column holds labels.
    min_score : float, optional
        Keypoints above it count as found.

    Returns
    -------
    DataFrame
        Columns `detector, method, part` ("elbow", both sides together), `by` (the column), `bin` (as text),
        `middle` (of the bin; NaN for labels), `n, median_m, lower_m, upper_m`; no rows where nothing was
        found.
    """
    columns = ["detector", "method", "part", "by", "bin", "middle", "n", "median_m", "lower_m", "upper_m"]
    found = errors[(errors["score"] > min_score) & errors["error_m"].notna()]
    if found.empty:
        return pd.DataFrame(columns=columns)
    part = found["keypoint"].str.split("_").str[1].rename("part")
    bins = found[column] if edges is None else pd.cut(found[column], list(edges), right=False)
    keys = [found["detector"], found["method"], part, bins.rename("bin")]
    grouped = found["error_m"].groupby(keys, sort=False, observed=True)
    table = grouped.quantile([0.25, 0.5, 0.75]).unstack().set_axis(["lower_m", "median_m", "upper_m"], axis=1)
    table = table.assign(n=grouped.size(), by=column).reset_index().sort_values("bin", kind="stable")
    table["middle"] = np.nan if edges is None else np.array([b.mid for b in table["bin"]], dtype=float)
    table["bin"] = [str(b) if edges is None else f"{b.left:g} to {b.right:g}" for b in table["bin"]]
    return table[columns].sort_values(["detector", "method", "part"], kind="stable", ignore_index=True)


def error_dependence(errors: pd.DataFrame, min_score: float = 0.1) -> pd.DataFrame:
    """`errors_by` distance, score and occlusion, one after the other.

    Parameters
    ----------
    errors : DataFrame
        `mocap_errors`, with the columns `distance_m, sight` of
        `hicp_lib.evaluation.space.occlusion.joint_occlusion`.
    min_score : float, optional
        Keypoints above it count as found.

    Returns
    -------
    DataFrame
        As of `errors_by`.
    """
    return pd.concat([errors_by(errors, column, edges, min_score) for column, edges in _BINS.items()])


def _block_length(errors: pd.DataFrame) -> int:
    """One length for the whole table, so that its rows are comparable."""
    series = errors.pivot_table(index="frame", columns=_CASE, values="error_m", dropna=False)
    return block_length(series.to_numpy(float))
