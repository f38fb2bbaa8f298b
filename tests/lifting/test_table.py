"""The table of a recording's keypoints in space."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.camera import Camera, deproject
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import INDEX
from hicp_lib.lifting.table import lift_found, lift_recording
from hicp_lib.recordings.recording import open_recording
from tests.recordings.writing import RecordingWriter

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)


@pytest.fixture
def recording(tmp_path):
    """Two frames of a wall at 2 m; the camera is moved and turned by the second."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = [[0, 0, -1], [1, 0, 0], [0, -1, 0]], [0.1, 0.2, 0.3]
    writer = RecordingWriter(tmp_path / "rec", CAMERA, 1000)
    for time_s, pose in ((10.0, np.eye(4)), (10.5, T)):
        depth_m = np.full((48, 64), 2.0, np.float32)
        depth_m[:, :10] = np.nan
        writer.add(time_s, np.zeros((48, 64, 3), np.uint8), depth_m, pose)
    writer.finish()
    return open_recording(tmp_path / "rec")


def detections(*people: dict) -> Detections:
    """People as their score and keypoints by name."""
    found = [Detections.none()] + [
        Detections(np.full((1, 136, 2), np.nan), np.zeros((1, 136)), np.array([person.pop("score")]))
        for person in people
    ]
    for one, person in zip(found[1:], people, strict=True):
        for name, place in person.items():
            one.keypoints_px[0, INDEX[name]], one.scores[0, INDEX[name]] = place, 0.7
    parts = ("keypoints_px", "scores", "person_scores")
    return Detections(*(np.concatenate([getattr(one, part) for one in found]) for part in parts))


def test_one_row_per_detected_keypoint_in_both_frames(recording):
    second = detections(
        {"score": 0.2, "nose": (40.0, 20.0)},
        {"score": 0.9, "left_wrist": (31.5, 23.5), "right_wrist": (2.0, 20.0), "nose": (80.0, 20.0)},
    )
    table = lift_recording(recording, [detections(), second], "paper")
    assert table["frame"].eq(1).all() and table["t_s"].eq(10.5).all()
    by_name = table.set_index(["person", "keypoint"])
    assert len(table) == 4 and by_name.loc[(1, "nose"), "u_px"] == 40
    assert by_name["reason"].to_dict() == {
        (0, "nose"): "outside_image", (0, "left_wrist"): "lifted", (0, "right_wrist"): "no_depth",
        (1, "nose"): "lifted",
    }  # fmt: skip
    wrist = by_name.loc[(0, "left_wrist")]
    # Two metres before the camera is two metres along -x of the base, from where the camera is.
    seen = deproject(CAMERA, [32, 24], 2.0)
    np.testing.assert_allclose(wrist[["x_cam_m", "y_cam_m", "z_cam_m"]].astype(float), seen, atol=0.02)
    expected = [0.1 - seen[2], 0.2 + seen[0], 0.3 - seen[1]]
    np.testing.assert_allclose(wrist[["x_m", "y_m", "z_m"]].astype(float), expected, atol=0.02)
    assert table.loc[table["reason"] != "lifted", ["x_m", "x_cam_m"]].isna().all(axis=None)
    assert table["sigma_m"].isna().all()
    sigma_m = lift_recording(recording, [detections(), second]).set_index(["person", "keypoint"])["sigma_m"]
    assert 0.01 <= sigma_m[0, "left_wrist"] < 0.05 and np.isnan(sigma_m[0, "nose"])


def test_several_detectors_and_methods_give_what_each_gives_alone(recording):
    found = {
        "one": [detections({"score": 0.5, "left_wrist": (30.0, 20.0), "nose": (12.3, 7.0)}), detections()],
        "nobody": [detections(), detections()],
        "other": [detections({"score": 0.5, "nose": (33.0, 25.0)})] * 2,
    }
    table = lift_found(recording, found)
    assert list(table.drop_duplicates(["detector", "method"])["detector"]) == ["one"] * 2 + ["other"] * 2
    for (detector, method), rows in table.groupby(["detector", "method"]):
        alone = lift_recording(recording, found[detector], method)
        labels = ["detector", "method"]
        pd.testing.assert_frame_equal(rows.drop(columns=labels).reset_index(drop=True), alone)
    with pytest.raises(InputError, match="2 frames, but detections of 1"):
        lift_found(recording, {"one": found["one"], "few": found["one"][:1]})


@pytest.mark.parametrize("method", ["paper", "robust"])
def test_nobody_is_an_empty_table_with_the_same_columns(recording, method):
    empty = lift_recording(recording, [detections(), detections()], method)
    some = lift_recording(recording, [detections(), detections({"score": 1.0, "nose": (30.0, 20.0)})], method)
    assert len(empty) == 0 and list(empty) == list(some)
    assert isinstance(some, pd.DataFrame) and some["reason"].tolist() == ["lifted"]


def test_what_does_not_fit_is_refused(recording):
    with pytest.raises(InputError, match="2 frames, but detections of 1"):
        lift_recording(recording, [detections()])
    with pytest.raises(InputError, match="expected one of: robust, paper"):
        lift_recording(recording, [detections()] * 2, "best")
