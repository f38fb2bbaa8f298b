"""Causes of spread, on a wall that a robot looks at with errors that are known."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.camera import Camera, project, transform
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.evaluation.space import spread_causes as module
from hicp_lib.evaluation.space.spread_causes import (
    CAUSES,
    DEPTH,
    JOINT_NOISE,
    JOINT_OFFSET,
    PIXEL,
    TOGETHER,
    VIEWPOINT,
    is_simulated,
    spread_causes,
    wrong_poses,
)
from hicp_lib.recordings.recording import EXACT_DEPTH_DIR, JOINTS_FILE, TRUTH_FILE, open_recording
from hicp_lib.recordings.writer import RecordingWriter, write_depth
from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub
from hicp_lib.study.relative import lift_views

CAMERA = Camera(width_px=320, height_px=240, fx_px=300, fy_px=300, cx_px=159.5, cy_px=119.5)
WALL_M = -1.2  # x of the wall, in front of the robot
POINTS_M = {
    "left_wrist": (WALL_M, -0.15, 0.3),
    "right_wrist": (WALL_M, 0.15, 0.4),
    "left_elbow": (WALL_M, 0, 0.2),
}
N = 24
DEPTH_ERROR_M, PIXEL_ERROR_PX = 0.02, 6.0


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Depth is 2 cm too near and too far in turn; poses and truth are exact."""
    folder = tmp_path_factory.mktemp("lab") / "upper"
    rng = np.random.default_rng(0)
    angles_rad = np.deg2rad(rng.uniform(-4, 4, (N, len(HEAD_JOINTS))) + [0, 0, 0, -4, 0, 0])
    T_base_cam = load_icub().T_root_camera(angles_rad)
    writer = RecordingWriter(folder, CAMERA, depth_units_per_m=10_000)
    rows = []
    for frame, pose in enumerate(T_base_cam):
        depth_m = wall_depth(pose)
        error_m = DEPTH_ERROR_M * (1 if frame % 2 else -1)
        writer.add(frame, np.zeros((240, 320, 3), np.uint8), depth_m + error_m, pose)
        write_depth(folder / EXACT_DEPTH_DIR / f"{frame:06d}.png", depth_m, 10_000)
        pixels = project(CAMERA, transform(np.linalg.inv(pose), np.array(list(POINTS_M.values()))))
        rows += [
            (frame, float(frame), name, *at, *pixel, 2)
            for (name, at), pixel in zip(POINTS_M.items(), pixels, strict=True)
        ]
    writer.finish()
    columns = ["frame", "t_s", "keypoint", "x_m", "y_m", "z_m", "u_px", "v_px", "visible"]
    pd.DataFrame(rows, columns=columns).to_parquet(folder / TRUTH_FILE)
    joints = pd.DataFrame(angles_rad, columns=[f"{name}_rad" for name in HEAD_JOINTS])
    joints.assign(frame=range(N), t_s=np.arange(N, dtype=float)).to_parquet(folder / JOINTS_FILE)
    return open_recording(folder)


def wall_depth(T_base_cam: np.ndarray) -> np.ndarray:
    """Depth at every pixel of a wall that fills the image."""
    v, u = np.mgrid[0:240, 0:320]
    rays = np.stack(
        [(u - CAMERA.cx_px) / CAMERA.fx_px, (v - CAMERA.cy_px) / CAMERA.fy_px, np.ones(u.shape)], -1
    )
    return (WALL_M - T_base_cam[0, 3]) / (rays @ T_base_cam[0, :3])


@pytest.fixture(scope="module")
def table(recording):
    rng = np.random.default_rng(1)
    true = module.true_detections(pd.read_parquet(recording.folder / TRUTH_FILE), N)
    found = [
        Detections(
            person.keypoints_px + rng.normal(0, PIXEL_ERROR_PX, (1, 136, 2)), person.scores, np.ones(1)
        )
        for person in true
    ]
    views, found = {"upper": recording}, {("upper", "mediapipe"): found}
    return spread_causes(views, found, lift_views(views, found), method="paper")


def spread_m(table, cause):
    return table[table["cause"] == cause]["spread_m"].mean()


def bias_m(table, cause):
    return table[table["cause"] == cause]["bias_m"].mean()


def test_every_cause_is_judged_on_the_same_images(table):
    assert set(table["cause"]) == set(CAUSES)
    assert set(table["part"]) == {"left wrist", "right wrist", "left elbow"}
    assert table.groupby("part")["n"].nunique().eq(1).all() and (table["n"] >= N - 2).all()
    assert (table["p90_m"] >= table["spread_m"]).all()


def test_a_wall_seen_without_error_stays_in_place(table):
    assert spread_m(table, VIEWPOINT) < 0.003  # the size of a pixel there is 4 mm
    assert bias_m(table, VIEWPOINT) < 0.002


