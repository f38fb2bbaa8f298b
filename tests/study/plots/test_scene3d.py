"""The interactive scene: everything where it belongs, and light."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.camera import Camera
from hicp_lib.recordings.recording import open_recording
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.shape import robot_shape
from hicp_lib.study.plots import scene3d
from tests.recordings.writing import RecordingWriter

CAMERA = Camera(width_px=64, height_px=48, fx_px=50, fy_px=50, cx_px=31.5, cy_px=23.5)
T_BASE_CAM = np.array([[0, 0, -1, -0.05], [1, 0, 0, 0], [0, -1, 0, 0.5], [0, 0, 0, 1.0]])
SKELETON = pd.DataFrame(
    [("left_elbow", -0.8, -0.2, 0.3), ("left_wrist", -0.6, -0.1, 0.3), ("nose", -0.9, 0, 0.8)],
    columns=["keypoint", "x_m", "y_m", "z_m"],
)

NOBODY = SKELETON[:0].assign(view="own", detector="mediapipe")


@pytest.fixture
def recording(tmp_path):
    """A wall one metre in front of the camera, with a hole and a far corner."""
    depth_m = np.ones((48, 64))
    depth_m[:10], depth_m[-1, -1] = np.nan, 9
    rgb = np.full((48, 64, 3), (200, 100, 50), np.uint8)
    writer = RecordingWriter(tmp_path / "wall", CAMERA)
    for time_s in (0.0, 1.0):
        writer.add(time_s, rgb, depth_m, T_BASE_CAM)
    writer.finish()
    return open_recording(tmp_path / "wall")


def test_the_cloud_lies_on_the_wall_in_the_base_frame(recording):
    cloud = scene3d.point_cloud(recording, 0, n_points=10_000)
    assert len(cloud.x) == 64 * 38 - 1
    np.testing.assert_allclose(cloud.x, -1.05, atol=1e-6)
    np.testing.assert_allclose([cloud.y.min(), cloud.y.max()], [-31.5 / 50, 31.5 / 50], atol=1e-6)
    assert cloud.z.max() == pytest.approx(0.5 + 13.5 / 50, abs=1e-6)
    red, green, blue = (int(cloud.marker.color[0][k : k + 2], 16) for k in (1, 3, 5))
    assert abs(red - 200) < 4 and abs(green - 100) < 4 and abs(blue - 50) < 4


def test_the_cloud_is_thinned(recording):
    assert 100 < len(scene3d.point_cloud(recording, 0, n_points=300).x) <= 330


def test_the_scene_holds_robot_cameras_skeletons_and_truth(recording):
    medians = SKELETON.assign(view="upper", detector="mediapipe")
    figure = scene3d.scene(
        {"upper": recording}, medians, robot_shape(load_icub(), Posture()), {"upper": SKELETON}
    )
    traces = {trace.name: trace for trace in figure.data}
    assert list(traces) == ["point cloud", "robot", "cameras (upper)", "mediapipe (upper)", "true skeleton"]
    robot = traces["robot"]
    assert len(robot.i) > 5000 and max(robot.k) < len(robot.x) == len(robot.vertexcolor)
    assert min(robot.z) == pytest.approx(-0.6, abs=0.01)
    arm = traces["mediapipe (upper)"]
    np.testing.assert_allclose(
        arm.x[:2], [-0.8, -0.6], atol=1e-6
    )  # the nose has no neighbour to be joined to
    assert len(arm.x) == 3 and np.isnan(arm.x[2])
    cameras = np.stack([traces["cameras (upper)"][axis] for axis in "xyz"], axis=1)
    assert (np.abs(cameras - T_BASE_CAM[:3, 3]) < 1e-6).all(axis=1).sum() == 2 * 2  # apexes of two cameras
    assert len(figure.to_json()) < 500_000


def test_without_joints_and_truth_there_is_no_robot_and_no_true_skeleton(recording):
    figure = scene3d.scene({"own": recording}, NOBODY)
    assert [trace.name for trace in figure.data] == ["point cloud", "cameras (own)"]
