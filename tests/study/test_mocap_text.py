"""Tables for reading: what stands where."""

import numpy as np
import pandas as pd

from hicp_lib.evaluation.space.mocap_error import JOINTS, TABLE_JOINTS, THRESHOLDS_M, paper_medians
from hicp_lib.mocap.synchronisation import ClockOffset
from hicp_lib.study.mocap_text import (
    ablation_text,
    beside_paper,
    clock_text,
    costs_text,
    fractions_text,
    registrations_text,
    shoulders_and_centres,
)


def medians() -> pd.DataFrame:
    rows = [
        ("a", method, joint, score, 60 + k, 70, 0.04 + 0.01 * (method == "robust"), 0.038, 0.0421, 0.02, 12)
        for method in ("paper", "robust")
        for k, joint in enumerate(JOINTS)
        for score in (0.3, 0.1)
    ]
    columns = [
        "detector",
        "method",
        "keypoint",
        "min_score",
        "count",
        "n_frames",
        "median_m",
        "low_m",
        "high_m",
    ]
    return pd.DataFrame(rows, columns=[*columns, "centre_median_m", "block_frames"])


def test_what_was_measured_stands_above_the_papers_rows():
    table = beside_paper(medians(), paper_medians(), 0.3)
    named = ["alphapose (paper)", "mmpose (paper)", "detectron2 (paper)", "openpose (paper)"]
    assert table["detector"].tolist() == ["a", "a", *named]
    assert table["lifting"].tolist() == ["paper", "robust", *["paper"] * 4]
    assert list(table.columns[2:]) == [joint.replace("_", " ") for joint in TABLE_JOINTS]
    assert table["left wrist"].tolist()[:2] == ["62 / 4.0 [3.8, 4.2]", "62 / 5.0 [3.8, 4.2]"]
    assert table.loc[3, "left elbow"] == "419 / 3.4"


def test_a_joint_that_was_never_found_is_a_plain_zero():
    never = medians().assign(count=0, median_m=np.nan, low_m=np.nan, high_m=np.nan, centre_median_m=np.nan)
    assert beside_paper(never, paper_medians(), 0.1).loc[0, "right wrist"] == "0"
    assert shoulders_and_centres(never, 0.1).loc[0, "right wrist"] == "– / –"


def test_shoulders_and_joint_centres_have_a_table_of_their_own():
    table = shoulders_and_centres(medians(), 0.1)
    assert list(table.columns[2:]) == [joint.replace("_", " ") for joint in JOINTS]
    assert table.loc[1, "left shoulder"] == "5.0 / 2.0"


def test_fractions_have_a_row_per_detector_and_distance():
    rows = [("a", "paper", joint, limit, 10 * limit, 0.1, 0.9) for joint in JOINTS for limit in THRESHOLDS_M]
    columns = ["detector", "method", "keypoint", "threshold_m", "value", "low", "high"]
    table = fractions_text(pd.DataFrame(rows, columns=columns))
    assert table["within"].tolist() == ["2.5 cm", "5 cm", "10 cm"]
    assert table.loc[1, "right elbow"] == "0.50 [0.10, 0.90]"


def test_registrations_are_in_millimetres_and_degrees():
    columns = ["method", "n_points", "rms_m", "leave_one_out_m", "turned_rad", "added_m", "worst_m"]
    table = pd.DataFrame([("all clicks", 90, 0.01, 0.012, np.pi / 180, 0.004, 0.02)], columns=columns)
    assert registrations_text(table).iloc[0].tolist() == ["all clicks", 90, 10, 12, 1, 4, 20]
    unknown = registrations_text(table.assign(added_m=np.nan))
    assert list(unknown.columns) == ["solution", "markers", "residual [mm]", "leave-one-out [mm]"]


def test_costs_have_a_column_per_registration():
    rows = [(r, "a", m, "wrist", 0.03) for r in ("paper", "exact") for m in ("paper", "robust")]
    table = pd.DataFrame(rows, columns=["registration", "detector", "method", "part", "median_m"])
    assert costs_text(table).to_dict("records") == [
        {"detector": "a", "lifting": method, "part": "wrist", "paper": "3.0", "exact": "3.0"}
        for method in ("paper", "robust")
    ]


def test_the_clock_is_in_seconds():
    table = clock_text(ClockOffset(99.5, 0.9, (99.4, 99.6)))
    assert table["offset [s]"].tolist() == [99.5, 99.4, 99.6]


def test_steps_of_lifting_are_in_centimetres_and_per_cent():
    columns = ["group", "method", "n_detected", "n_lifted", "n_compared", "median_m", "p95_m", "p95_change"]
    table = pd.DataFrame(
        [("wrists", "paper", 90, 80, 80, 0.02, 0.1, 0.0), ("wrists", "+ x", 90, 85, 80, 0.01, 0.05, -0.5)],
        columns=columns,
    )
    shown = ablation_text(table)
    assert shown["change"].tolist() == ["+0 %", "-50 %"] and shown.loc[1, "95th percentile [cm]"] == 5
    assert "truth.parquet" in ablation_text(None).loc[0, "needs"]
