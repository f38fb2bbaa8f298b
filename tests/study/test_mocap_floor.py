"""The perfect detector, and the neighbourhood's size, on a wall with a limb before it."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.camera import Camera
from hicp_lib.core.keypoints import BODY, INDEX
from hicp_lib.evaluation.space.mocap_error import MARKERS, TABLE_JOINTS
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.mocap.registration import Registration
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import TRUTH_FILE, Recording, open_recording
from hicp_lib.recordings.writer import RecordingWriter
from hicp_lib.study.mocap_floor import medians_by_radius, perfect_detections
from hicp_lib.study.plots.palette import PERFECT
from hicp_lib.study.registration import Registered

CAMERA = Camera(160, 120, 300.0, 300.0, 79.5, 59.5)


@pytest.fixture
def recording(tmp_path) -> Recording:
    """Two frames: a wall at 2 m, and a limb 15 mm to each side before it at 1 m."""
    depth_m = np.full((120, 160), 2.0)
    depth_m[:, 75:84] = 1.0
    writer = RecordingWriter(tmp_path / "room", CAMERA, 1000.0)
    for k in range(2):
        writer.add(k / 10, np.zeros((120, 160, 3), np.uint8), depth_m, np.eye(4))
    writer.finish()
    return open_recording(writer.folder)


def test_a_perfect_detector_finds_the_body_where_it_is(recording):
    assert perfect_detections(recording) == {}
    rows = [
        {"frame": frame, "keypoint": name, "u_px": 80.0 + frame, "v_px": 60.0}
        for frame in (0, 1)
        for name in ("left_wrist", "left_index_4")
    ]
    truth = pd.DataFrame(rows).assign(t_s=0.0, x_m=0.0, y_m=0.0, z_m=1.0, visible=2)
    truth.to_parquet(recording.folder / TRUTH_FILE)
    first, second = perfect_detections(recording)[PERFECT]
    wrist = INDEX["left_wrist"]
    assert first.keypoints_px[0, wrist].tolist() == [80, 60] and first.scores[0, wrist] == 1
    assert second.keypoints_px[0, wrist].tolist() == [81, 60] and len(second) == 1
    assert np.flatnonzero(np.isfinite(first.keypoints_px[0, :, 0])).tolist() == [wrist] and wrist in BODY


def test_a_neighbourhood_wider_than_the_limb_takes_the_wall(recording):
    rows = pd.DataFrame({"frame": [0, 1], "keypoint": "left_wrist", "u_px": 79.0, "v_px": 60.0})
    points = rows.assign(detector="a", person=0, score=0.9, x_m=0.0, y_m=0.0, z_m=0.0)
    points = pd.concat([points.assign(method=name) for name in ("paper", "robust")])
    names = tuple(name for joint in TABLE_JOINTS for name in MARKERS[joint])
    times_s, markers_m = np.arange(-0.1, 0.3, 0.01), np.array([0.0, 0.0, 1.0])
    mocap = MotionCapture(times_s, names, np.broadcast_to(markers_m, (len(times_s), 8, 3)), 100.0)
    registered = Registered(recording, mocap, 0.0, [Registration("given", np.eye(4))], None, pd.DataFrame())
    people = [registered, registered], [points, points[points["frame"] == 0]]
    table = medians_by_radius(*people, (0.010, 0.040), draws=Draws(10, 0))
    table = table[table["keypoint"] == "left_wrist"]
    assert table["radius_m"].tolist() == [0.010, 0.040] and set(table["method"]) == {"paper"}
    assert table["median_m"].tolist() == pytest.approx([0.0, 1.0], abs=0.01)
    assert (table["count"] == 3).all() and (table["n_frames"] == 3).all() and (table["n_people"] == 2).all()
