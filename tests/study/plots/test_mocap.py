"""Figures of the test against motion capture, on tables made up: what they draw, carry and say."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.evaluation.space.error_budget import AGAINST_MOCAP, ALL
from hicp_lib.evaluation.space.mocap_error import JOINTS, TABLE_JOINTS
from hicp_lib.study.paper_tables import paper_medians
from hicp_lib.study.plots import mocap as draw
from hicp_lib.study.plots.mocap import error_budget
from hicp_lib.study.plots.palette import PERFECT

N = 90
TIMES_S = 100 + np.arange(N) / 15
DETECTORS = ("mediapipe", "openpose-mobilenet")


@pytest.fixture(scope="module")
def errors() -> pd.DataFrame:
    """A joint that circles; one detector off by 3 cm, one by 8 cm and blind in a third of the frames."""
    rng = np.random.default_rng(0)
    tables = []
    for detector, off_m in zip(DETECTORS, (0.03, 0.08), strict=True):
        for joint in JOINTS:
            phase = np.arange(N) / 10
            reference = np.c_[-1 + 0.1 * np.sin(phase), 0.3 * np.cos(phase), 0.5 + 0.1 * phase / 9]
            error = off_m * np.exp(rng.normal(0, 0.3, N))
            score = np.where(
                (np.arange(N) % 3 == 0) & (detector == DETECTORS[1]), 0.0, rng.uniform(0.2, 1, N)
            )
            reference[40:50] = np.nan
            columns = {f"reference_{axis}_m": reference[:, k] for k, axis in enumerate("xyz")}
            columns |= {f"{axis}_m": reference[:, k] + error * (axis == "x") for k, axis in enumerate("xyz")}
            error[40:50] = np.nan
            tables.append(
                pd.DataFrame(
                    columns | {"error_m": np.where(score > 0, error, np.nan), "score": score}
                ).assign(
                    detector=detector,
                    method="paper",
                    frame=np.arange(N),
                    keypoint=joint,
                    distance_m=1 + 0.01 * np.arange(N),
                    sight=np.where(np.arange(N) % 4, "clear", "hidden"),
                )  # fmt: skip
            )
    return pd.concat(tables, ignore_index=True)


@pytest.fixture
def medians() -> pd.DataFrame:
    """Two detectors and the perfect one at 5, 6 and 3 cm by the paper's lifting, and one by the robust."""
    ours = zip((*DETECTORS, PERFECT), (0.05, 0.06, 0.03), strict=True)
    cases = [("mediapipe", "robust", 0.02), *((name, "paper", median_m) for name, median_m in ours)]
    rows = [(detector, method, joint, 0.1, 90, m, m - 0.01, m + 0.01)
            for joint in TABLE_JOINTS for detector, method, m in cases]  # fmt: skip
    columns = ["detector", "method", "keypoint", "min_score", "count", "median_m", "low_m", "high_m"]
    return pd.DataFrame(rows, columns=columns)


def test_medians_stand_above_the_papers_like_with_like(medians):
    figure = draw.joint_medians(medians, paper_medians(), 0.1, "made up")
    panels = figure.figure.axes
    assert [axis.get_title("left") for axis in panels] == [joint.replace("_", " ") for joint in TABLE_JOINTS]
    names = [label.get_text() for label in panels[0].get_yticklabels()]
    theirs = [f"{name} (paper)" for name in ("alphapose", "mmpose", "detectron2", "openpose")]
    assert names == [*DETECTORS, PERFECT, *theirs]
    dots = {(round(float(line.get_xdata()[0]), 1), float(line.get_ydata()[0]), line.get_mfc() == "white")
            for line, *_ in panels[0].containers}  # fmt: skip
    ours = {(5.0, 0.0, False), (2.0, 0.0, True), (6.0, 1.0, False), (3.0, 2.0, False)}
    assert dots == ours | {(4.0, 3.0, False), (3.5, 4.0, False), (16.7, 5.0, False), (15.4, 6.0, False)}
    (floor,) = [line for line in panels[0].lines if line.get_linestyle() == ":"]
    assert floor.get_xdata() == pytest.approx([3.0, 3.0])
    assert "mediapipe 5.0 to 5.0 cm" in figure.alt and "mmpose (paper) 2.8 to 4.2 cm" in figure.alt
    assert "perfect detector 3.0 cm" in figure.caption and "true keypoints" in figure.caption
    others = medians[medians["detector"] != PERFECT]
    assert "true keypoints" not in draw.joint_medians(others, paper_medians(), 0.1, "made up").caption


