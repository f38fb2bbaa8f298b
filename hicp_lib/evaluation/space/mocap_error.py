"""Errors of lifted keypoints against motion capture (paper section IV-C, Tables III and IV).

The reference of a joint is the mean of its two markers, as in the paper. Simulated recordings also know
the joint's centre, which no marker can sit on; errors against it are reported, too.

Throughout, `errors` is the table of `mocap_errors`: one row per detector, method, joint and *frame*,
including frames without the joint, so that missing ones count; tables of several people are joined by
`hicp_lib.evaluation.cases.over_people`, with a column `subject`. Intervals are 95 % ones of a bootstrap that
resamples people, and blocks of frames of each; with one person, blocks only.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from hicp_lib.core.camera import transform
from hicp_lib.core.errors import InputError
from hicp_lib.evaluation.space.stability import POSITION, THRESHOLDS_M
from hicp_lib.evaluation.statistics import resampling as boot
from hicp_lib.evaluation.statistics.proportions import smallest_difference
from hicp_lib.evaluation.statistics.resampling import Draws, weighted_median, with_interval
from hicp_lib.mocap.synchronisation import interpolate_mocap
from hicp_lib.recordings.qualisys import MotionCapture

# Elbows and wrists are in the paper's tables; shoulders are reported separately.
TABLE_JOINTS = ("left_elbow", "right_elbow", "left_wrist", "right_wrist")
JOINTS = (*TABLE_JOINTS, "left_shoulder", "right_shoulder")
MARKERS: dict[str, tuple[str, str]] = {
    joint: (f"{part}_{side}_1", f"{part}_{side}_2") for joint in JOINTS for side, part in [joint.split("_")]
}
MIN_SCORES = (0.3, 0.1)
_CASE = ["detector", "method", "keypoint"]


def marker_means(
    mocap: MotionCapture, stamps_s: np.ndarray, T_base_mocap: np.ndarray, joints: Sequence[str] = JOINTS
) -> pd.DataFrame:
    """Reference positions of joints at the camera's times: the mean of each joint's two markers.

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
        `lift_recording`'s table with columns `detector, method` before its own; the person with the highest
        score of a frame is used.
    reference : DataFrame
        As from `marker_means`.
    truth : DataFrame, optional
        As from `read_truth`; None if unknown.

    Returns
    -------
    DataFrame
        A row per detector, method and row of `reference`: columns `detector, method, frame, keypoint, x_m,
        y_m, z_m, score` (0 where not detected), `reference_x_m, reference_y_m, reference_z_m, error_m` (NaN
        if not lifted or without a reference), `centre_error_m` (NaN without truth).
    """
    keys = ["frame", "keypoint"]
    centres = pd.DataFrame(columns=[*keys, *POSITION]) if truth is None else truth[[*keys, *POSITION]]
    at = reference.rename(columns={name: f"reference_{name}" for name in POSITION})
    at = at.merge(centres.rename(columns={name: f"centre_{name}" for name in POSITION}), on=keys, how="left")
    best = points.loc[points["person"] == 0, [*_CASE[:2], *keys, *POSITION, "score"]]
    cases = best[_CASE[:2]].drop_duplicates().merge(at, how="cross")
    table = cases.merge(best, on=[*_CASE[:2], *keys], how="left").fillna({"score": 0.0})
    for name, column in (("reference", "error_m"), ("centre", "centre_error_m")):
        other = table[[f"{name}_{axis}" for axis in POSITION]].to_numpy(float)
        table[column] = np.linalg.norm(table[POSITION].to_numpy(float) - other, axis=1)
    return table.drop(columns=[f"centre_{axis}" for axis in POSITION])


def median_errors(
    errors: pd.DataFrame, min_scores: Sequence[float] = MIN_SCORES, draws: Draws = Draws()
) -> pd.DataFrame:
    """Count and median distance of keypoints above a score: Tables III and IV.

    Parameters
    ----------
    errors : DataFrame
        `mocap_errors`.
    min_scores : sequence of float, optional
        Keypoints above each count.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `detector, method, keypoint, min_score, count` (frames with the keypoint above the score,
        lifted, and motion capture), `n_frames, n_people` (with motion capture), `median_m, low_m, high_m`,
        `found, found_low, found_high` (count as a share of `n_frames`), `centre_median_m` (against the
        joint's centre), `block_frames`.
    """
    rows, block_frames = [], _block_length(errors)
    for case, part, found_m, weights in _cases(errors, min_scores, draws, block_frames):
        found, known = np.isfinite(found_m), part["reference_x_m"].notna().to_numpy()
        n_people = len(set(_subjects(part)[known]))
        medians = with_interval(weighted_median(found_m, weights), n_people)
        shares = _share(weights, found, known, n_people, block_frames)
        centre_m = part["centre_error_m"].where(part["score"] > case[-1]).median()
        rows.append((*case, found.sum(), known.sum(), n_people, *medians, *shares, centre_m, block_frames))
    numbers = [
        "count", "n_frames", "n_people", "median_m", "low_m", "high_m", "found", "found_low", "found_high",
    ]  # fmt: skip
    return pd.DataFrame(rows, columns=[*_CASE, "min_score", *numbers, "centre_median_m", "block_frames"])


def median_differences(
    errors: pd.DataFrame,
    between: str = "detector",
    min_scores: Sequence[float] = MIN_SCORES,
    draws: Draws = Draws(),
) -> pd.DataFrame:
    """Differences of medians between cases that differ in one label only, on the same resamples.

    Parameters
    ----------
    errors : DataFrame
        `mocap_errors`.
    between : str, optional
        The label: "detector", "method", or "min_score".
    min_scores : sequence of float, optional
        Keypoints above each count.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `detector, method, keypoint, min_score, other` (the label of the subtracted case),
        `value_m, low_m, high_m, n_people` (with a median by both), `detectable_m` (`smallest_difference` of
        people's own medians); both directions are included.
    """
    labels = [*_CASE, "min_score"]
    k, rows, drawn, of_people = labels.index(between), [], {}, {}
    for case, part, found_m, weights in _cases(errors, min_scores, draws, _block_length(errors)):
        drawn[case] = weighted_median(found_m, weights)
        of_people[case] = pd.Series(found_m).groupby(_subjects(part)).median()
    for case, medians_m in drawn.items():
        for other in dict.fromkeys(one[k] for one in drawn if one[k] != case[k]):
            its = (*case[:k], other, *case[k + 1 :])
            apart_m = (of_people[case] - of_people[its]).dropna()
            interval = with_interval(medians_m - drawn[its], len(apart_m))
            rows.append((*case, other, *interval, len(apart_m), smallest_difference(apart_m)))
    numbers = ["value_m", "low_m", "high_m", "n_people", "detectable_m"]
    return pd.DataFrame(rows, columns=[*labels, "other", *numbers])


def distance_shares(
    errors: pd.DataFrame,
    min_scores: Sequence[float] = MIN_SCORES,
    thresholds_m: Sequence[float] = THRESHOLDS_M,
    beyond: bool = False,
    draws: Draws = Draws(),
) -> pd.DataFrame:
    """Share of the frames with motion capture in which a joint was found within a distance of its reference.

    Parameters
    ----------
    errors : DataFrame
        `mocap_errors`.
    min_scores : sequence of float, optional
        Thresholds above which keypoints count as found.
    thresholds_m : sequence of float, optional
        The distances.
    beyond : bool, optional
        Whether to give the share beyond the distance instead, of the frames in which the joint was found.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `detector, method, keypoint, min_score, threshold_m, value, low, high, n_people`; NaN where
        none was found.
    """
    rows, block_frames = [], _block_length(errors)
    for case, part, found_m, weights in _cases(errors, min_scores, draws, block_frames):
        of = np.isfinite(found_m) if beyond else part["reference_x_m"].notna().to_numpy()
        n_people = len(set(_subjects(part)[of]))
        for threshold_m in thresholds_m:
            hits = found_m > threshold_m if beyond else found_m <= threshold_m
            interval = _share(weights, hits, of, n_people, block_frames)
            rows.append((*case, threshold_m, *interval, n_people))
    columns = [*_CASE, "min_score", "threshold_m", "value", "low", "high", "n_people"]
    return pd.DataFrame(rows, columns=columns)


def _cases(
    errors: pd.DataFrame, min_scores: Sequence[float], draws: Draws, block_frames: int
) -> Iterator[tuple[tuple, pd.DataFrame, np.ndarray, np.ndarray]]:
    """Labels, rows, errors of found joints (n_frames,) and weights of frames, the same for all cases."""
    whose = _subjects(errors.drop_duplicates("frame").sort_values("frame"))
    weights = boot.draw_counts(whose, draws, block_frames)
    for case, part in errors.groupby(_CASE, sort=False):
        part = part.sort_values("frame")
        for min_score in min_scores:
            found_m = part["error_m"].where(part["score"] > min_score).to_numpy()
            yield (*case, min_score), part, found_m, weights


def _share(
    weights: np.ndarray, hits: np.ndarray, of: np.ndarray, n_people: int, block_frames: int
) -> tuple[float, float, float]:
    """Share of some frames that are hits, and its interval; draws without any of them are left out."""
    total = weights @ of
    drawn = np.where(total > 0, (weights @ (hits & of)) / np.maximum(total, 1), np.nan)
    return with_interval(drawn, n_people, -(-of.sum() // block_frames))


def _subjects(errors: pd.DataFrame) -> np.ndarray:
    """The subject of each row; one person for all rows without such a column."""
    return errors.get("subject", pd.Series(0, errors.index)).to_numpy()


def _block_length(errors: pd.DataFrame) -> int:
    """One length for the whole table, so that its rows are comparable."""
    frames = errors.drop_duplicates("frame").sort_values("frame")
    series = errors.pivot_table(index="frame", columns=_CASE, values="error_m", dropna=False)
    return boot.block_length(series.to_numpy(float), _subjects(frames))
