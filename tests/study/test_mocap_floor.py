"""The perfect detector finds the body where it is."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.camera import Camera
from hicp_lib.core.keypoints import BODY, INDEX
from hicp_lib.recordings.recording import TRUTH_FILE, Recording, open_recording
from hicp_lib.study.mocap import perfect_detections
from hicp_lib.study.plots.palette import PERFECT
from tests.recordings.writing import RecordingWriter

CAMERA = Camera(160, 120, 300.0, 300.0, 79.5, 59.5)


@pytest.fixture
def recording(tmp_path) -> Recording:
    """Two frames of a wall at 2 m."""
    depth_m = np.full((120, 160), 2.0)
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
