"""Evaluation of avoidance over people: clearances, reaction times, and reasons of failures."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd

from hicp_lib.core.keypoints import HEAD, mirror
from hicp_lib.evaluation.statistics.proportions import mean_with_interval
from hicp_lib.experiments.avoidance.closed_loop import Latency
from hicp_lib.experiments.avoidance.error_model import GROUPS, found_groups
from hicp_lib.experiments.avoidance.reaching import LEAVES_S, LOOKED_AT_S, SCRIPTS
from hicp_lib.experiments.avoidance.runs import IDEAL, Run, keypoints_m
from hicp_lib.experiments.avoidance.sweeps import least_distances
from hicp_lib.robot.home import HOME_M
from hicp_lib.robot.loop import AVOIDING

MARKS_M = (0.05, 0.10)
"""Clearances to check."""
UNTIL = {"in the first reach": "reach_m", "until they leave": "min_distance_m"}
"""Period of a smallest distance: its column of `metrics`."""
FIELD_M = 0.25
"""The person is near the robot's skin below this distance, about where its receptive fields start."""
REACH_M = 0.4  # keypoints this near the post can threaten the hand
CROSSED_M = 0.2  # reactions are measured from here
MOVED_M = 0.005  # the hand has started to move
LOST_S = 0.5  # without a detection for longer, keypoints are dropped
AT_HEAD_M = 0.15  # a keypoint of the head this near a true one is on the head
ENOUGH_SHARE = 0.5  # of the images; a head found in fewer is the reason
Z = 1.96  # of 95 %
BACK_M = 0.02  # the hand is back at its post
SURE = 0.3  # the paper's threshold for scores


def metrics(runs: Iterable[Run]) -> pd.DataFrame:
    """One row per run; seconds and metres, NaN for what did not happen.

    Columns: `script`, `subject`, `detector`, `gains`, `latency_s`, `reach_m` and `min_distance_m` (see
    `sweeps.least_distances`), `under_5cm_s`, `under_10cm_s`, `reaction_s` (from the person's crossing of
    `CROSSED_M` to the first motion), `retreat_m` (the hand's largest distance from its post),
    `false_retreats` (started while the person was farther than `FIELD_M`), `back_s` (from the person's
    leaving until the hand is back), `seen_share` (share of the images taken while the person is near that
    have a sure keypoint in space), `head_share` (those with a head keypoint on the head), `blind_s` (longest
    time the person was near without a new detection).
    """
    return pd.DataFrame([_metrics(run) for run in runs])


def over_people(table: pd.DataFrame, by: Sequence[str], of: str = "min_distance_m") -> pd.DataFrame:
    """Clearances of a group of runs, one of each person.

    Parameters
    ----------
    table : pd.DataFrame
        As from `metrics` or `sweeps.sweep`.
    by : sequence of str
        Columns that make the groups.
    of : str, optional
        The clearance's column.

    Returns
    -------
    pd.DataFrame
        Columns `by`; `value, low, high`, the mean and its 95 % interval over people (none from fewer than
        ten); for each of `MARKS_M`, such as `kept_5cm`, the share of people with at least this clearance,
        `kept_5cm_low`,
        `kept_5cm_high` (Wilson's 95 % interval); `n_people`.

    Examples
    --------
    >>> runs = pd.DataFrame({"detector": "a", "script": "b", "subject": [0, 1]})
    >>> runs["min_distance_m"] = 0.04, 0.12
    >>> over_people(runs, ["detector"])[["value", "kept_5cm", "n_people"]].values.tolist()
    [[0.08, 0.5, 2.0]]
    """
    rows = []
    for group, part in table.groupby(list(by), sort=False):
        people = part["script"] + part["subject"].astype(str)
        interval = mean_with_interval(part[of], people, subjects=people)
        row = dict(zip([*by, "value", "low", "high"], (*group, *interval), strict=True))
        for mark_m in MARKS_M:
            name = f"kept_{100 * mark_m:.0f}cm"
            row |= zip((name, f"{name}_low", f"{name}_high"), _share(part[of] >= mark_m), strict=True)
        rows.append(row | {"n_people": people.nunique()})
    return pd.DataFrame(rows)


def clearance(table: pd.DataFrame) -> pd.DataFrame:
    """`over_people` for each of `UNTIL`, of all conditions: a column `until`, and its own.

    Parameters
    ----------
    table : pd.DataFrame
        As from `metrics`.

    Returns
    -------
    pd.DataFrame
    """
    parts = {until: over_people(table, ["detector", "gains"], of) for until, of in UNTIL.items()}
    return pd.concat(parts, names=["until"]).reset_index(level=0)


