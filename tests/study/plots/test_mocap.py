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


def test_distributions_compare_like_with_like_first(errors):
    perfect = errors.assign(detector=PERFECT, error_m=0.03)[errors["detector"] == DETECTORS[0]]
    both = pd.concat([errors.assign(method="robust"), errors, perfect])
    figure = draw.error_distributions(both, paper_medians(), 0.1, "made up")
    assert len(figure.figure.axes) == len(TABLE_JOINTS)
    axis = figure.figure.axes[0]
    labels = [label.get_text() for label in axis.get_yticklabels()]
    assert labels == [
        *(f"{name}, paper lifting" for name in (*DETECTORS, PERFECT)),
        *(f"{name} (paper)" for name in ("alphapose", "mmpose", "detectron2", "openpose")),
        *(f"{name}, robust lifting" for name in DETECTORS),
    ]
    diamonds = [line for line in axis.lines if line.get_marker() == "D"]
    assert [float(line.get_xdata()[0]) for line in diamonds] == pytest.approx([4.0, 3.5, 16.7, 15.4])
    assert [float(line.get_ydata()[0]) for line in diamonds] == [3, 4, 5, 6]
    assert len(axis.patches) == 5
    (floor,) = [line for line in axis.lines if line.get_linestyle() == ":"]
    assert floor.get_xdata() == pytest.approx([3.0, 3.0])
    assert "true keypoints" in figure.caption
    assert "true keypoints" not in draw.error_distributions(errors, paper_medians(), 0.1, "made up").caption


def test_a_detector_that_found_nothing_has_no_box(errors):
    blind = errors.assign(score=errors["score"] * (errors["detector"] != "mediapipe"))
    figure = draw.error_distributions(blind, paper_medians(), 0.3, "made up")
    assert len(figure.figure.axes[0].patches) == 1 and "mediapipe" not in figure.alt


def test_trajectories_show_gaps_of_the_motion_capture(errors):
    figure = draw.trajectories(errors, TIMES_S, "right_wrist", 0.1, "made up")
    line = figure.figure.axes[0].lines[0]
    assert np.isnan(line.get_ydata()[40:50]).all() and np.isfinite(line.get_ydata()[:40]).all()
    assert line.get_xdata()[0] == 0 and line.get_xdata()[-1] == pytest.approx((N - 1) / 15)
    assert len(figure.figure.axes[2].lines) == 1 + len(DETECTORS)
    assert f"mediapipe in {N - 10} frames" in figure.alt and set(figure.table["detector"]) == set(DETECTORS)


def test_a_joint_motion_capture_never_saw_can_still_be_drawn(errors):
    unseen = errors.assign(**{f"reference_{axis}_m": np.nan for axis in "xyz"}, error_m=np.nan)
    assert draw.trajectories(unseen, TIMES_S, "left_wrist", 0.1, "made up").figure.axes


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
    figure = error_budget(table.assign(n_people=12, view="upper"), medians, "made up")
    wrists, fingers = figure.figure.axes
    drawn = [(line.get_marker(), list(line.get_xdata())) for line in wrists.get_lines()]
    for marker, at_cm in (("o", [5, 4]), ("o", [3]), ("D", [2]), ("|", [2.7])):
        assert (marker, pytest.approx(at_cm)) in drawn
    assert [label.get_text() for label in wrists.get_yticklabels()] == [ALL, AGAINST_MOCAP, "skin depth"]
    assert "wrists, paper lifting: skin depth with 3.0 cm" in figure.alt
    assert "12 people" in figure.caption and "mmpose" in figure.caption and "made up" in figure.caption
