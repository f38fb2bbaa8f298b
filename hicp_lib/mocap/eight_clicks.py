"""The paper's registration (section IV-C): eight markers clicked in two images, and one on the camera.

The eight give the rotation by Arun's method. The translation puts the marker on the camera at the camera's
optical centre; its error is that marker's distance from the centre. If the rotation is fitted about the
centroid of the eight markers, its error moves the person, a metre and more away, around the camera. If it is
fitted about the camera, errors of depth, which lie along the lines of sight, cause no rotation.
"""

import numpy as np
import pandas as pd

from hicp_lib.core.alignment import arun
from hicp_lib.core.errors import InputError
from hicp_lib.mocap import registration as r
from hicp_lib.mocap.registration import MEASURED, SEEN, Registration
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import Recording

N_MARKERS, N_IMAGES = 8, 2


def select_markers(matched: pd.DataFrame) -> pd.DataFrame:
    """Eight markers in two images, as in the paper.

    They are from the two images that show most markers, the eight that are furthest from each other.

    Clicks with the depth of another surface, such as a wall behind, are not chosen.

    Parameters
    ----------
    matched : pd.DataFrame
        As from `lift_clicks`.

    Returns
    -------
    pd.DataFrame
        At most eight rows of it.
    """
    matched = matched[r.keeps_distances(matched)]
    frames = matched["frame"].value_counts(sort=True).sort_index(kind="stable").nlargest(N_IMAGES).index
    table = matched[matched["frame"].isin(frames)].reset_index(drop=True)
    points = table[MEASURED].to_numpy()
    chosen = [int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmax())]
    while len(chosen) < min(N_MARKERS, len(points)):
        nearest = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(axis=1)
        chosen.append(int(nearest.argmax()))
    return table.loc[sorted(chosen)].reset_index(drop=True)


def camera_places(
    recording: Recording, mocap: MotionCapture, offset_s: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Measured positions of the marker on the camera in every frame, and positions of the camera.

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
    if r.CAMERA_MARKER not in mocap.names:
        hint = "name the one on the camera so, or click markers in more images and use all of them"
        raise InputError(f"motion capture has no marker {r.CAMERA_MARKER!r}; {hint}")
    camera = pd.DataFrame({"frame": range(len(recording)), "marker": r.CAMERA_MARKER})
    marker_m = r.measured_markers(recording, camera, mocap, offset_s)
    if np.isnan(marker_m).all():
        raise InputError(f"marker {r.CAMERA_MARKER!r} was measured in no frame of the recording")
    return marker_m, recording.T_base_cam[:, :3, 3]


def register_by_camera_marker(
    matched: pd.DataFrame, marker_m: np.ndarray, centre_m: np.ndarray, about_camera: bool = False
) -> Registration:
    """Rotation by Arun's method; translation from the marker on the camera, its median over the frames.

    The paper's section IV-C.

    Parameters
    ----------
    matched : pd.DataFrame
        As from `select_markers`.
    marker_m, centre_m : array, shape (n_frames, 3)
        As from `camera_places`.
    about_camera : bool, optional
        Whether the rotation is fitted about the camera, or about the centroid of the points.

    Returns
    -------
    Registration

    Raises
    ------
    InputError
        If `hicp_lib.core.alignment.arun` refuses the points.
    """
    measured_m, seen_m = matched[MEASURED].to_numpy(), matched[SEEN].to_numpy()
    if about_camera:
        frames = matched["frame"]
        measured_m, seen_m = measured_m - marker_m[frames], seen_m - centre_m[frames]
    known = np.isfinite(measured_m).all(axis=1)
    fit = arun(measured_m[known], seen_m[known], about_camera)
    T = fit.T_b_a.copy()
    T[:3, 3] = np.nanmedian(centre_m - marker_m @ T[:3, :3].T, axis=0)
    how = "turned about the camera" if about_camera else "camera marker"
    return Registration.of_fit(f"paper: eight clicks, {how}", fit, T)


def register_selected(matched: pd.DataFrame) -> Registration:
    """Arun's method alone, from all given markers.

    Parameters
    ----------
    matched : pd.DataFrame
        As from `select_markers`.

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
    return Registration.of_fit(
        "Arun: the same eight clicks", arun(matched[MEASURED].to_numpy(), matched[SEEN].to_numpy())
    )