def _share(flags: pd.Series) -> tuple[float, float, float]:
    """Share of set flags, with Wilson's score interval."""
    k, n = int(flags.sum()), len(flags)
    centre, half = (k + Z**2 / 2) / (n + Z**2), Z / (n + Z**2) * np.sqrt(k * (n - k) / n + Z**2 / 4)
    return k / n, max(centre - half, 0.0), min(centre + half, 1.0)  # rounding may exceed the limits


def reasons(table: pd.DataFrame) -> pd.DataFrame:
    """Reasons why people came nearer than the first of `MARKS_M` in their first reach.

    Parameters
    ----------
    table : pd.DataFrame
        As from `metrics`.

    Returns
    -------
    pd.DataFrame
        Columns `detector, gains, why, n_people`.
    """
    failed = table[(table["reach_m"] < MARKS_M[0]) & (table["detector"] != IDEAL[0])]
    failed = failed.assign(why=[_why(row) for row in failed.itertuples()])
    counts = failed.groupby(["detector", "gains", "why"], sort=False).size()
    return counts.rename("n_people").reset_index()


def false_retreats(table: pd.DataFrame) -> pd.DataFrame:
    """Bystanders for whom the arm moved.

    Parameters
    ----------
    table : pd.DataFrame
        As from `metrics`.

    Returns
    -------
    pd.DataFrame
        Columns `script, detector, value, low, high` (share of people, Wilson's interval), `retreat_m` (the
        largest), `n_people`.
    """
    case = ["script", "detector"]
    retreats = table.groupby(case, sort=False)["retreat_m"]
    rows = [(*group, *_share(of_m > MOVED_M), of_m.max(), len(of_m)) for group, of_m in retreats]
    return pd.DataFrame(rows, columns=[*case, "value", "low", "high", "retreat_m", "n_people"])


def model_check(table: pd.DataFrame, swept: pd.DataFrame, follow_m_s: float) -> pd.DataFrame:
    """Compare first reaches of rendered people with those under modelled errors, with our gains.

    Parameters
    ----------
    table : pd.DataFrame
        As from `metrics`.
    swept : pd.DataFrame
        As from `sweeps.sweep`; has the same people, following at the same speed, at the same latencies.
    follow_m_s : float

    Returns
    -------
    pd.DataFrame
        Columns `detector, rendered_m, modelled_m` (means over people), `apart_m` (root mean square of the
        differences between runs of a person), `n_people`.
    """
    same = swept[(swept["follow_m_s"] == follow_m_s) & (swept["lost_share"] == 0)]
    keys = ["script", "subject", "detector", "gains"]
    both = table.merge(same.drop(columns="latency_s"), on=keys, suffixes=("", "_modelled"))
    both = both[~both["detector"].isin(IDEAL)]
    both["squared"] = (both["reach_m"] - both["reach_m_modelled"]) ** 2
    by = both.groupby("detector", sort=False)
    columns = {"rendered_m": by["reach_m"].mean(), "modelled_m": by["reach_m_modelled"].mean()}
    columns |= {"apart_m": by["squared"].mean() ** 0.5, "n_people": by.size()}
    return pd.DataFrame(columns).reset_index()


def curves(swept: pd.DataFrame, latencies: Mapping[str, Latency]) -> dict[str, pd.DataFrame]:
    """The rows of each curve, by the column that was swept; see `sweeps.variants`."""
    totals_s = {name: latency.total_s for name, latency in latencies.items()}
    stated_s = swept["detector"].map(totals_s).fillna(0.0)
    still, whole, stated = swept["follow_m_s"] == 0, swept["lost_share"] == 0, swept["latency_s"] == stated_s
    kept = {"latency_s": still & whole, "lost_share": still & stated, "follow_m_s": whole & stated}
    return {column: swept[rows].sort_values(column, kind="stable") for column, rows in kept.items()}


