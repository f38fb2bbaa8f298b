"""Pose of the motion capture's frame in the robot's base frame, from markers clicked in images.

It uses the markers of all clicked images, without those that disagree with the others. The paper's method is
in `eight_clicks`; `reprojection` has a method without depth.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.alignment import RigidFit, arun
from hicp_lib.core.camera import transform
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.formats.json_validation import is_number
from hicp_lib.lifting.paper import BODY_RADIUS_M
from hicp_lib.lifting.table import lift_pixels
from hicp_lib.mocap.synchronisation import interpolate_mocap
from hicp_lib.recordings.qualisys import MAX_MARKER_M, MotionCapture
from hicp_lib.recordings.recording import Recording

CAMERA_MARKER = "camera"
REGISTRATION_FILE = "registration.json"
SEEN, MEASURED = ["x_m", "y_m", "z_m"], ["mocap_x_m", "mocap_y_m", "mocap_z_m"]
_OUTLIER_MEDIANS = 3 * 1.4826  # three standard deviations, as multiples of the median residual, ...
_MIN_OUTLIER_M = 0.02  # ... and this: larger residuals are left out
_MAX_ROUNDS = 20
_MAX_STRETCH_M = 0.1  # tolerance between a seen and a measured distance
_MAX_SKEW = 1e-4  # tolerance of a rotation in a file: files are rounded


@dataclass(frozen=True)
class Registration:
    """The motion capture's frame in the robot's base frame, and how it was computed.

    Attributes
    ----------
    method : str
        The method, in words.
    T_base_mocap : array, shape (4, 4)
    n_points : int
        Number of clicked markers used; 0 if it was given.
    rms_m, leave_one_out_m : float
        Root mean square residual, and median leave-one-out error, of Arun's fit to them; NaN if it was given.

    Examples
    --------
    >>> Registration("given", np.eye(4)).n_points
    0
    """

    method: str
    T_base_mocap: np.ndarray
    n_points: int = 0
    rms_m: float = np.nan
    leave_one_out_m: float = np.nan

    @classmethod
    def of_fit(cls, method: str, fit: RigidFit, T_base_mocap: np.ndarray | None = None) -> Registration:
        """The registration from a fit.

        Parameters
        ----------
        method : str
            The method, in words.
        fit : RigidFit
        T_base_mocap : array, shape (4, 4), optional
            The transform, if it is not the fit's own.

        Returns
        -------
        Registration
        """
        left_out_m = fit.leave_one_out_m[np.isfinite(fit.leave_one_out_m)]
        typical_m = float(np.median(left_out_m)) if len(left_out_m) else np.nan
        T = fit.T_b_a if T_base_mocap is None else T_base_mocap
        return cls(method, T, len(fit.residuals_m), fit.rms_m, typical_m)


def lift_clicks(
    recording: Recording,
    clicks: pd.DataFrame,
    mocap: MotionCapture,
    offset_s: float = 0.0,
    radius_m: float = BODY_RADIUS_M,
) -> pd.DataFrame:
    """Clicked markers in the robot's base frame and in the motion capture's; others are left out.

    They are lifted by the paper's method, like keypoints of the body unless another radius is given.

    Parameters
    ----------
    recording : Recording
    clicks : pd.DataFrame
        As from `hicp_lib.mocap.clicking.read_clicks`.
    mocap : MotionCapture
    offset_s : float, optional
        To add to the motion capture's stamps to have them on the camera's clock.
    radius_m : float, optional
        Half the side of the neighbourhood from which the depth is taken.

    Returns
    -------
    pd.DataFrame
        Columns `frame, marker, x_m, y_m, z_m, mocap_x_m, mocap_y_m, mocap_z_m`.
    """
    clicks = clicks.sort_values("frame", kind="stable", ignore_index=True)
    (seen_m,) = lift_pixels(recording, clicks, [radius_m])
    table = clicks[["frame", "marker"]].copy()
    table[SEEN], table[MEASURED] = seen_m, measured_markers(recording, clicks, mocap, offset_s)
    return table.dropna(ignore_index=True)


def measured_markers(
    recording: Recording, clicks: pd.DataFrame, mocap: MotionCapture, offset_s: float
) -> np.ndarray:
    """Measured positions of clicked markers at the times of the images.

    Parameters
    ----------
    recording : Recording
    clicks : pd.DataFrame
        With columns `frame` and `marker`, n rows.
    mocap : MotionCapture
    offset_s : float
        To add to the motion capture's stamps to have them on the camera's clock.

    Returns
    -------
    array, shape (n, 3)
        In the motion capture's frame; NaN where not measured.
    """
    stamps_s = recording.times_s[clicks["frame"].to_numpy()] - offset_s
    columns = [mocap.names.index(name) for name in clicks["marker"]]
    return interpolate_mocap(mocap.times_s, mocap.points_m, stamps_s)[np.arange(len(clicks)), columns]


def keeps_distances(matched: pd.DataFrame) -> np.ndarray:
    """Which clicks have the same distances to most others in both frames, within a decimetre.

    Parameters
    ----------
    matched : pd.DataFrame
        As from `lift_clicks`, n rows.

    Returns
    -------
    array of bool, shape (n,)
    """
    seen_m, measured_m = (
        np.linalg.norm(points_m[:, None] - points_m, axis=2)
        for points_m in (matched[names].to_numpy() for names in (SEEN, MEASURED))
    )
    return np.median(np.abs(seen_m - measured_m), axis=1) < _MAX_STRETCH_M


def register_robustly(matched: pd.DataFrame) -> Registration:
    """Arun's method with all markers that agree.

    It starts with points that keep their distances to most others. Then points whose residual exceeds three
    robust standard deviations (and 2 cm) are left out and the fit is repeated, until it no longer changes.

    Parameters
    ----------
    matched : pd.DataFrame
        As from `lift_clicks`.

    Returns
    -------
    Registration

    Raises
    ------
    InputError
        If `hicp_lib.core.alignment.arun` refuses the points.
    """
    seen_m, measured_m = matched[SEEN].to_numpy(), matched[MEASURED].to_numpy()
    kept = keeps_distances(matched)
    for _ in range(_MAX_ROUNDS):
        fit = arun(measured_m[kept], seen_m[kept])
        residuals_m = np.linalg.norm(transform(fit.T_b_a, measured_m) - seen_m, axis=1)
        agrees = residuals_m <= max(_MIN_OUTLIER_M, _OUTLIER_MEDIANS * float(np.median(residuals_m[kept])))
        if (agrees == kept).all() or agrees.sum() < 3:
            break
        kept = agrees
    return Registration.of_fit("all clicks", fit)


def read_registration(path: str | Path) -> Registration:
    """Read `registration.json` of a laboratory that knows the transform: `{"T_base_mocap": 4 rows of 4}`.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Registration

    Raises
    ------
    InputError
        If it is not a rigid transform in metres.
    """
    content = read_json(path)
    rows = content.get("T_base_mocap") if isinstance(content, dict) else None
    lists = [row for row in rows if isinstance(row, list)] if isinstance(rows, list) else []
    is_square = [len(row) for row in lists] == [4] * 4 and all(map(is_number, chain(*lists)))
    T = np.array(rows, float) if is_square else np.full((4, 4), np.nan)
    if not (np.abs(T) <= MAX_MARKER_M).all() or T[3].tolist() != [0, 0, 0, 1]:
        expected = f"expected 4 rows of 4 numbers up to {MAX_MARKER_M:g}, the last 0, 0, 0, 1"
        raise InputError(f"{path}: T_base_mocap: {expected}")
    R = T[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > _MAX_SKEW or np.linalg.det(R) < 0:
        wrong = "its first three columns are not a rotation"
        raise InputError(f"{path}: T_base_mocap: {wrong}; give R, then t in m")
    return Registration("given", T)
