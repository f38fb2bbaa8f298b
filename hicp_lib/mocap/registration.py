"""Where the motion capture's frame lies in the robot's base frame, from markers clicked in images.

From the same kind of clicks (`reprojection` has one more way, without depth):

- `register_by_camera_marker`: eight markers in two images give the rotation by Arun's method; the
  translation is the one that puts the marker on the camera at the camera's optical centre (paper section
  IV-C). Where the rotation is found about the middle of the eight, an error of it swings the person around
  the camera, a metre and more away. Where it is found about the camera, errors of depth, which lie along
  the lines of sight, turn nothing. Either is as wrong as the camera's marker is far from the centre.
- `register_selected`: rotation and translation by Arun's method from the same eight markers.
- `register_robustly`: the same from the markers of all clicked images, those left out that do not agree
  with the others.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.alignment import RigidFit, arun
from hicp_lib.core.camera import transform
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.lifting.paper import BODY_RADIUS_M
from hicp_lib.lifting.table import lift_pixels
from hicp_lib.mocap.synchronisation import interpolate_mocap
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import Recording

CAMERA_MARKER = "camera"
REGISTRATION_FILE = "registration.json"
N_PAPER_MARKERS, N_PAPER_IMAGES = 8, 2
SEEN, MEASURED = ["x_m", "y_m", "z_m"], ["mocap_x_m", "mocap_y_m", "mocap_z_m"]
_OUTLIER_MEDIANS = 3 * 1.4826  # three standard deviations, as multiples of the median residual, ...
_MIN_OUTLIER_M = 0.02  # ... and this are what residuals left out are beyond
_MAX_ROUNDS = 20
_MAX_STRETCH_M = 0.1  # by which a distance may differ between what is seen and what is measured
_MAX_SKEW = 1e-4  # by which a rotation of a file may differ from one: files are rounded


@dataclass(frozen=True)
class Registration:
    """The motion capture's frame in the robot's base frame, and what it was found from.

    Attributes
    ----------
    method : str
        How it was found, in words.
    T_base_mocap : array, shape (4, 4)
    n_points : int
        Clicked markers it rests on; 0 where it was given.
    rms_m, leave_one_out_m : float
        Root mean square residual, and median leave-one-out error, of Arun's fit to them; NaN where it was
        given.

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
        Half the side of the neighbourhood that the depth is taken from.

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
    """Where clicked markers were measured when they were seen.

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


def select_paper_markers(matched: pd.DataFrame) -> pd.DataFrame:
    """Eight markers in two images, as in the paper: of the two images that show most markers, the eight
    that lie furthest from each other.

    Clicks whose depth is that of something else, a wall behind for one, are not chosen.

    Parameters
    ----------
    matched : pd.DataFrame
        As from `lift_clicks`.

    Returns
    -------
    pd.DataFrame
        At most eight rows of it.
    """
    matched = matched[keeps_distances(matched)]
    frames = matched["frame"].value_counts(sort=True).sort_index(kind="stable").nlargest(N_PAPER_IMAGES).index
    table = matched[matched["frame"].isin(frames)].reset_index(drop=True)
    points = table[MEASURED].to_numpy()
    chosen = [int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmax())]
    while len(chosen) < min(N_PAPER_MARKERS, len(points)):
        nearest = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(axis=1)
        chosen.append(int(nearest.argmax()))
    return table.loc[sorted(chosen)].reset_index(drop=True)


def keeps_distances(matched: pd.DataFrame) -> np.ndarray:
    """Which clicks are as far from most others in the one frame as in the other, to a decimetre.

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


