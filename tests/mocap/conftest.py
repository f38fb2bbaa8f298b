"""A laboratory's recording and the clicks in it, for the tests of registrations."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.camera import project, transform
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import open_recording
from tests.mocap.discs import (
    CAMERA_MARKER_CAM,
    INTRINSICS,
    MARKERS_CAM,
    NAMES,
    T_BASE_MOCAP,
    camera_pose,
    depth_of,
)
from tests.recordings.writing import RecordingWriter


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    """A recording of four frames with its motion capture."""
    writer = RecordingWriter(tmp_path_factory.mktemp("rooms") / "room", INTRINSICS, 10_000.0)
    markers = transform(camera_pose(0), MARKERS_CAM)
    times_s = np.arange(0, 1, 0.01)
    T_mocap_base = np.linalg.inv(T_BASE_MOCAP)
    in_mocap = np.full((len(times_s), 10, 3), np.nan)
    in_mocap[:, :9] = transform(T_mocap_base, markers)
    for k in range(4):
        depth = depth_of(transform(np.linalg.inv(camera_pose(k)), markers))
        writer.add(0.2 * k, np.zeros((240, 320, 3), np.uint8), depth, camera_pose(k))
        in_mocap[20 * k : 20 * k + 20, 9] = transform(T_mocap_base @ camera_pose(k), CAMERA_MARKER_CAM)
    writer.finish()
    recording = open_recording(writer.folder)
    return recording, MotionCapture(times_s, NAMES, in_mocap, 100.0)


@pytest.fixture
def clicks(laboratory) -> pd.DataFrame:
    recording, mocap = laboratory
    rows = []
    for k in range(4):
        points = transform(np.linalg.inv(recording.T_base_cam[k]) @ T_BASE_MOCAP, mocap.points_m[0, :9])
        pixels = project(INTRINSICS, points)
        rows += [(k, name, *pixel) for name, pixel in zip(NAMES, pixels.tolist(), strict=False)]
    return pd.DataFrame(rows, columns=["frame", "marker", "u_px", "v_px"])
