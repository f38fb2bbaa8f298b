"""Markers that are discs before a wall, seen by a moving camera with a marker on it."""

import numpy as np
from scipy.spatial.transform import Rotation

from hicp_lib.core.camera import Camera, project, transform

INTRINSICS = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
NAMES = (*(f"m{k}" for k in range(9)), "camera")
MARKERS_CAM = np.array(
    [[-0.4, -0.3, 1.2], [0.1, -0.28, 1.0], [0.5, -0.25, 1.4], [-0.3, 0.05, 0.9], [0.15, 0.1, 1.5],
     [0.45, 0.02, 1.1], [-0.25, 0.3, 1.3], [0.1, 0.28, 1.0], [0.4, 0.3, 1.2]]
)  # fmt: skip
CAMERA_MARKER_CAM = np.array([0.02, -0.03, -0.01])
T_BASE_MOCAP = np.eye(4)
T_BASE_MOCAP[:3, :3] = Rotation.from_euler("xyz", [0.3, -0.2, 2.0]).as_matrix()
T_BASE_MOCAP[:3, 3] = [-1.5, 0.4, 0.2]


def camera_pose(k: int) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", [0.02 * k, 0.03 * k, -0.1]).as_matrix()
    T[:3, 3] = [0.01 * k, 0.02, 0.3]
    return T


def depth_of(points_cam: np.ndarray) -> np.ndarray:
    """A wall at 3 m, and before it a disc of 4 cm about every point."""
    v, u = np.mgrid[: INTRINSICS.height_px, : INTRINSICS.width_px]
    depth = np.full(u.shape, 3.0)
    for centre, point in zip(project(INTRINSICS, points_cam), points_cam, strict=True):
        disc = np.hypot(u - centre[0], v - centre[1]) <= INTRINSICS.fx_px * 0.04 / point[2]
        depth[disc] = np.minimum(depth[disc], point[2])
    return depth


def errors_of(registration) -> tuple[float, float]:
    """Angle [rad] from the exact rotation, and largest displacement [m] of the markers."""
    T = registration.T_base_mocap
    angle = Rotation.from_matrix(T[:3, :3].T @ T_BASE_MOCAP[:3, :3]).magnitude()
    points = transform(np.linalg.inv(T_BASE_MOCAP) @ camera_pose(0), MARKERS_CAM)
    moved = transform(T, points) - transform(T_BASE_MOCAP, points)
    return angle, np.linalg.norm(moved, axis=1).max()