def sightings(runs: Iterable[Run]) -> pd.DataFrame:
    """A detector's errors of people's keypoints, in the form of `error_model.fit`."""
    parts = []
    for number, run in enumerate(runs):
        for image, frame in run.frames.iterrows():
            offsets_m = found_groups(*sure_keypoints(frame))
            columns = {"group": [*GROUPS], "in_sight": np.asarray(frame["in_sight"]) > 0}
            columns |= dict(zip(("x_m", "y_m", "z_m"), offsets_m.T, strict=True))
            parts.append(pd.DataFrame(columns).assign(run=number, image=image))
    return pd.concat(parts, ignore_index=True)


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

    To the person's true keypoint of that name on either side, whichever is nearer, since left and right do
    not matter for distances. `near`: perceived within `REACH_M` of the hand's post.
    """
    parts = []
    for run in runs:
        for _, frame in run.frames.iterrows():
            points, is_sure, truth = sure_keypoints(frame)
            either_m = [np.linalg.norm(points - side, axis=2) for side in (truth, truth[mirror("halpe136")])]
            near = np.linalg.norm(points - HOME_M["left"], axis=2) < REACH_M
            about = {"script": run.job.trial.script, "detector": run.job.detector, "t_s": frame["t_s"]}
            errors = {"error_m": np.min(either_m, axis=0)[is_sure], "near": near[is_sure]}
            parts.append(pd.DataFrame(errors).assign(**about))
    empty = {"error_m": np.zeros(0), "near": np.zeros(0, bool), "script": [], "detector": [], "t_s": []}
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(empty)


def measured_times(runs: Iterable[Run]) -> pd.DataFrame:
    """Measured times of detector and lifting per image, from the first simulation, and the stated ones.

    Columns: `detector`, `inference_s` and `latency_s` as stated, `median_ms`, `p99_ms`, `within_share` (of
    the images, those that took no longer than `inference_s`). The first image of a run is left out, as it
    initialises the detector.
    """
    runs, rows = [run for run in runs if len(run.frames)], []
    for detector, latency in {run.job.detector: run.job.latency for run in runs}.items():
        frames = [run.frames for run in runs if run.job.detector == detector]
        times_ms = np.concatenate([part["time_ms"].to_numpy()[1:] for part in frames])
        measured = *np.percentile(times_ms, (50, 99)), np.mean(times_ms <= 1e3 * latency.inference_s)
        rows.append((detector, latency.inference_s, latency.total_s, *measured))
    columns = ["detector", "inference_s", "latency_s", "median_ms", "p99_ms", "within_share"]
    return pd.DataFrame(rows, columns=columns)


def _metrics(run: Run) -> dict:
    cycles, job = run.cycles, run.job
    t, distance, away = (cycles[name].to_numpy() for name in ("t_s", "distance_m", "hand_error_m"))
    period_s = t[1] - t[0]
    row = {"script": job.trial.script, "subject": job.trial.subject.number, "detector": job.detector}
    row |= {"gains": job.gains, "latency_s": job.latency.total_s} | least_distances(cycles)
    row |= {f"under_{round(100 * m)}cm_s": period_s * (distance < m).sum() for m in MARKS_M}
    row["reaction_s"] = _first(t, away > MOVED_M) - _crossing_s(t, distance)
    row["retreat_m"] = away.max()
    begins = (cycles["status"] == AVOIDING) & (cycles["status"].shift() != AVOIDING)
    row["false_retreats"] = int((begins & (distance >= FIELD_M)).sum())
    far = np.flatnonzero(away > BACK_M)
    back = far[-1] + 1 if len(far) else 0
    row["back_s"] = max(0.0, t[back] - LEAVES_S[1]) if 0 < back < len(t) else np.nan
    looked = (t >= LOOKED_AT_S[0]) & (t <= LOOKED_AT_S[1])
    return row | _sightings(run, t[looked & (distance < FIELD_M)])


def _sightings(run: Run, near_s: np.ndarray) -> dict:
    """Detection of the person while near, from the images of a run."""
    if not len(run.frames) or not len(near_s):
        return {"seen_share": np.nan, "head_share": np.nan, "blind_s": np.nan}
    frames = run.frames[run.frames["t_s"].between(near_s[0], near_s[-1])]
    sights = [sure_keypoints(frame) for _, frame in frames.iterrows()]
    seen = np.array([is_sure.any() for _, is_sure, _ in sights], bool)
    times = np.concatenate([[near_s[0]], frames["t_s"].to_numpy()[seen], [near_s[-1]]])
    numbers = seen.mean(), np.mean([_shows_head(*sight) for sight in sights]), np.diff(times).max()
    return dict(zip(("seen_share", "head_share", "blind_s"), map(float, numbers), strict=True))


def _shows_head(points_m: np.ndarray, is_sure: np.ndarray, truth_m: np.ndarray) -> bool:
    off_m = np.linalg.norm(points_m[:, HEAD, None] - truth_m[HEAD], axis=-1).min(axis=-1)
    return bool((is_sure[:, HEAD] & (off_m < AT_HEAD_M)).any())


def _crossing_s(t: np.ndarray, distance_m: np.ndarray) -> float:
    """Time when the distance last falls below `CROSSED_M` before its minimum; NaN if never."""
    before = distance_m[: distance_m.argmin() + 1]
    outside = np.flatnonzero(before >= CROSSED_M)
    return float(t[outside[-1]]) if len(outside) and before[-1] < CROSSED_M else np.nan


def _first(t: np.ndarray, which: np.ndarray) -> float:
    return float(t[which.argmax()]) if which.any() else np.nan


def _why(row) -> str:
    if np.isnan(row.seen_share):
        return "perfect keypoints: the controller is too slow"
    if row.seen_share == 0:
        return "never found while near"
    if SCRIPTS[row.script].by == "head" and row.head_share < ENOUGH_SHARE:
        return "the head comes, and is found in less than half of the images"
    if row.blind_s > LOST_S:
        return f"lost for more than {LOST_S:g} s"
    return "found, and the hand moves too late"
