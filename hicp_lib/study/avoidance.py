"""What a run of avoidance was worth: how near the person came, how soon the robot gave way and came back."""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from hicp_lib.core.keypoints import HEAD, mirror
from hicp_lib.experiments.avoidance.reaching import LEAVES_S, PHASES_S, SCRIPTS
from hicp_lib.experiments.avoidance.runs import IDEAL, NO_AVOIDANCE, Run, keypoints_m
from hicp_lib.robot.home import HOME_M
from hicp_lib.robot.loop import AVOIDING
from hicp_lib.robot.separation import Separation

WITHIN_M = (0.05, 0.10, 0.20)
FIELD_M = 0.25
"""The person is near the robot's skin when nearer than this: about where its receptive fields begin."""
REACH_M = 0.4  # keypoints this near the post can threaten the hand
CROSSED_M = 0.2  # reactions count from here
MOVED_M = 0.005  # the hand has begun to give way
LOST_S = 0.5  # without a sighting for longer, the robot has forgotten
AT_HEAD_M = 0.15  # a keypoint of the head this near a true one is on the head
ENOUGH_SHARE = 0.5  # of the images; a head that is found in fewer is the reason
BACK_M = 0.02  # the hand is back at its post
SURE = 0.3  # the paper's threshold for scores


def metrics(runs: Iterable[Run]) -> pd.DataFrame:
    """One row per run; seconds and metres, NaN for what did not happen.

    Columns: `script`, `detector` (the condition), `delay_s`, `min_distance_m`, `under_5cm_s`, `under_10cm_s`,
    `under_20cm_s`, `reaction_s` (from the person's coming within `CROSSED_M` to the first motion),
    `retreat_m` (the hand's largest distance from its post), `false_retreats` (begun while the person was
    farther than `FIELD_M`), `idle_error_m` (the hand's mean error before the person moves), `back_s` (from
    the person's having left to the hand's being back), `seen_share` (of the images taken while the person
    is near, those with any sure keypoint in space), `head_share` (those with one of the head that is on the
    head), `blind_s` (longest time the person was near with nothing new seen of them).
    """
    return pd.DataFrame([_metrics(run) for run in runs])


def against_no_avoidance(table: pd.DataFrame, times: float = 2.0) -> pd.DataFrame:
    """How many times the least distance without avoidance each condition keeps, and whether that is enough.

    Parameters
    ----------
    table : pd.DataFrame
        As from `metrics`.
    times : float
        What is enough.

    Returns
    -------
    pd.DataFrame
        Columns `script, detector, min_distance_m, value` (the ratio), `enough` (at least `times`), and
        `why` in words where it is not.

    Examples
    --------
    >>> runs = pd.DataFrame(
    ...     {"script": "a", "detector": [NO_AVOIDANCE, "mediapipe"], "min_distance_m": [0.04, 0.12]}
    ... )
    >>> against_no_avoidance(runs)[["detector", "value", "enough"]].values.tolist()
    [['mediapipe', 3.0, True]]
    """
    base = table[table["detector"] == NO_AVOIDANCE].set_index("script")["min_distance_m"]
    rest = table[table["detector"] != NO_AVOIDANCE].copy()
    rest["value"] = rest["min_distance_m"].to_numpy() / base[rest["script"]].to_numpy()
    rest["enough"] = rest["value"] >= times
    rest["why"] = ["" if row.enough else _why(row) for row in rest.itertuples()]
    columns = ["script", "detector", "min_distance_m", "value", "enough", "why"]
    return rest[columns].reset_index(drop=True)


