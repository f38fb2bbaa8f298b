"""What a registration adds: displacements that are known."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hicp_lib.core.camera import Camera, project, transform
from hicp_lib.evaluation.space.registration_error import compare_registrations, marker_pixels
from hicp_lib.mocap.registration import Registration
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import Recording

TIMES_S = np.arange(0, 1, 0.01)
EXACT = np.eye(4)
EXACT[:3, 3] = [0.5, -0.2, 1.0]


@pytest.fixture
def mocap() -> MotionCapture:
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (len(TIMES_S), 3, 3)) + [0, 0, 1]
    points[:, 2] = 1000.0
    points[10, 0] = np.nan
    return MotionCapture(TIMES_S, ("wrist_left_1", "wrist_left_2", "camera"), points, 100.0)


def shifted(metres: float) -> np.ndarray:
    T = EXACT.copy()
    T[0, 3] += metres
    return T


def test_a_shift_moves_every_marker_by_it_and_the_cameras_own_marker_does_not_count(mocap):
    fits = [Registration("exact", EXACT), Registration("off", shifted(0.03), 8, 0.01, 0.012)]
    table = compare_registrations(fits, mocap, EXACT).set_index("method")
    assert table.loc["exact", ["added_m", "worst_m", "turned_rad"]].tolist() == [0, 0, 0]
    assert table.loc["off", ["added_m", "worst_m"]].tolist() == pytest.approx([0.03, 0.03])
    assert table.loc["off", ["n_points", "rms_m", "leave_one_out_m"]].tolist() == [8, 0.01, 0.012]


def test_a_turn_is_measured_as_an_angle_and_moves_far_markers_more(mocap):
    T = EXACT.copy()
    T[:3, :3] = Rotation.from_euler("y", 0.02).as_matrix()
    row = compare_registrations([Registration("turned", T)], mocap, EXACT).iloc[0]
    assert row["turned_rad"] == pytest.approx(0.02)
    assert 0.01 < row["added_m"] < row["worst_m"] < 0.04


def test_without_the_truth_nothing_is_said_of_it(mocap):
    row = compare_registrations([Registration("given", EXACT)], mocap, None).iloc[0]
    assert np.isnan(row[["turned_rad", "added_m", "worst_m"]].astype(float)).all()


def test_measured_markers_are_put_where_the_camera_would_see_them(mocap):
    camera = Camera(64, 48, 50.0, 50.0, 31.5, 23.5)
    T_base_cam = np.stack([np.eye(4), shifted(0.1)])
    recording = Recording(Path("."), camera, 1e3, np.array([5.0, 5.5]), [], [], T_base_cam, None)
    pixels = marker_pixels(recording, mocap, [Registration("exact", EXACT)], [0, 1], offset_s=5.0)
    for frame, k in ((0, 0), (1, 50)):
        expected = project(camera, transform(np.linalg.inv(T_base_cam[frame]) @ EXACT, mocap.points_m[k]))
        rows = pixels[pixels["frame"] == frame]
        assert rows["marker"].tolist() == list(mocap.names)
        assert rows[["u_px", "v_px"]].to_numpy() == pytest.approx(expected)