def camera_places(
    recording: Recording, mocap: MotionCapture, offset_s: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Where the marker on the camera was measured in every frame, and where the camera was.

    Parameters
    ----------
    recording : Recording
    mocap : MotionCapture
    offset_s : float, optional
        To add to the motion capture's stamps to have them on the camera's clock.

    Returns
    -------
    marker_m : array, shape (n_frames, 3)
        In the motion capture's frame; NaN where not measured.
    centre_m : array, shape (n_frames, 3)
        The camera's optical centre in the base frame.

    Raises
    ------
    InputError
        If the marker `camera` is missing.
    """
    if CAMERA_MARKER not in mocap.names:
        hint = "name the one on the camera so, or click markers in more images and use all of them"
        raise InputError(f"motion capture has no marker {CAMERA_MARKER!r}; {hint}")
    camera = pd.DataFrame({"frame": range(len(recording)), "marker": CAMERA_MARKER})
    marker_m = measured_markers(recording, camera, mocap, offset_s)
    if np.isnan(marker_m).all():
        raise InputError(f"marker {CAMERA_MARKER!r} was measured in no frame of the recording")
    return marker_m, recording.T_base_cam[:, :3, 3]


def register_by_camera_marker(
    matched: pd.DataFrame, marker_m: np.ndarray, centre_m: np.ndarray, about_camera: bool = False
) -> Registration:
    """Rotation by Arun's method; translation from the marker on the camera, its median over the frames.

    The paper's section IV-C.

    Parameters
    ----------
    matched : pd.DataFrame
        As from `select_paper_markers`.
    marker_m, centre_m : array, shape (n_frames, 3)
        As from `camera_places`.
    about_camera : bool, optional
        Whether the rotation is found about the camera, or about the middle of the points.

    Returns
    -------
    Registration

    Raises
    ------
    InputError
        If `hicp_lib.core.alignment.arun` refuses the points.
    """
    if about_camera:
        frames = matched["frame"]
        from_marker_m = matched[MEASURED].to_numpy() - marker_m[frames]
        measured = np.isfinite(from_marker_m).all(axis=1)
        from_centre_m = matched[SEEN].to_numpy() - centre_m[frames]
        fit = arun(from_marker_m[measured], from_centre_m[measured], about_origin=True)
    else:
        fit = _fit(matched)
    T = fit.T_b_a.copy()
    T[:3, 3] = np.nanmedian(centre_m - marker_m @ T[:3, :3].T, axis=0)
    how = "turned about the camera" if about_camera else "camera marker"
    return _registration(f"paper: eight clicks, {how}", fit, T)


def register_selected(matched: pd.DataFrame) -> Registration:
    """Arun's method alone, from all of some markers.

    Parameters
    ----------
    matched : pd.DataFrame
        As from `select_paper_markers`.

    Returns
    -------
    Registration

    Raises
    ------
    InputError
        If `hicp_lib.core.alignment.arun` refuses the points.

    Examples
    --------
    >>> corners_m = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    >>> matched = pd.DataFrame(np.c_[corners_m + [0, 0, 2], corners_m], columns=[*SEEN, *MEASURED])
    >>> registration = register_selected(matched)
    >>> registration.n_points, round(registration.T_base_mocap[2, 3], 6)
    (4, np.float64(2.0))
    """
    return _registration("Arun: the same eight clicks", _fit(matched))


def register_robustly(matched: pd.DataFrame) -> Registration:
    """Arun's method from all markers that agree.

    The start is from points that keep their distances to most others, as for `select_paper_markers`. Then
    points whose residual is beyond three robust standard deviations (and 2 cm) are left out, and the fit is
    made anew, until it stays.

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
    return _registration("all clicks", fit)


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
    try:
        T = np.array(rows, dtype=float)
    except (TypeError, ValueError):
        T = np.zeros(0)
    if T.shape != (4, 4) or not np.isfinite(T).all() or (T[3] != [0, 0, 0, 1]).any():
        raise InputError(f"{path}: T_base_mocap: expected 4 rows of 4 finite numbers, the last 0, 0, 0, 1")
    R = T[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > _MAX_SKEW or np.linalg.det(R) < 0:
        wrong = "its first three columns are not a rotation"
        raise InputError(f"{path}: T_base_mocap: {wrong}; give R, then t in m")
    return Registration("given", T)


def _fit(matched: pd.DataFrame) -> RigidFit:
    return arun(matched[MEASURED].to_numpy(), matched[SEEN].to_numpy())


def _registration(method: str, fit: RigidFit, T_base_mocap: np.ndarray | None = None) -> Registration:
    """What was found from a fit; its transform unless another is given."""
    left_out_m = fit.leave_one_out_m[np.isfinite(fit.leave_one_out_m)]
    typical_m = float(np.median(left_out_m)) if len(left_out_m) else np.nan
    T = fit.T_b_a if T_base_mocap is None else T_base_mocap
    return Registration(method, T, len(fit.residuals_m), fit.rms_m, typical_m)
