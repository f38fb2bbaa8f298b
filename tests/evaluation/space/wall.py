"""A wall that a robot looks at with errors that are known, and keypoints on it."""

from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.camera import Camera, project, transform
from hicp_lib.evaluation.space.error_sources import Amounts
from hicp_lib.recordings.recording import EXACT_DEPTH_DIR, JOINTS_FILE, TRUTH_FILE, Recording, open_recording
from hicp_lib.recordings.writer import write_depth
from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub
from tests.recordings.writing import RecordingWriter

CAMERA = Camera(width_px=320, height_px=240, fx_px=300, fy_px=300, cx_px=159.5, cy_px=119.5)
WALL_M = -1.2  # x of the wall, in front of the robot
BEHIND_M = 0.03  # the keypoints, like joints behind the skin
POINTS_M = {
    f"{side}_{joint}": (WALL_M - BEHIND_M, y * sign, z)
    for side, sign in (("left", -1), ("right", 1))
    for joint, y, z in (("wrist", 0.15, 0.3), ("elbow", 0.12, 0.4), ("shoulder", 0.1, 0.5))
}
N = 24
DEPTH_ERROR_M = 0.02
NOTHING = Amounts(*[0.0] * 7)


def wall_recording(folder: Path) -> Recording:
    """Depth is 2 cm too near and too far in turn; poses and truth are exact."""
    rng = np.random.default_rng(0)
    angles_rad = np.deg2rad(rng.uniform(-4, 4, (N, len(HEAD_JOINTS))) + [0, 0, 0, -4, 0, 0])
    T_base_cam = load_icub().T_root_camera(angles_rad)
    writer, rows = RecordingWriter(folder, CAMERA, depth_units_per_m=10_000), []
    for frame, pose in enumerate(T_base_cam):
        depth_m = _wall_depth(pose)
        error_m = DEPTH_ERROR_M * (1 if frame % 2 else -1)
        writer.add(frame, np.zeros((240, 320, 3), np.uint8), depth_m + error_m, pose)
        write_depth(folder / EXACT_DEPTH_DIR / f"{frame:06d}.png", depth_m, 10_000)
        pixels = project(CAMERA, transform(np.linalg.inv(pose), np.array(list(POINTS_M.values()))))
        rows += [
            (frame, float(frame), name, *at, *pixel, 1 if name.endswith("elbow") else 2)
            for (name, at), pixel in zip(POINTS_M.items(), pixels, strict=True)
        ]
    writer.finish()
    columns = ["frame", "t_s", "keypoint", "x_m", "y_m", "z_m", "u_px", "v_px", "visible"]
    pd.DataFrame(rows, columns=columns).to_parquet(folder / TRUTH_FILE)
    joints = pd.DataFrame(angles_rad, columns=[f"{name}_rad" for name in HEAD_JOINTS])
    joints.assign(frame=range(N), t_s=np.arange(N, dtype=float)).to_parquet(folder / JOINTS_FILE)
    return open_recording(folder)


def _wall_depth(T_base_cam: np.ndarray) -> np.ndarray:
    """Depth at every pixel of a wall that fills the image."""
    v, u = np.mgrid[0:240, 0:320]
    rays = np.stack(
        [(u - CAMERA.cx_px) / CAMERA.fx_px, (v - CAMERA.cy_px) / CAMERA.fy_px, np.ones(u.shape)], -1
    )
    return (WALL_M - T_base_cam[0, 3]) / (rays @ T_base_cam[0, :3])
