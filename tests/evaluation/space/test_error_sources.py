"""What is off: intrinsics, joints and mount by amounts that are known, motion capture that is shifted."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.evaluation.space import error_sources as s
from hicp_lib.evaluation.space.mocap_error import JOINTS
from hicp_lib.recordings.recording import JOINTS_FILE, open_recording, read_joints
from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub
from tests.evaluation.space.wall import CAMERA, NOTHING, N, wall_recording

MANY = 400


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return wall_recording(tmp_path_factory.mktemp("lab") / "upper")


def many(draw):
    return [draw(np.random.default_rng(k)) for k in range(MANY)]


def test_nothing_off_leaves_the_recorded_camera(recording):
    rng = np.random.default_rng(0)
    assert s.wrong_intrinsics(CAMERA, NOTHING, rng) == CAMERA
    poses = s.wrong_poses(recording, NOTHING, rng)
    assert set(poses) == {(False, False), (False, True), (True, False), (True, True)}
    for T_base_cam in poses.values():
        np.testing.assert_allclose(T_base_cam, recording.T_base_cam, atol=1e-6)


def test_intrinsics_are_off_by_as_much_as_is_said():
    amounts = replace(NOTHING, focal_share=0.01, centre_px=3.0)
    wrong = many(lambda rng: s.wrong_intrinsics(CAMERA, amounts, rng))
    factors = np.array([(one.fx_px / CAMERA.fx_px, one.fy_px / CAMERA.fy_px) for one in wrong])
    np.testing.assert_allclose(factors[:, 0], factors[:, 1])
    assert factors[:, 0].std() == pytest.approx(0.01, rel=0.1)
    assert np.std([one.cx_px for one in wrong]) == pytest.approx(3, rel=0.1)
    assert np.std([one.cy_px - one.cx_px for one in wrong]) == pytest.approx(3 * np.sqrt(2), rel=0.1)


def test_joints_are_off_by_one_error_for_all_frames(recording):
    angles_rad = read_joints(recording)[[f"{name}_rad" for name in HEAD_JOINTS]].to_numpy()
    amounts, rng = replace(NOTHING, joint_offset_rad=0.01), np.random.default_rng(3)
    off_rad = np.random.default_rng(3).normal(0, 0.01, len(HEAD_JOINTS))
    poses = s.wrong_poses(recording, amounts, rng)
    np.testing.assert_allclose(poses[True, False], load_icub().T_root_camera(angles_rad + off_rad))
    np.testing.assert_allclose(poses[True, True], poses[True, False])
    np.testing.assert_array_equal(poses[False, False], recording.T_base_cam)


def test_the_mount_moves_and_turns_the_camera_in_its_own_frame(recording):
    amounts = replace(NOTHING, mount_rad=0.02, mount_m=0.005)
    poses = many(lambda rng: s.wrong_poses(recording, amounts, rng)[False, True])
    moved = np.linalg.inv(recording.T_base_cam) @ poses
    np.testing.assert_allclose(moved, np.repeat(moved[:, :1], N, axis=1), atol=1e-9)
    assert moved[:, 0, :3, 3].std(axis=0) == pytest.approx(3 * [0.005], rel=0.12)
    angle_rad = np.arccos((np.trace(moved[:, 0, :3, :3], axis1=1, axis2=2) - 1) / 2)
    assert np.sqrt((angle_rad**2).mean()) == pytest.approx(np.sqrt(3) * 0.02, rel=0.1)


def test_joints_that_do_not_give_the_poses_are_refused(recording, tmp_path):
    joints = pd.read_parquet(recording.folder / JOINTS_FILE)
    for name, table, message in (
        (
            "other",
            joints.assign(neck_pitch_rad=joints["neck_pitch_rad"] + 0.3),
            "do not give the camera poses",
        ),
        ("bare", joints.drop(columns="neck_yaw_rad"), "do not give the camera poses"),
    ):
        folder = tmp_path / name
        folder.mkdir()
        for path in recording.folder.iterdir():
            (folder / path.name).symlink_to(path)
        (folder / JOINTS_FILE).unlink()
        table.to_parquet(folder / JOINTS_FILE)
        with pytest.raises(InputError, match=rf"joints\.parquet: .*{message}"):
            s.wrong_poses(open_recording(folder), NOTHING, np.random.default_rng(0))


@pytest.mark.parametrize(("off_m", "is_same"), [(0.9e-3, True), (1.1e-3, False)])
def test_poses_agree_to_a_millimetre(recording, off_m, is_same):
    T_base_cam = recording.T_base_cam.copy()
    T_base_cam[1, 2, 3] += off_m
    assert s._is_same(T_base_cam, recording.T_base_cam) == is_same
    assert not s._is_same(T_base_cam[1:], recording.T_base_cam)


def test_motion_capture_is_shifted_by_markers_registration_and_clock(recording, monkeypatch):
    T_base_mocap, off = np.eye(4), np.eye(4)
    T_base_mocap[:3, 3], off[:3, 3] = (1, 2, 3), (0, 0.02, 0)
    monkeypatch.setattr(
        s.rec, "read_simulation", lambda _: {"T_base_mocap": T_base_mocap.tolist(), "mocap_offset_s": 7.0}
    )
    monkeypatch.setattr(s, "read_mocap", lambda path: None)
    asked = {}

    def marker_means(mocap, stamps_s, T):
        asked.update(stamps_s=stamps_s, T=T)
        rows = [(frame, name, 0.5, 0.0, 0.03) for frame in range(N) for name in JOINTS]
        return pd.DataFrame(rows, columns=["frame", "keypoint", "x_m", "y_m", "z_m"])

    monkeypatch.setattr(s, "marker_means", marker_means)
    true_m = np.zeros((N, len(JOINTS) + 1, 3))
    true_m[..., 0] = 0.5 + 0.2 * recording.times_s[:, None]  # 0.2 m/s
    amounts = replace(NOTHING, clock_s=0.1)
    shifts_m = s.reference_shifts(recording, true_m, off @ T_base_mocap, amounts, np.random.default_rng(0))
    late_s = np.random.default_rng(0).normal(0, 0.1)
    np.testing.assert_allclose(
        shifts_m[s.CLOCK], np.broadcast_to((0.2 * late_s, 0, 0), true_m.shape), atol=1e-9
    )
    np.testing.assert_allclose(
        shifts_m[s.REGISTRATION], np.broadcast_to((0, 0.02, 0), true_m.shape), atol=1e-9
    )
    np.testing.assert_allclose(shifts_m[s.MARKERS][:, -1], 0)
    np.testing.assert_allclose(shifts_m[s.MARKERS][0, 0], (0, 0, 0.03), atol=1e-9)
    np.testing.assert_allclose(asked["stamps_s"], recording.times_s - 7)
    np.testing.assert_allclose(asked["T"], T_base_mocap)
    jitter_s = s.reference_shifts(
        recording, true_m, T_base_mocap, replace(NOTHING, jitter_s=0.1), np.random.default_rng(0)
    )
    assert np.ptp(jitter_s[s.CLOCK][:, 0, 0]) > 0.02  # anew in every frame
