"""Simulated clicks on markers: their positions in the image, with a human error."""

import numpy as np
import pandas as pd

from hicp_lib.core.camera import project, transform
from hicp_lib.core.errors import InputError
from hicp_lib.mocap.synchronisation import interpolate_mocap
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import Recording, read_exact_depth_m

# A marker is clicked if nothing is nearer by this much at its pixel; it is on the skin, so its own limb is
# not.
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
    recording : Recording
        A simulated one.
    mocap : MotionCapture
    T_base_mocap : array, shape (4, 4)
        The true one.
    n_images : int
    noise_px : float
        Standard deviation of a click in u and in v.
    offset_s : float, optional
        To add to the motion capture's stamps to have them on the camera's clock; the true one.
    seed : int, optional

    Returns
    -------
    pd.DataFrame
        Columns as `hicp_lib.mocap.clicking.read_clicks`.
    """
    rng = np.random.default_rng(seed)
    tables = []
    for frame in np.unique(np.linspace(0, len(recording) - 1, n_images).round().astype(int)):
        stamp_s = recording.times_s[[frame]] - offset_s
        markers_m = interpolate_mocap(mocap.times_s, mocap.points_m, stamp_s)[0]
        T_cam_mocap = np.linalg.inv(recording.T_base_cam[frame]) @ T_base_mocap
        points_m = transform(T_cam_mocap, markers_m)
        pixels_px = project(recording.intrinsics, points_m)
        exact_depth_m = read_exact_depth_m(recording, int(frame))
        if exact_depth_m is None:
            raise InputError(f"{recording.folder}: has no exact depth; give a simulated recording")
        inside = recording.intrinsics.contains(pixels_px)
        columns, rows = np.floor(np.where(inside[:, None], pixels_px, 0) + 0.5).astype(int).T
        seen = inside & (exact_depth_m[rows, columns] > points_m[:, 2] - _IN_FRONT_M)
        u_px, v_px = (pixels_px + rng.normal(0, noise_px, pixels_px.shape)).T
        clicks = {"frame": int(frame), "marker": list(mocap.names), "u_px": u_px, "v_px": v_px}
        tables.append(pd.DataFrame(clicks)[seen])
    return pd.concat(tables, ignore_index=True)