def sure_keypoints(frame: pd.Series) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of an image of a run: keypoints in space, which of them are sure, and the person's true ones.

    Returns
    -------
    array, shape (n_people, 136, 3)
        In the robot's root frame, metres.
    array of bool, shape (n_people, 136)
        Those in space whose score is above `SURE`.
    array, shape (136, 3)
    """
    points_m, scores, truth_m = keypoints_m(frame)
    return points_m, (scores > SURE) & np.isfinite(points_m[..., 0]), truth_m


def keypoint_errors(runs: Iterable[Run]) -> pd.DataFrame:
    """Error of every sure keypoint that reached the loop: `script`, `detector`, `t_s`, `near`, `error_m`.

    To the person's true keypoint of that name on either side, the nearer one: which of the two hands it is
    matters to names, not to distances. `near`: perceived within `REACH_M` of the hand's post.
    """
    parts = []
    for run in runs:
        for _, frame in run.frames.iterrows():
            points, is_sure, truth = sure_keypoints(frame)
            either_m = [np.linalg.norm(points - side, axis=2) for side in (truth, truth[mirror("halpe136")])]
            near = np.linalg.norm(points - HOME_M["left"], axis=2) < REACH_M
            about = {"script": run.job.trial.script, "detector": run.job.condition, "t_s": frame["t_s"]}
            errors = {"error_m": np.min(either_m, axis=0)[is_sure], "near": near[is_sure]}
            parts.append(pd.DataFrame(errors).assign(**about))
    empty = {"error_m": np.zeros(0), "near": np.zeros(0, bool), "script": [], "detector": [], "t_s": []}
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(empty)


def separations(runs: Iterable[Run], errors: pd.DataFrame, period_s: float) -> dict[str, Separation]:
    """The separation each detector would need: its delay, its error near the hand (95th percentile), speeds.

    The robot's speed is the fastest the hand was in any of the runs. It brakes within one control period,
    which is when its velocities can be zero: an assumption, real joints take longer. Detectors that gave
    no keypoint have no error, and no separation.

    Parameters
    ----------
    runs : iterable of Run
    errors : pd.DataFrame
        As from `keypoint_errors`.
    period_s : float
        Of the controller.

    Returns
    -------
    dict of str to Separation
        By detector; the terms of ISO/TS 15066.
    """
    runs = list(runs)
    robot_m_s = max(float(run.cycles["hand_error_m"].diff().abs().max()) for run in runs) / period_s
    delays_s = {run.job.condition: run.job.delay_s for run in runs if run.job.condition not in IDEAL}
    by_detector = errors[errors["near"]].groupby("detector")["error_m"].quantile(0.95)
    return {
        name: Separation(robot_m_s, delay_s + period_s, period_s, float(by_detector[name]))
        for name, delay_s in delays_s.items()
        if name in by_detector.index
    }


def error_quantiles(errors: pd.DataFrame) -> pd.DataFrame:
    """Of `keypoint_errors` near the hand: columns `script, detector, n_keypoints, median_m, p95_m`."""
    by = errors[errors["near"]].groupby(["script", "detector"], sort=False)["error_m"]
    columns = {"n_keypoints": by.size(), "median_m": by.median(), "p95_m": by.quantile(0.95)}
    return pd.DataFrame(columns).reset_index()


def measured_times(runs: Iterable[Run]) -> pd.DataFrame:
    """What detector and lifting took per image when the runs were first simulated, beside the stated delay.

    Columns: `detector`, `delay_s`, `median_ms`, `within_share` (of the images, those that took no longer than
    the delay). The first image of a run is left out: the detector is made ready with it.
    """
    parts = [
        run.frames[["time_ms"]].iloc[1:].assign(detector=run.job.condition, delay_s=run.job.delay_s)
        for run in runs
        if len(run.frames)
    ]
    empty = pd.DataFrame({"time_ms": [], "detector": [], "delay_s": []})
    times = pd.concat(parts) if parts else empty
    times = times.assign(within=times["time_ms"] <= 1e3 * times["delay_s"])
    by = times.groupby("detector", sort=False)
    columns = {"median_ms": by["time_ms"].median(), "within_share": by["within"].mean()}
    return pd.DataFrame({"delay_s": by["delay_s"].first()} | columns).reset_index()


def _metrics(run: Run) -> dict:
    cycles, job = run.cycles, run.job
    t, distance, away = (cycles[name].to_numpy() for name in ("t_s", "distance_m", "hand_error_m"))
    period_s = t[1] - t[0]
    row = {"script": job.trial.script, "detector": job.condition, "delay_s": job.delay_s}
    row["min_distance_m"] = distance.min()
    row |= {f"under_{round(100 * m)}cm_s": period_s * (distance < m).sum() for m in WITHIN_M}
    row["reaction_s"] = _first(t, away > MOVED_M) - _crossing_s(t, distance)
    row["retreat_m"] = away.max()
    begins = (cycles["status"] == AVOIDING) & (cycles["status"].shift() != AVOIDING)
    row["false_retreats"] = int((begins & (distance >= FIELD_M)).sum())
    row["idle_error_m"] = away[t < PHASES_S["far"]].mean()
    far = np.flatnonzero(away > BACK_M)
    back = far[-1] + 1 if len(far) else 0
    row["back_s"] = max(0.0, t[back] - LEAVES_S[1]) if 0 < back < len(t) else np.nan
    return row | _sightings(run, t[distance < FIELD_M])


def _sightings(run: Run, near_s: np.ndarray) -> dict:
    """How well the person was seen while near, from the images of a run."""
    if not len(run.frames) or not len(near_s):
        return {"seen_share": np.nan, "head_share": np.nan, "blind_s": np.nan}
    frames = run.frames[run.frames["t_s"].between(near_s[0], near_s[-1])]
    sights = [sure_keypoints(frame) for _, frame in frames.iterrows()]
    seen = np.array([is_sure.any() for _, is_sure, _ in sights], bool)
    times = np.concatenate([[near_s[0]], frames["t_s"].to_numpy()[seen], [near_s[-1]]])
    shares = {"seen_share": seen.mean(), "head_share": np.mean([_shows_head(*sight) for sight in sights])}
    return {name: float(share) for name, share in shares.items()} | {"blind_s": float(np.diff(times).max())}


def _shows_head(points_m: np.ndarray, is_sure: np.ndarray, truth_m: np.ndarray) -> bool:
    off_m = np.linalg.norm(points_m[:, HEAD, None] - truth_m[HEAD], axis=-1).min(axis=-1)
    return bool((is_sure[:, HEAD] & (off_m < AT_HEAD_M)).any())


def _crossing_s(t: np.ndarray, distance_m: np.ndarray) -> float:
    """When the distance falls below `CROSSED_M` for the last time before it is least; NaN: it never does."""
    before = distance_m[: distance_m.argmin() + 1]
    outside = np.flatnonzero(before >= CROSSED_M)
    return float(t[outside[-1]]) if len(outside) and before[-1] < CROSSED_M else np.nan


def _first(t: np.ndarray, which: np.ndarray) -> float:
    return float(t[which.argmax()]) if which.any() else np.nan


def _why(row) -> str:
    if np.isnan(row.seen_share):
        return "the controller is too slow"
    if row.seen_share == 0:
        return "the detector never finds the person while they are near"
    if SCRIPTS[row.script].by_head and row.head_share < ENOUGH_SHARE:
        return f"it is the head that comes, and that is found in {row.head_share:.0%} of the images"
    if row.blind_s > LOST_S:
        return f"the person is lost in {1 - row.seen_share:.0%} of the images, for up to {row.blind_s:.1f} s"
    return f"found in {row.seen_share:.0%} of the images, but the hand moves {row.reaction_s:.1f} s late"
