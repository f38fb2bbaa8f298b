"""Figures of the relative 3D test, on tables made up: what they draw, carry and say."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import INDEX
from hicp_lib.study.plots import relative3d, within_distance
from hicp_lib.study.plots.palette import DETECTOR_STYLES
from hicp_lib.study.plots.relative3d import BODY_LIMBS, HAND_LIMBS, limb_lines

VIEWS, DETECTORS = ("upper", "lower"), ("mediapipe", "openpose-mobilenet")
PARTS = ("left wrist", "right wrist", "left hand", "right hand")
SKELETON = {
    "left_shoulder": (-0.7, -0.2, 0.4),
    "left_elbow": (-0.7, -0.25, 0.15),
    "left_wrist": (-0.5, -0.2, 0.1),
}


@pytest.fixture
def shares() -> pd.DataFrame:
    rows = [
        (view, detector, method, part, "median", threshold, 4 * threshold, 3 * threshold, 5 * threshold, 0.9)
        for view in VIEWS
        for detector in DETECTORS
        for method in ("robust", "paper")
        for part in PARTS
        for threshold in (0.025, 0.05, 0.1)
    ]
    columns = [
        "view",
        "detector",
        "method",
        "part",
        "reference",
        "threshold_m",
        "value",
        "low",
        "high",
        "found",
    ]
    return pd.DataFrame(rows, columns=columns)


def test_curves_rise_with_the_distance_one_per_detector_and_method(shares):
    figure = within_distance.within_curves(shares, (0.025, 0.05, 0.1), "made up")
    axis = figure.figure.axes[0]
    assert len([line for line in axis.get_lines() if len(line.get_xdata())]) == len(DETECTORS) * 2
    assert axis.get_lines()[0].get_xdata().tolist() == pytest.approx([2.5, 5, 10])
    assert axis.get_lines()[0].get_ydata().tolist() == pytest.approx([0.1, 0.2, 0.4])
    assert {line.get_marker() for line in axis.get_lines()[:4]} == {DETECTOR_STYLES[d][1] for d in DETECTORS}
    assert "mediapipe, upper, robust lifting 20%" in figure.alt and "made up" in figure.caption
    assert "median position" in figure.caption


def test_dots_lie_at_the_shares_precision_beside_accuracy(shares):
    both = pd.concat([shares, shares.assign(reference="truth", value=shares["value"] / 2)])
    figure = within_distance.within_dots(both, "robust", "made up")
    panels = figure.figure.axes
    assert [axis.get_title("left") for axis in panels] == [
        "upper · precision", "upper · accuracy", "lower · precision", "lower · accuracy",
    ]  # fmt: skip
    assert panels[2].get_xlabel() == "within 5 cm of its median position"
    precision, accuracy = ([bars.lines[0] for bars in axis.containers] for axis in panels[:2])
    assert [line.get_xdata().tolist() for line in precision] == [[0.2] * len(PARTS)] * len(DETECTORS)
    assert [line.get_xdata().tolist() for line in accuracy] == [[0.1] * len(PARTS)] * len(DETECTORS)
    assert [line.get_marker() for line in precision] == [DETECTOR_STYLES[name][1] for name in DETECTORS]
    assert [label.get_text() for label in panels[0].get_yticklabels()] == list(PARTS)
    assert "mediapipe, upper, of the truth 10%" in figure.alt and "made up" in figure.caption
    assert figure.table["value"].tolist() == both["value"].tolist()


def test_skeletons_are_drawn_per_view_and_direction_with_the_truth_dashed():
    keypoints = pd.DataFrame(
        [(name, *at) for name, at in SKELETON.items()], columns=["keypoint", "x_m", "y_m", "z_m"]
    )
    medians = pd.concat(
        [
            keypoints.assign(view=view, detector=detector, method="robust", n=9)
            for view in VIEWS
            for detector in DETECTORS
        ]
    )
    beside = keypoints.assign(x_m=keypoints["x_m"] + 0.03)
    figure = relative3d.median_skeletons(medians, dict.fromkeys(VIEWS, beside), "made up")
    assert "Median distance from the truth: mediapipe 3.0 cm and" in figure.caption
    assert len(figure.figure.axes) == 6
    front = figure.figure.axes[0]
    drawn = [line for line in front.get_lines() if len(line.get_xydata())]
    assert {line.get_linestyle() for line in drawn} == {"-", "--"}
    ends = {tuple(np.round(end, 3)) for line in drawn for end in line.get_xydata() if np.isfinite(end).all()}
    assert ends == {(y, z) for _, y, z in SKELETON.values()}
    assert "mediapipe 3 (upper)" in figure.alt and "true skeleton" in figure.caption
    assert "true" not in relative3d.median_skeletons(medians, None, "made up").caption


def test_spread_and_bias_are_in_centimetres_and_rare_parts_left_out():
    rows = [("upper", "mediapipe", "robust", part, n, 0.01, 0.009, 0.011, 0.03, 0.02, 0.04, 0.03, 0.02, 0.04)
            for part, n in (("left wrist", 50), ("right wrist", 2))]  # fmt: skip
    names = [f"{name}{end}" for name in ("spread_m", "bias_m", "error_m") for end in ("", "_low", "_high")]
    figure = relative3d.spread_against_bias(
        pd.DataFrame(rows, columns=["view", "detector", "method", "part", "n_images", *names]),
        "robust",
        "made up",
    )
    (marker,) = [bars.lines[0] for axis in figure.figure.axes for bars in axis.containers]
    assert marker.get_xydata().ravel().tolist() == pytest.approx([1, 3])
    assert marker.get_color() == DETECTOR_STYLES["mediapipe"][0]
    assert marker.get_marker() == DETECTOR_STYLES["mediapipe"][1]
    assert "1 of 1 marks have more bias" in figure.alt and "lie 1 of 1 marks" in figure.caption
    assert "Median bias: mediapipe 3.0 cm." in figure.caption


def test_camera_views_have_a_row_per_frame_and_view_and_a_column_per_detector(monkeypatch):
    monkeypatch.setattr(
        relative3d, "read_rgb", lambda recording, frame: np.full((30, 40, 3), frame, np.uint8)
    )
    pixels, scores = np.full((1, 136, 2), np.nan), np.zeros((1, 136))
    pixels[0, INDEX["left_wrist"]], scores[0, INDEX["left_wrist"]] = (20, 10), 0.9
    found, nobody = Detections(pixels, scores, np.ones(1)), Detections.none()
    people = {("upper", "mediapipe"): [found] * 3, ("lower", "mediapipe"): [nobody, nobody, found]}
    people |= {(view, "posenet"): [nobody] * 3 for view in ("upper", "lower")}
    recordings = {"upper": None, "lower": None}
    figure = relative3d.camera_views(recordings, people, [0, 2], 0.1, "made up")
    images = [axis.images[0].get_array() for axis in figure.figure.axes]
    assert [int(image[0, 0, 0]) for image in images] == [0, 0, 0, 0, 2, 2, 2, 2]
    drawn = [bool((image != image[0, 0]).any()) for image in images]
    assert drawn == [True, False, False, False, True, False, True, False]
    assert "mediapipe 3 of 4 and posenet 0 of 4" in figure.caption and "made up" in figure.caption
    markers = pd.DataFrame({"frame": [2, 2, 0], "u_px": [20.0, np.nan, 20.0], "v_px": [15.0, np.nan, 900.0]})
    figure = relative3d.camera_views(recordings, people, [0, 2], 0.1, "made up", markers)
    first, *_, last = (axis.images[0].get_array() for axis in figure.figure.axes[1::2])
    assert (first == 0).all() and last[15, 27].min() > 200 and (last[15, 20] == 2).all()


def test_limbs_are_lines_between_known_ends():
    rows = [
        ("left_shoulder", 0, 1),
        ("left_elbow", 2, 3),
        ("left_wrist", np.nan, 5),
        ("nose", 7, 8),
        ("left_elbow", 9, 9),
    ]
    table = pd.DataFrame(rows, columns=["keypoint", "x", "y"])
    np.testing.assert_array_equal(limb_lines(table, ["x", "y"]), [[0, 1], [2, 3], [np.nan, np.nan]])
    assert limb_lines(table, ["x", "y"], HAND_LIMBS).shape == (0, 2)
    assert limb_lines(table, ["y"], BODY_LIMBS)[:2].tolist() == [[1], [3]]
