"""Where the motion capture's frame lies in the robot's base frame, from markers clicked in images.

Three ways, from the same kind of clicks (`reprojection` has a fourth, without depth):

- `as_in_paper`: eight markers in two images give the rotation by Arun's method; the translation is the
  one that puts the marker on the camera at the camera's optical centre (paper section IV-C). It is as wrong
  as that marker is far from the centre.
- `same_clicks`: rotation and translation by Arun's method from the same eight markers.
- `all_clicks`: the same from the markers of all clicked images, those left out that do not agree
  with the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.alignment import RigidFit, arun
from hicp_lib.core.camera import transform
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json, write_json
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.lifting.paper import lift
from hicp_lib.mocap.synchronisation import interpolate_mocap
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import Recording, read_depth_m

CAMERA_MARKER = "camera"
REGISTRATION_FILE = "registration.json"
N_PAPER_MARKERS, N_PAPER_IMAGES = 8, 2
_SEEN, _MEASURED = ["x_m", "y_m", "z_m"], ["mocap_x_m", "mocap_y_m", "mocap_z_m"]
_MIN_OUTLIER_M = 0.02
_MAX_ROUNDS = 20
_MAX_STRETCH_M = 0.1


@dataclass(frozen=True)
class Registration:
    """The motion capture's frame in the robot's base frame, and what it was found from.

    Attributes
    ----------
    method : how it was found, in words
    T_base_mocap : array, shape (4, 4)
    n_points : clicked markers it rests on; 0 where it was given
    rms_m, leave_one_out_m : root mean square residual, and median leave-one-out error, of Arun's fit
        to them; NaN where it was given
    """

    method: str
    T_base_mocap: np.ndarray
    n_points: int = 0
    rms_m: float = float("nan")
    leave_one_out_m: float = float("nan")


def lift_clicks(
    recording: Recording, clicks: pd.DataFrame, mocap: MotionCapture, offset_s: float = 0.0
) -> pd.DataFrame:
    """Clicked markers in the robot's base frame and in the motion capture's; others are left out.

    They are lifted like keypoints of the body, by the paper's method.

    Parameters
    ----------
    clicks : as from `read_clicks`
    offset_s : to add to the motion capture's stamps to have them on the camera's clock

    Returns
    -------
    DataFrame, columns `frame, marker, x_m, y_m, z_m, mocap_x_m, mocap_y_m, mocap_z_m`
    """
    tables = []
    for frame, rows in clicks.groupby("frame"):
        pixels_px = np.full((len(rows), N_KEYPOINTS, 2), np.nan)
        pixels_px[:, 0] = rows[["u_px", "v_px"]]
        points_m = lift(pixels_px, read_depth_m(recording, frame), recording.intrinsics).points_m[:, 0]
        stamp_s = recording.times_s[[frame]] - offset_s
        columns = [mocap.names.index(name) for name in rows["marker"]]
        measured_m = interpolate_mocap(mocap.times_s, mocap.points_m[:, columns], stamp_s)[0]
        table = rows[["frame", "marker"]].copy()
        table[_SEEN], table[_MEASURED] = transform(recording.T_base_cam[frame], points_m), measured_m
        tables.append(table)
    return pd.concat(tables, ignore_index=True).dropna(ignore_index=True)


def papers_choice(matched: pd.DataFrame) -> pd.DataFrame:
    """Eight markers in two images, as in the paper: of the two images that show most markers, the eight
    that lie furthest from each other.

    Clicks whose depth is that of something else, a wall behind for one, are not chosen.
    """
    matched = matched[_keeps_distances(matched)]
    frames = matched["frame"].value_counts(sort=True).sort_index(kind="stable").nlargest(N_PAPER_IMAGES).index
    table = matched[matched["frame"].isin(frames)].reset_index(drop=True)
    points = table[_MEASURED].to_numpy()
    chosen = [int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmax())]
    while len(chosen) < min(N_PAPER_MARKERS, len(points)):
        nearest = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(axis=1)
        chosen.append(int(nearest.argmax()))
    return table.loc[sorted(chosen)].reset_index(drop=True)


def _keeps_distances(matched: pd.DataFrame) -> np.ndarray:
    """Which points (n,) are as far from most others in the one frame as in the other, to a decimetre."""
    seen, measured = (matched[names].to_numpy() for names in (_SEEN, _MEASURED))
    stretched_m = np.abs(_distances_between(seen) - _distances_between(measured))
    return np.median(stretched_m, axis=1) < _MAX_STRETCH_M


def _distances_between(points_m: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points_m[:, None] - points_m[None], axis=2)


def as_in_paper(
    matched: pd.DataFrame, recording: Recording, mocap: MotionCapture, offset_s: float = 0.0
) -> Registration:
    """Rotation by Arun's method; translation from the marker on the camera, its median over the frames.

    Raises
    ------
    InputError
        If `arun` refuses the points, or the marker `camera` is missing.
    """
    if CAMERA_MARKER not in mocap.names:
        raise InputError(
            f"motion capture has no marker {CAMERA_MARKER!r}; name the one on the camera so, or click "
            "markers in more images and use all of them"
        )
    fit = _fit(matched)
    column = [mocap.names.index(CAMERA_MARKER)]
    marker_m = interpolate_mocap(mocap.times_s, mocap.points_m[:, column], recording.times_s - offset_s)[:, 0]
    if np.isnan(marker_m).all():
        raise InputError(f"marker {CAMERA_MARKER!r} was measured in no frame of the recording")
    T = fit.T_b_a.copy()
    T[:3, 3] = np.nanmedian(recording.T_base_cam[:, :3, 3] - marker_m @ T[:3, :3].T, axis=0)
    return _registration("paper: eight clicks, camera marker", T, fit)


def same_clicks(matched: pd.DataFrame) -> Registration:
    """Arun's method alone, from all of `matched`. Raises as `arun`."""
    fit = _fit(matched)
    return _registration("Arun: the same eight clicks", fit.T_b_a, fit)


