"""Registration from pixels: exact on exact clicks, robust to wrong ones, with a camera that moves."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hicp_lib.core.camera import Camera, project, transform
from hicp_lib.core.errors import InputError
from hicp_lib.mocap.registration import Registration
from hicp_lib.mocap.reprojection import register_by_reprojection
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import Recording

CAMERA = Camera(640, 480, 615.0, 615.0, 320.0, 240.0)
NAMES = tuple(f"m{k}" for k in range(12))
N_IMAGES = 4


def rigid(rotation: Rotation, shift) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation.as_matrix(), shift
    return T


def laboratory(seed: int, noise_px: float = 0.0):
    """The true transform, a recording whose camera turns, its motion capture and clicks on all markers."""
    rng = np.random.default_rng(seed)
    T_base_mocap = rigid(Rotation.random(rng=rng), rng.normal(0, 1, 3))
    T_base_cam = np.stack([rigid(Rotation.from_rotvec(rng.normal(0, 0.05, 3)), [0.1, 0, 0.3])] * N_IMAGES)
    T_base_cam[1:, :3, 3] += rng.normal(0, 0.02, (N_IMAGES - 1, 3))
    recording = Recording(Path("."), CAMERA, 1e3, 7 + np.arange(N_IMAGES) / 10, [], [], T_base_cam, None)
    times_s = np.arange(0, 1, 0.01)
    markers_cam = rng.uniform([-0.4, -0.4, 1.2], [0.4, 0.4, 1.8], (12, 3))
    drift_m = times_s[:, None, None] * [0.1, 0.0, 0.05]
    points = transform(np.linalg.inv(T_base_mocap) @ T_base_cam[0], markers_cam) + drift_m
    rows = []
    for k in range(N_IMAGES):
        pixels = project(CAMERA, transform(np.linalg.inv(T_base_cam[k]) @ T_base_mocap, points[10 * k]))
        pixels = pixels + rng.normal(0, 1, pixels.shape) * noise_px
        rows += [(k, name, *pixel) for name, pixel in zip(NAMES, pixels.tolist(), strict=True)]
    clicks = pd.DataFrame(rows, columns=["frame", "marker", "u_px", "v_px"])
    start = T_base_mocap @ rigid(Rotation.from_rotvec(rng.normal(0, 0.05, 3)), rng.normal(0, 0.05, 3))
    return (
        T_base_mocap,
        recording,
        MotionCapture(times_s, NAMES, points, 100.0),
        clicks,
        Registration("", start),
    )


def displacement_m(T: np.ndarray, exact: np.ndarray, mocap: MotionCapture) -> float:
    moved = transform(T, mocap.points_m[0]) - transform(exact, mocap.points_m[0])
    return float(np.nanmax(np.linalg.norm(moved, axis=1)))


@settings(max_examples=3)
@given(st.integers(0, 1000))
def test_exact_clicks_give_the_exact_transform(seed):
    exact, recording, mocap, clicks, start = laboratory(seed)
    found = register_by_reprojection(recording, clicks, mocap, start, offset_s=7.0)
    assert displacement_m(found.T_base_mocap, exact, mocap) < 1e-6
    assert found.rms_m < 1e-6 and found.leave_one_out_m < 1e-6 and found.n_points == 12 * N_IMAGES


def test_clicks_a_pixel_off_leave_millimetres():
    exact, recording, mocap, clicks, start = laboratory(3, noise_px=1.0)
    found = register_by_reprojection(recording, clicks, mocap, start, offset_s=7.0)
    assert displacement_m(found.T_base_mocap, exact, mocap) < 0.006
    # A pixel in u and in v, at a metre and a half.
    assert 0.5 * 1.41 * 1.5 / 615 < found.rms_m < 1.5 * 1.41 * 1.5 / 615


def test_wrong_clicks_and_missing_markers_do_little_harm():
    exact, recording, mocap, clicks, start = laboratory(5)
    clicks.loc[::9, "v_px"] += 60
    mocap.points_m[:, 4] = np.nan
    found = register_by_reprojection(recording, clicks, mocap, start, offset_s=7.0)
    assert displacement_m(found.T_base_mocap, exact, mocap) < 0.01
    assert found.n_points == 11 * N_IMAGES


def test_too_few_clicks_are_refused():
    _, recording, mocap, clicks, start = laboratory(0)
    with pytest.raises(InputError, match="5 clicked markers were measured"):
        register_by_reprojection(recording, clicks[:5], mocap, start, offset_s=7.0)


def test_six_clicks_are_enough():
    exact, recording, mocap, clicks, start = laboratory(0)
    found = register_by_reprojection(recording, clicks[:6], mocap, start, offset_s=7.0)
    assert found.n_points == 6 and displacement_m(found.T_base_mocap, exact, mocap) < 1e-5


def test_clicks_count_less_from_two_pixels_on():
    """The transform is where the sum of log(1 + (pixels / 2)^2) over all coordinates is least."""
    _, recording, mocap, clicks, start = laboratory(3, noise_px=2.0)
    found = register_by_reprojection(recording, clicks, mocap, start, offset_s=7.0).T_base_mocap
    points_m = np.concatenate([mocap.points_m[10 * k] for k in range(N_IMAGES)])
    T_cam_base = np.linalg.inv(recording.T_base_cam[clicks["frame"]])

    def cost(step: np.ndarray) -> float:
        T = T_cam_base @ found @ rigid(Rotation.from_rotvec(step[:3]), step[3:])
        off_px = project(CAMERA, transform(T, points_m[:, None])[:, 0]) - clicks[["u_px", "v_px"]].to_numpy()
        return np.log1p((off_px / 2) ** 2).sum()

    steps = 1e-5 * np.eye(6)
    slopes = np.array([(cost(step) - cost(-step)) / 2e-5 for step in steps])
    curvatures = np.array([(cost(step) - 2 * cost(0 * step) + cost(-step)) / 1e-10 for step in steps])
    assert abs(slopes / curvatures).max() < 2e-5  # radians, metres: how far the least is along each axis
