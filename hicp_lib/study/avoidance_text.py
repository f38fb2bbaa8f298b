"""The runs of avoidance for reading: short tables, captions and the numbers the book's prose takes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from hicp_lib.experiments.avoidance.runs import IDEAL, NO_AVOIDANCE, PUBLISHED_GAINS, Run
from hicp_lib.experiments.avoidance.runs import TRUE_KEYPOINTS as TRUE
from hicp_lib.study.table_format import in_cm


def of_animation(run: Run, note: str) -> tuple[str, str]:
    """Caption and alt text of a run's animation."""
    job, nearest_cm = run.job, 100 * run.cycles["distance_m"].min()
    caption = (
        f"{job.trial.script}, {job.condition}, in real time: the image the robot last took, and robot and "
        f"person in space, threatened taxels red. Data: {note}."
    )
    alt = (
        f"Animation: a person comes near the robot's left hand, the arm gives way and comes back. They come "
        f"no nearer than {nearest_cm:.1f} cm."
    )
    return caption, alt


def runs_text(metrics: pd.DataFrame) -> pd.DataFrame:
    """A run per row: how near the person came, for how long, what the robot did; dashes for what did not."""
    shown = metrics[["script", "detector"]].copy()
    shown["least distance [cm]"] = metrics["min_distance_m"].map(in_cm)
    shown["nearer than 10 cm [s]"] = metrics["under_10cm_s"].map("{:.2f}".format)
    shown["gives way after [s]"] = metrics["reaction_s"].map(_or_dash("{:.2f}"))
    shown["retreat [cm]"] = metrics["retreat_m"].map(in_cm)
    shown["back after [s]"] = metrics["back_s"].map(_or_dash("{:.2f}"))
    return shown


def enough_text(verdicts: pd.DataFrame) -> pd.DataFrame:
    """Least distance, as times that without avoidance, whether it is enough; of `against_no_avoidance`."""
    shown = verdicts[["script", "detector"]].copy()
    shown["least distance [cm]"] = verdicts["min_distance_m"].map(in_cm)
    shown["times that without"] = verdicts["value"].map("{:.1f}".format)
    shown["enough"] = [f"no: {why}" if why else "yes" for why in verdicts["why"]]
    return shown


def losses(metrics: pd.DataFrame) -> pd.DataFrame:
    """Per script and detector: share of images in which the person was found while near, longest loss."""
    rows = metrics[~metrics["detector"].isin(IDEAL)]
    shown = rows[["script", "detector"]].copy()
    shown["found in images [%]"] = (100 * rows["seen_share"]).map(_or_dash("{:.0f}"))
    shown["longest loss [s]"] = rows["blind_s"].map(_or_dash("{:.2f}"))
    return shown.reset_index(drop=True)


def error_table(errors: pd.DataFrame) -> pd.DataFrame:
    """Number of sure keypoints near the hand, median and 95th percentile of their errors."""
    by = errors[errors["near"]].groupby(["script", "detector"], sort=False)["error_m"]
    table = pd.DataFrame({"keypoints": by.size(), "median [cm]": by.median().map(in_cm)})
    return table.assign(**{"95th percentile [cm]": by.quantile(0.95).map(in_cm)}).reset_index()


def times_text(times: pd.DataFrame) -> pd.DataFrame:
    """Per detector, the delay that is simulated and what it took here; of `avoidance.measured_times`."""
    within = times.assign(within=times["time_ms"] <= 1e3 * times["delay_s"])
    by = within.groupby("detector", sort=False)
    table = pd.DataFrame(
        {
            "simulated [ms]": (1e3 * by["delay_s"].first()).map("{:.0f}".format),
            "here, median [ms]": by["time_ms"].median().map("{:.0f}".format),
            "here, no longer than simulated [%]": (100 * by["within"].mean()).map("{:.0f}".format),
        }
    )
    return table.reset_index()


def _or_dash(pattern: str) -> Callable[[float], str]:
    return lambda value: "–" if value != value else pattern.format(value)


def values(metrics: pd.DataFrame, verdicts: pd.DataFrame) -> dict[str, object]:
    """Numbers for the prose; None for what did not happen."""
    by = {name: rows for name, rows in metrics.groupby("detector")}
    enough = verdicts[~verdicts["detector"].isin(IDEAL)]
    return {
        "min_distance_m_no_avoidance": _number(by[NO_AVOIDANCE]["min_distance_m"].max()),
        "min_distance_m_ground_truth": _number(by[TRUE]["min_distance_m"].min()),
        "min_distance_m_published_gains": _number(by[PUBLISHED_GAINS]["min_distance_m"].min()),
        "back_s_ground_truth": _number(by[TRUE]["back_s"].max()),
        "idle_error_m": _number(metrics["idle_error_m"].max()),
        "false_retreats": int(metrics.loc[~metrics["detector"].isin(IDEAL), "false_retreats"].sum()),
        "enough": [f"{row.script}: {row.detector}" for row in enough[enough["enough"]].itertuples()],
        "not_enough": [
            f"{row.script}: {row.detector} ({row.why})" for row in enough[~enough["enough"]].itertuples()
        ],
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