def test_errors_put_in_come_out(table):
    assert spread_m(table, DEPTH) == pytest.approx(DEPTH_ERROR_M, rel=0.15)
    sigma_m = PIXEL_ERROR_PX / CAMERA.fx_px * (-WALL_M)
    assert spread_m(table, PIXEL) == pytest.approx(
        np.sqrt(2 * np.log(2)) * sigma_m, rel=0.25
    )  # Rayleigh's median
    assert spread_m(table, TOGETHER) > max(spread_m(table, DEPTH), spread_m(table, PIXEL))


def test_joint_errors_spread_as_turning_the_camera_does(table, recording):
    rng = np.random.default_rng(5)
    icub, true = load_icub(), np.array(list(POINTS_M.values()))
    angles_rad = pd.read_parquet(recording.folder / JOINTS_FILE)[
        [f"{name}_rad" for name in HEAD_JOINTS]
    ].to_numpy()
    moved = [
        transform(
            icub.T_root_camera(q + rng.normal(0, np.deg2rad(0.5), 6)) @ np.linalg.inv(icub.T_root_camera(q)),
            true,
        )
        for q in np.tile(angles_rad, (10, 1))
    ]
    expected = np.median(np.linalg.norm(moved - np.median(moved, axis=0), axis=-1))
    assert spread_m(table, JOINT_NOISE) == pytest.approx(expected, rel=0.15)
    assert spread_m(table, JOINT_OFFSET) < spread_m(table, JOINT_NOISE) / 3
    # An error that is the same everywhere moves everything alike: a bias, not a spread.
    assert bias_m(table, JOINT_OFFSET) > 3 * bias_m(table, JOINT_NOISE)


def test_joints_without_error_give_the_recorded_poses(recording):
    for poses in wrong_poses(recording, joint_error_rad=0.0, n_draws=2).values():
        assert poses.shape == (2, N, 4, 4)
        np.testing.assert_allclose(poses, np.stack([recording.T_base_cam] * 2), atol=1e-6)


def test_joints_of_another_robot_are_refused(recording, tmp_path):
    joints = pd.read_parquet(recording.folder / JOINTS_FILE)
    folder = tmp_path / "other"
    folder.mkdir()
    for path in recording.folder.iterdir():
        (folder / path.name).symlink_to(path)
    (folder / JOINTS_FILE).unlink()
    joints.assign(neck_pitch_rad=joints["neck_pitch_rad"] + 0.3).to_parquet(folder / JOINTS_FILE)
    with pytest.raises(InputError, match=r"joints\.parquet: the joints do not give the camera poses"):
        wrong_poses(open_recording(folder))


def test_real_recordings_have_no_causes(recording, tmp_path):
    writer = RecordingWriter(tmp_path / "real", CAMERA)
    writer.add(0.0, np.zeros((240, 320, 3), np.uint8), np.ones((240, 320)), np.eye(4))
    writer.finish()
    real = open_recording(tmp_path / "real")
    assert is_simulated(recording) and not is_simulated(real)
    assert spread_causes({"own": real}, {("own", "mediapipe"): [Detections.none()]}, pd.DataFrame()).empty


def test_spread_is_the_median_and_the_ninth_decile_of_distances_to_the_median():
    """Two draws, the second spread twice as far; what does not count lies anywhere."""
    along_m = np.array([-0.04, -0.01, 0.0, 0.02, 0.1, 7.0])
    positions_m = np.zeros((2, 6, 1, 3))
    positions_m[:, :, 0, 0] = along_m, 2 * along_m
    counts = np.arange(6)[:, None] < 5
    true_m = np.full((6, 1, 3), (0.0, 0.3, 0.0))
    spread_m, p90_m, bias_m = module._spread(positions_m, true_m, counts)
    assert spread_m == pytest.approx((0.02 + 0.04) / 2)
    assert p90_m == pytest.approx((0.076 + 0.152) / 2)  # six tenths of the way from 4 to 10 cm
    assert bias_m == pytest.approx(0.3)


def test_joints_are_half_a_degree_off_in_twenty_draws(recording):
    by_default, said = wrong_poses(recording), wrong_poses(recording, np.deg2rad(0.5), 20, 0)
    for cause in (JOINT_OFFSET, JOINT_NOISE):
        np.testing.assert_array_equal(by_default[cause], said[cause])
    of_frames = by_default[JOINT_OFFSET][:, :2] @ np.linalg.inv(recording.T_base_cam[:2])
    assert np.ptp(of_frames, axis=0).max() > 0.01  # one error for all frames of a draw, another per draw


@pytest.mark.parametrize(("off_m", "is_same"), [(0.9e-3, True), (1.1e-3, False)])
def test_poses_agree_to_a_millimetre(recording, off_m, is_same):
    icub, angles_rad = load_icub(), np.zeros((2, 6))
    T_base_cam = icub.T_root_camera(angles_rad, "tilted")
    T_base_cam[1, 2, 3] += off_m
    other = replace(recording, T_base_cam=T_base_cam)
    if is_same:
        assert module._mount(icub, angles_rad, other) == "tilted"
    else:
        with pytest.raises(InputError, match="do not give the camera poses"):
            module._mount(icub, angles_rad, other)
