"""Tables of the motion capture test for reading: centimetres with their intervals, one line per detector."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from hicp_lib.evaluation.space.mocap_error import JOINTS, TABLE_JOINTS
from hicp_lib.mocap.synchronisation import ClockOffset
from hicp_lib.study.table_format import bounds_of, in_cm, wide

_CASE = ["detector", "method"]
_HALVES = ("first half", "second half")
_MARKS = {"n_points": "markers", "rms_m": "residual [mm]", "leave_one_out_m": "leave-one-out [mm]"}
_AGAINST_TRUTH = {"turned_rad": "turned [°]", "added_m": "added [mm]", "worst_m": "at most [mm]"}


def clock_text(clock: ClockOffset) -> pd.DataFrame:
    """The offset of the whole recording, with the correlation there, and of its halves."""
    rows = [("whole recording", clock.offset_s, clock.correlation)]
    rows += [(part, value, np.nan) for part, value in zip(_HALVES, clock.halves_s, strict=True)]
    return pd.DataFrame(rows, columns=["from", "offset [s]", "correlation"])


def beside_paper(medians: pd.DataFrame, paper: pd.DataFrame, min_score: float) -> pd.DataFrame:
    """One of the paper's two tables, what was measured here above the paper's own rows.

    Parameters
    ----------
    medians, paper : as from `median_errors` and `paper_medians`

    Returns
    -------
    DataFrame, columns `detector, lifting` and one per joint: "count / median [cm]", here with the 95 %
    interval
    """
    rows = pd.concat([medians, paper.assign(detector=paper["detector"] + " (paper)", method="paper")])
    rows = rows[(rows["min_score"] == min_score) & rows["keypoint"].isin(TABLE_JOINTS)]
    return _wide(rows.assign(text=[_cell(row) for row in rows.to_dict("records")]), _CASE, "keypoint")


def shoulders_and_centres(medians: pd.DataFrame, min_score: float) -> pd.DataFrame:
    """Median distance [cm] from the markers' mean and, where known, from the joint's centre: "4.0 / 2.1"."""
    rows = medians[medians["min_score"] == min_score]
    pairs = zip(rows["median_m"], rows["centre_median_m"], strict=True)
    rows = rows.assign(text=[f"{in_cm(markers)} / {in_cm(centre)}" for markers, centre in pairs])
    return _wide(rows, _CASE, "keypoint", JOINTS)


def fractions_text(fractions: pd.DataFrame) -> pd.DataFrame:
    """Fractions within each distance as "0.71 [0.65, 0.77]", a column per joint."""
    within = [f"{100 * limit:g} cm" for limit in fractions["threshold_m"]]
    rows = fractions.assign(within=within, text=bounds_of(fractions))
    return _wide(rows, [*_CASE, "within"], "keypoint", JOINTS)


def registrations_text(table: pd.DataFrame) -> pd.DataFrame:
    """`compare_registrations`' table in millimetres and degrees; against the truth only where it is known."""
    known = bool(table["added_m"].notna().any())
    names = {"method": "solution"} | _MARKS | (_AGAINST_TRUTH if known else {})
    shown = table[list(names)].copy()
    for column in shown.columns:
        if column.endswith("_m"):
            shown[column] = 1000 * shown[column]
        elif column.endswith("_rad"):
            shown[column] = np.degrees(shown[column])
    return shown.rename(columns=names)


def costs_text(table: pd.DataFrame) -> pd.DataFrame:
    """`medians_under`'s table: median error [cm] of elbows and wrists, a column per registration."""
    rows = table.assign(text=[in_cm(value) for value in table["median_m"]])
    return _wide(rows, [*_CASE, "part"], "registration")


def ablation_text(table: pd.DataFrame | None) -> pd.DataFrame:
    """`lifting_ablation`'s table in centimetres and per cent; what it needs, where there is none."""
    if table is None:
        return pd.DataFrame({"needs": ["true positions (truth.parquet)"], "here": "not in this recording"})
    changes = [f"{100 * change:+.0f} %" for change in table["p95_change"]]
    errors = {"median [cm]": 100 * table["median_m"], "95th percentile [cm]": 100 * table["p95_m"]}
    methods = table["method"].replace("robust", "+ hand shapes (robust)")
    shown = table[["group", "method", "n_lifted", "n_compared"]].assign(method=methods)
    return shown.assign(**errors, change=changes)


def _cell(row: dict) -> str:
    if row["count"] == 0:
        return "0"
    given = np.isfinite(row["low_m"])
    interval = f" [{in_cm(row['low_m'])}, {in_cm(row['high_m'])}]" if given else ""
    return f"{row['count']:.0f} / {in_cm(row['median_m'])}{interval}"


def _wide(
    rows: pd.DataFrame, index: list[str], columns: str, order: Sequence[str] | None = None
) -> pd.DataFrame:
    """`wide` with joints and methods as one reads them."""
    table = wide(rows, index, columns, order).rename(columns={"method": "lifting"})
    return table.rename(columns=lambda name: name.replace("_", " "))
