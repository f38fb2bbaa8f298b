"""Lines of sight: a wall, a post before it, and a hole in the depth."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.camera import Camera, transform
from hicp_lib.evaluation.space.occlusion import joint_occlusion
from hicp_lib.recordings.recording import open_recording
from tests.recordings.writing import RecordingWriter

T_BASE_CAM = np.array([[0.0, 0, -1, 0.1], [1, 0, 0, 0.2], [0, -1, 0, 0.3], [0, 0, 0, 1]])
SIGHT_OF = {
    "in front of the wall": ((0.3, 0.0, 1.95), "clear"),
    "just inside the post": ((0.0, 0.0, 1.05), "clear"),
    "behind the post": ((0.0, 0.1, 1.5), "hidden"),
    "in the hole": ((-0.7, 0.0, 1.5), "no depth"),
    "beside the image": ((3.0, 0.0, 1.5), "outside"),
    "behind the camera": ((0.0, 0.0, -1.0), "outside"),
    "not known": ((np.nan, np.nan, np.nan), "unknown"),
}


@pytest.fixture
def recording(tmp_path):
    depth = np.full((48, 64), 2.0)
    depth[:, 28:37] = 1.0
    depth[:, :20] = 0
    writer = RecordingWriter(tmp_path / "post", Camera(64, 48, 50.0, 50.0, 31.5, 23.5))
    for k in range(2):
        writer.add(float(k), np.zeros((48, 64, 3), np.uint8), depth, T_BASE_CAM)
    writer.finish()
    return open_recording(writer.folder)


def test_positions_are_clear_hidden_outside_or_without_depth(recording):
    points = np.array([point for point, _ in SIGHT_OF.values()])
    table = pd.DataFrame(transform(T_BASE_CAM, points), columns=["x_m", "y_m", "z_m"])
    both = pd.concat(
        [table.assign(frame=k, keypoint=[f"left_elbow_{name}" for name in SIGHT_OF]) for k in (0, 1)],
        ignore_index=True,
    )
    both = both.sample(frac=1, random_state=0)
    result = joint_occlusion(recording, both)
    assert result.index.equals(both.index) and result["frame"].equals(both["frame"])
    assert set(result["sight"]) == {"clear", "hidden", "outside", "no depth", "unknown"}
    for row in result.itertuples():
        point, sight = SIGHT_OF[row.keypoint.removeprefix("left_elbow_")]
        assert row.sight == sight
        assert row.distance_m == pytest.approx(np.linalg.norm(point), nan_ok=True)


def test_how_much_may_be_in_front_depends_on_the_joint(recording):
    point = transform(T_BASE_CAM, np.array([[0.0, 0.0, 1.08]]))
    joints = pd.DataFrame(np.repeat(point, 3, axis=0), columns=["x_m", "y_m", "z_m"])
    joints = joints.assign(frame=0, keypoint=["left_wrist", "left_elbow", "left_shoulder"])
    assert joint_occlusion(recording, joints)["sight"].tolist() == ["hidden", "clear", "clear"]


@pytest.mark.parametrize(("joint", "margin_m"), [("wrist", 0.06), ("elbow", 0.09), ("shoulder", 0.13)])
def test_a_joint_is_hidden_by_what_is_nearer_than_its_margin(recording, joint, margin_m):
    """The post is 1 m away; depth is kept in millimetres."""
    points = transform(T_BASE_CAM, np.array([[0.0, 0.0, 1.0 + margin_m + off] for off in (-0.002, 0.002)]))
    joints = pd.DataFrame(points, columns=["x_m", "y_m", "z_m"]).assign(frame=0, keypoint=f"left_{joint}")
    assert joint_occlusion(recording, joints)["sight"].tolist() == ["clear", "hidden"]


def test_the_depth_is_the_median_of_five_by_five_pixels(recording):
    """Columns 28 to 36 are the post: at column 27 two of five show it, at 28 three."""
    points = np.array([[(u - 31.5) / 50 * 1.5, 0.0, 1.5] for u in (26.0, 27.0)])
    joints = pd.DataFrame(transform(T_BASE_CAM, points), columns=["x_m", "y_m", "z_m"])
    found = joint_occlusion(recording, joints.assign(frame=0, keypoint="left_wrist"))
    assert found["sight"].tolist() == ["clear", "clear"]
    points = np.array([[(28.0 - 31.5) / 50 * 1.5, 0.0, 1.5]])
    joints = pd.DataFrame(transform(T_BASE_CAM, points), columns=["x_m", "y_m", "z_m"])
    assert joint_occlusion(recording, joints.assign(frame=0, keypoint="left_wrist"))["sight"].tolist() == [
        "hidden"
    ]