def test_medians_are_within_the_limits_whichever_joint_has_the_largest(medians):
    medians.loc[medians["keypoint"] == TABLE_JOINTS[-1], ["median_m", "low_m", "high_m"]] *= 10
    panels = draw.joint_medians(medians, paper_medians(), 0.1, "made up").figure.axes
    assert all(line.get_xdata()[0] < axis.get_xlim()[1] for axis in panels for line, *_ in axis.containers)


def test_residuals_are_lifted_less_captured_and_have_gaps(errors):
    figure = draw.residuals(errors, TIMES_S, "right_wrist", 0.1, "made up")
    x, y, _ = figure.figure.axes
    first = x.lines[0]
    assert len(first.get_xdata()) == N - 10  # ten frames without motion capture
    assert first.get_xdata()[0] == 0 and first.get_xdata()[-1] == pytest.approx((N - 1) / 15)
    assert np.median(first.get_ydata()) == pytest.approx(3, rel=0.2) and not y.lines[0].get_ydata().any()
    assert max(x.lines[1].get_ydata()) == pytest.approx(10)  # further off lies on the border
    assert first.get_marker() != x.lines[1].get_marker()
    assert f"cm in {N - 10} frames" in figure.alt and set(figure.table["detector"]) == set(DETECTORS)


def test_a_joint_motion_capture_never_saw_can_still_be_drawn(errors):
    unseen = errors.assign(**{f"reference_{axis}_m": np.nan for axis in "xyz"}, error_m=np.nan)
    assert draw.residuals(unseen, TIMES_S, "left_wrist", 0.1, "made up").figure.axes


def test_marks_lie_at_the_errors_and_gains_in_centimetres():
    rows = [
        ("paper", part, *row)
        for part in ("wrist", "finger")
        for row in (
            (ALL, "total", 0.05),
            (AGAINST_MOCAP, "total", 0.04),
            ("skin depth", "alone", 0.03),
            ("skin depth", "gain", 0.02),
        )
    ]
    table = pd.DataFrame(rows, columns=["method", "part", "source", "kind", "value_m"])
    table = table.assign(low_m=table["value_m"] - 0.01, high_m=np.nan)
    medians = pd.DataFrame(
        {"detector": "mmpose", "keypoint": ["left_wrist", "left_elbow"], "median_m": [0.027, 0.04]}
    )
    table = table.assign(
        n_people=12, view="upper", detectable_m=np.where(table["kind"] == "gain", 0.004, np.nan)
    )
    both = pd.concat([table, table.assign(view="lower", value_m=9.0)])
    figure = error_budget(both, "upper", medians, "made up")
    wrists, fingers = figure.figure.axes
    drawn = [(line.get_marker(), list(line.get_xdata())) for line in wrists.get_lines()]
    for marker, at_cm in (("s", [5, 4]), ("s", [3]), ("s", [2]), ("|", [2.7])):
        assert (marker, pytest.approx(at_cm)) in drawn
    assert [label.get_text() for label in wrists.get_yticklabels()] == [ALL, AGAINST_MOCAP, "skin depth"]
    assert "wrists, paper lifting: skin depth with 3.0 cm" in figure.alt
    assert "would show: 0.4 cm" in figure.caption and figure.table["view"].nunique() == 2
    assert (
        "people: 12" in figure.caption
        and "the paper's best medians" in figure.caption
        and "made up" in figure.caption
    )