def all_clicks(matched: pd.DataFrame) -> Registration:
    """Arun's method from all of `matched` that agree.

    The start is from points that keep their distances to most others, as for `papers_choice`. Then points
    whose residual is beyond three robust standard deviations (and 2 cm) are left out, and the fit is made
    anew, until it stays. Raises as `arun`.
    """
    seen, measured = matched[_SEEN].to_numpy(), matched[_MEASURED].to_numpy()
    kept = _keeps_distances(matched)
    for _ in range(_MAX_ROUNDS):
        fit = arun(measured[kept], seen[kept])
        residuals_m = np.linalg.norm(transform(fit.T_b_a, measured) - seen, axis=1)
        bound_m = max(_MIN_OUTLIER_M, 3 * 1.4826 * float(np.median(residuals_m[kept])))
        agrees = residuals_m <= bound_m
        if (agrees == kept).all() or agrees.sum() < 3:
            break
        kept = agrees
    return _registration("all clicks", fit.T_b_a, fit)


def read_registration(path: str | Path) -> Registration:
    """Read `registration.json` of a laboratory that knows the transform: `{"T_base_mocap": 4 rows of 4}`.

    Raises
    ------
    InputError
        If it is not a rigid transform in metres.
    """
    content = read_json(path)
    rows = content.get("T_base_mocap") if isinstance(content, dict) else None
    try:
        T = np.array(rows, dtype=float)
    except (TypeError, ValueError):
        T = np.zeros(0)
    if T.shape != (4, 4) or not np.isfinite(T).all() or (T[3] != [0, 0, 0, 1]).any():
        raise InputError(f"{path}: T_base_mocap: expected 4 rows of 4 finite numbers, the last 0, 0, 0, 1")
    R = T[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-4 or np.linalg.det(R) < 0:
        raise InputError(
            f"{path}: T_base_mocap: its first three columns are not a rotation; give R, then t in m"
        )
    return Registration("given", T)


def write_registration(path: str | Path, registration: Registration) -> None:
    """Write what `read_registration` reads."""
    write_json(path, {"T_base_mocap": registration.T_base_mocap.tolist(), "method": registration.method})


def _fit(matched: pd.DataFrame) -> RigidFit:
    return arun(matched[_MEASURED].to_numpy(), matched[_SEEN].to_numpy())


def _registration(method: str, T_base_mocap: np.ndarray, fit: RigidFit) -> Registration:
    left_out = fit.leave_one_out_m[np.isfinite(fit.leave_one_out_m)]
    typical_m = float(np.median(left_out)) if len(left_out) else float("nan")
    return Registration(method, T_base_mocap, len(fit.residuals_m), fit.rms_m, typical_m)
