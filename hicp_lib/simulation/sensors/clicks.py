"""Markers as someone would click them: where they are in the image, with the error of a hand."""

from __future__ import annotations

import numpy as np
import pandas as pd

from hicp_lib.core.camera import project, transform
from hicp_lib.mocap.synchronisation import interpolate_mocap
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import Recording, read_exact_depth_m

# A marker is clicked if nothing is this much nearer at its place: it sits on the skin, so its own
# limb is not.
_IN_FRONT_M = 0.03


def simulate_clicks(
    recording: Recording,
    mocap: MotionCapture,
    T_base_mocap: np.ndarray,
    n_images: int,
    noise_px: float,
    offset_s: float = 0.0,
    seed: int = 0,
) -> pd.DataFrame:
    """Clicks on the visible markers of images spread evenly over a simulated recording.

    Parameters
    ----------
    T_base_mocap : array, shape (4, 4); the true one
    noise_px : standard deviation of a click in u and in v
    offset_s : to add to the motion capture's stamps to have them on the camera's clock; the true one

    Returns
    -------
    DataFrame, columns as `hicp_lib.mocap.clicking.read_clicks`
    """
    rng = np.random.default_rng(seed)
    tables = []
    for frame in np.unique(np.linspace(0, len(recording) - 1, n_images).round().astype(int)):
        stamp_s = recording.times_s[[frame]] - offset_s
        markers_m = interpolate_mocap(mocap.times_s, mocap.points_m, stamp_s)[0]
        T_cam_mocap = np.linalg.inv(recording.T_base_cam[frame]) @ T_base_mocap
        points_m = transform(T_cam_mocap, markers_m)
        pixels_px = project(recording.intrinsics, points_m)
        seen = _is_seen(pixels_px, points_m[:, 2], read_exact_depth_m(recording, int(frame)))
        clicked_px = pixels_px + rng.normal(0, noise_px, pixels_px.shape)
        table = pd.DataFrame(clicked_px, columns=["u_px", "v_px"])
        table.insert(0, "marker", list(mocap.names))
        table.insert(0, "frame", int(frame))
        tables.append(table[seen])
    return pd.concat(tables, ignore_index=True)


def _is_seen(pixels_px: np.ndarray, depths_m: np.ndarray, exact_depth_m: np.ndarray) -> np.ndarray:
    """Which points are in the image with nothing in front of them."""
    height, width = exact_depth_m.shape
    inside = ((pixels_px >= 0) & (pixels_px <= [width - 1, height - 1])).all(axis=1)
    columns, rows = np.where(inside[:, None], pixels_px, 0).round().astype(int).T
    return inside & (exact_depth_m[rows, columns] > depths_m - _IN_FRONT_M)
