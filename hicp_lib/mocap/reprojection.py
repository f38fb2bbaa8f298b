"""Registration from pixels only: the transform that projects measured markers to where they were clicked.

It uses no depth and is free of its errors: near an edge, depth may be that of the wall behind, and near a
marker on the side of a limb, that of the skin in front. With known intrinsics, the distance of the markers
follows from how far apart they appear.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from hicp_lib.core.camera import Camera, project, transform
from hicp_lib.core.errors import InputError
from hicp_lib.core.extras import needs
from hicp_lib.mocap.registration import Registration, measured_markers
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import Recording

with needs("analysis"):
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

_MIN_CLICKS = 6
_CLICK_PX = 2.0  # clicks with larger residuals get less and less weight
_STEP = 0.01  # radians and metres with about the same effect
_BEHIND_PX = 1e4  # residual of a marker that a transform puts behind the camera


def register_by_reprojection(
    recording: Recording,
    clicks: pd.DataFrame,
    mocap: MotionCapture,
    start: Registration,
    offset_s: float = 0.0,
) -> Registration:
    """The transform with the smallest distance, in pixels, between clicks and measured markers.

    Nonlinear least squares over rotation and translation, with a robust loss (Cauchy) against wrong clicks.

    Parameters
    ----------
    recording : Recording
    clicks : pd.DataFrame
        As from `hicp_lib.mocap.clicking.read_clicks`.
    mocap : MotionCapture
    start : Registration
        Starting point; it may be off by some degrees and decimetres.
    offset_s : float, optional
        To add to the motion capture's stamps to have them on the camera's clock.

    Returns
    -------
    Registration
        Its errors are perpendicular to the line of sight: pixels times depth over focal length.

    Raises
    ------
    InputError
        If fewer than six clicked markers were measured.
    """
    seen = _matched(recording, clicks, mocap, offset_s)
    n = len(seen.points_m)
    if n < _MIN_CLICKS:
        needed = f"registration by reprojection needs {_MIN_CLICKS}"
        raise InputError(f"{n} clicked markers were measured; {needed}: click more")
    T = _solve(recording.intrinsics, seen, start.T_base_mocap)
    errors_m = _across_m(recording.intrinsics, seen, T)
    left_out_m = [
        _across_m(recording.intrinsics, seen.take([i]), _solve(recording.intrinsics, seen.take(others), T))
        for i, others in enumerate(~np.eye(n, dtype=bool))
    ]
    rms_m = float(np.sqrt(np.mean(errors_m**2)))
    return Registration("reprojection of all clicks", T, n, rms_m, float(np.median(left_out_m)))


@dataclass(frozen=True)
class _Clicked:
    """Clicked markers.

    Attributes
    ----------
    pixels_px : array, shape (n, 2)
        Where they were clicked.
    points_m : array, shape (n, 3)
        Where they were measured, in the motion capture's frame.
    T_cam_base : array, shape (n, 4, 4)
        Of their images.
    """

    pixels_px: np.ndarray
    points_m: np.ndarray
    T_cam_base: np.ndarray

    def take(self, rows: np.ndarray | list[int]) -> _Clicked:
        return _Clicked(self.pixels_px[rows], self.points_m[rows], self.T_cam_base[rows])


def _matched(recording: Recording, clicks: pd.DataFrame, mocap: MotionCapture, offset_s: float) -> _Clicked:
    points_m = measured_markers(recording, clicks, mocap, offset_s)
    T_cam_base = np.linalg.inv(recording.T_base_cam[clicks["frame"].to_numpy()])
    rows = np.flatnonzero(np.isfinite(points_m).all(axis=1))
    return _Clicked(clicks[["u_px", "v_px"]].to_numpy(float), points_m, T_cam_base).take(rows)


def _solve(intrinsics: Camera, seen: _Clicked, T_start: np.ndarray) -> np.ndarray:
    def residuals(step: np.ndarray) -> np.ndarray:
        pixels_px, _ = _reprojected(intrinsics, seen, _moved(T_start, step, about_m))
        return np.nan_to_num(pixels_px - seen.pixels_px, nan=_BEHIND_PX).ravel()

    about_m = transform(T_start, seen.points_m).mean(axis=0)
    found = least_squares(residuals, np.zeros(6), loss="cauchy", f_scale=_CLICK_PX, x_scale=_STEP)
    return _moved(T_start, found.x, about_m)


def _moved(T: np.ndarray, step: np.ndarray, about_m: np.ndarray) -> np.ndarray:
    """`T`, then a small rotation about a point (first three of `step`, a rotation vector) and a shift."""
    moved = T.copy()
    moved[:3, 3] -= about_m
    moved[:3] = Rotation.from_rotvec(step[:3]).as_matrix() @ moved[:3]
    moved[:3, 3] += about_m + step[3:]
    return moved


def _reprojected(
    intrinsics: Camera, seen: _Clicked, T_base_mocap: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (n, 2) of the measured markers, NaN behind the camera, and their depths (n,) in metres."""
    points_cam_m = transform(seen.T_cam_base @ T_base_mocap, seen.points_m[:, None])[:, 0]
    return project(intrinsics, points_cam_m), points_cam_m[:, 2]


def _across_m(intrinsics: Camera, seen: _Clicked, T_base_mocap: np.ndarray) -> np.ndarray:
    pixels_px, depth_m = _reprojected(intrinsics, seen, T_base_mocap)
    return np.linalg.norm(pixels_px - seen.pixels_px, axis=1) * depth_m / intrinsics.fx_px
