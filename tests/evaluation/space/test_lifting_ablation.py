"""The ablation's table from recordings whose errors are known."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.camera import Camera, deproject
from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import INDEX, NAMES
from hicp_lib.evaluation.space.lifting_ablation import (
    GROUPS,
    N_STEPS,
    lifting_errors,
    sigma_coverage,
    summary,
)
from hicp_lib.lifting.body_measures import load_measures
from hicp_lib.lifting.table import lift_found
from hicp_lib.recordings.recording import open_recording
from tests.recordings.writing import RecordingWriter

CAMERA = Camera(64, 48, 60.0, 60.0, 32.0, 24.0)
POSES = np.tile(np.eye(4), (3, 1, 1))
WRIST, THUMB = INDEX["left_wrist"], INDEX["left_thumb_2"]


@pytest.fixture
def points(tmp_path, detections):
    writer = RecordingWriter(tmp_path / "rec", CAMERA, 1000)
    for k in range(3):
        writer.add(float(k), np.zeros((48, 64, 3), np.uint8), np.full((48, 64), 2.0, np.float32), np.eye(4))
    writer.finish()
    return lift_found(open_recording(tmp_path / "rec"), {"mediapipe": detections}, N_STEPS)


@pytest.fixture
def detections():
    """A wrist and a thumb before a wall at 2 m in three images, the last with a low score."""
    found = []
    for score in (0.9, 0.8, 0.1):
        points, scores = np.full((1, 136, 2), np.nan), np.zeros((1, 136))
        points[0, [WRIST, THUMB]], scores[0, [WRIST, THUMB]] = (32.0, 24.0), score
        found.append(Detections(points, scores, np.ones(1)))
    return found


@pytest.fixture
def truth():
    """Both as far behind the wall as they lie below the skin."""
    below_m = load_measures().below_skin_m
    z = np.tile([2 + below_m[WRIST], 2 + below_m[THUMB]], 3)
    x, y, z = deproject(CAMERA, np.full((6, 2), (32.0, 24.0)), z).T
    names = [NAMES[WRIST], NAMES[THUMB]] * 3
    return pd.DataFrame({"frame": np.repeat(range(3), 2), "keypoint": names, "x_m": x, "y_m": y, "z_m": z})


def test_errors_are_the_depth_below_the_skin_for_the_paper_and_none_beyond(points, truth):
    table = summary(lifting_errors(points, truth, POSES)).set_index(["group", "method"])
    assert set(table.index) == {(group, method) for group in ("wrists", "fingers") for method in N_STEPS}
    assert (table[["n_detected", "n_lifted", "n_compared"]] == 2).all(axis=None)
    below_m = load_measures().below_skin_m
    assert table.loc[("wrists", "paper"), "median_m"] == pytest.approx(below_m[WRIST], abs=1e-6)
    assert table.loc[("wrists", "+ below the surface"), "p95_m"] == pytest.approx(0, abs=1e-6)
    assert table.loc[("wrists", "+ below the surface"), "p95_change"] == pytest.approx(-1, abs=1e-3)
    assert table.loc[("fingers", "paper"), "p95_change"] == 0


def test_the_score_decides_what_counts(points, truth):
    assert len(lifting_errors(points, truth, POSES, min_score=0.05)) == 6
    assert len(lifting_errors(points, truth, POSES, min_score=0.85)) == 2


def test_only_what_both_lift_is_compared():
    errors = pd.DataFrame({"frame": range(4), "keypoint": "left_elbow", "group": "elbows"})
    for method in N_STEPS:
        errors[method] = [1.0, 1.0, np.nan, 1.0]
    errors["robust"] = [0.5, np.nan, 9.0, 0.5]
    row = summary(errors).set_index("method").loc["robust"]
    assert (row["n_detected"], row["n_lifted"], row["n_compared"]) == (4, 3, 2)
    assert row["median_m"] == 0.5 and row["p95_change"] == -0.5


def test_coverage_is_of_depth_along_the_cameras_axis_and_by_reason(points, truth):
    errors = lifting_errors(points, truth, POSES)
    assert errors["off_m"].max() < 0.2 and set(errors["reason"]) == {
        "lifted",
        "guessed",
    }  # the thumb is hidden
    errors["reason"] = "lifted"
    truth["x_m"] += 1.0
    turned = POSES[:, [2, 1, 0, 3]]  # the camera's axis is the base's x axis
    across, along = (lifting_errors(points, truth, T) for T in (POSES, turned))
    np.testing.assert_allclose(across["off_m"], errors["off_m"])
    np.testing.assert_allclose(along["off_m"], 1.0)
    some = pd.concat([errors.assign(off_m=k * 0.01, sigma_m=0.011) for k in range(4)])
    some = pd.concat([some, errors.assign(off_m=0.5, sigma_m=0.3, reason="guessed")])
    table = sigma_coverage(some).set_index(["group", "reason"])
    assert table.loc[("wrists", "lifted"), ["n", "within_1_sigma", "within_2_sigma"]].tolist() == [
        8,
        0.5,
        0.75,
    ]
    assert table.loc[("fingers", "guessed"), ["n", "within_1_sigma", "within_2_sigma"]].tolist() == [2, 0, 1]


def test_fingers_are_all_joints_of_both_hands():
    assert len(GROUPS["fingers"]) == 40 and "left_hand_root" not in GROUPS["fingers"]


def test_a_score_just_at_the_limit_counts_and_another_person_does_not(points, truth):
    assert len(lifting_errors(points, truth, POSES, min_score=0.8)) == 4
    assert len(lifting_errors(points.assign(score=0.3), truth, POSES)) == 6
    assert len(lifting_errors(points.assign(score=np.nextafter(0.3, 0)), truth, POSES)) == 0
    assert len(lifting_errors(points.assign(person=1), truth, POSES)) == 0
