"""Markers that are discs before a wall, seen twice by a camera that carries one too."""

from pathlib import Path

import numpy as np

from hicp_lib.core.camera import Camera, project, transform
from hicp_lib.evaluation.space.mocap_error import JOINTS, MARKERS
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import Recording, open_recording
from tests.recordings.writing import RecordingWriter

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
T_BASE_CAM = np.array([[0.0, 0, -1, 0.1], [1, 0, 0, 0], [0, -1, 0, 0.4], [0, 0, 0, 1]])
T_BASE_MOCAP = np.array([[0.0, -1, 0, 0.7], [1, 0, 0, -0.3], [0, 0, 1, 0.5], [0, 0, 0, 1]])
NAMES = (*(name for joint in JOINTS for name in MARKERS[joint]), "camera")
CAMERA_MARKER_CAM = np.array([0.03, -0.02, 0.0])
OFFSET_S = 70.0


def markers_cam() -> np.ndarray:
    """Twelve places, (12, 3), spread over the image and over half a metre of depth."""
    u, v = np.meshgrid([-0.35, -0.12, 0.12, 0.35], [-0.3, 0.0, 0.3])
    z = 1.0 + 0.5 * np.random.default_rng(0).random(12)
    return np.c_[u.ravel() * z, v.ravel() * z, z]


def laboratory_in(tmp_path: Path) -> tuple[Recording, MotionCapture]:
    """A person who stands still, seen twice."""
    v, u = np.mgrid[:240, :320]
    depth = np.full(u.shape, 3.0)
    for (u0, v0), z in zip(project(CAMERA, markers_cam()), markers_cam()[:, 2], strict=True):
        depth[np.hypot(u - u0, v - v0) <= 0.05 * 300 / z] = z
    writer = RecordingWriter(tmp_path / "room", CAMERA, 10_000.0)
    for k in range(2):
        writer.add(OFFSET_S + 0.1 + k / 10, np.zeros((240, 320, 3), np.uint8), depth, T_BASE_CAM)
    writer.finish()
    (writer.folder / "exact_depth").symlink_to(writer.folder / "depth")
    times_s = np.arange(0, 1, 0.01)
    points = transform(np.linalg.inv(T_BASE_MOCAP) @ T_BASE_CAM, np.r_[markers_cam(), [CAMERA_MARKER_CAM]])
    return open_recording(writer.folder), MotionCapture(times_s, NAMES, np.tile(points, (100, 1, 1)), 100.0)


def displacement_m(T: np.ndarray) -> float:
    """Of the markers, the largest, against the true transform."""
    points = transform(np.linalg.inv(T_BASE_MOCAP) @ T_BASE_CAM, markers_cam())
    return float(np.linalg.norm(transform(T, points) - transform(T_BASE_MOCAP, points), axis=1).max())
