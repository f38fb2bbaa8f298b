"""Contribution of the registration to the errors, where the exact transform is known."""

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from hicp_lib.core.camera import project, transform
from hicp_lib.core.extras import needs
from hicp_lib.mocap.registration import CAMERA_MARKER, Registration
from hicp_lib.mocap.synchronisation import interpolate_mocap
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import Recording

with needs("analysis"):
    from scipy.spatial.transform import Rotation


_COLUMNS = ["method", "n_points", "rms_m", "leave_one_out_m", "turned_rad", "added_m", "worst_m"]


def compare_registrations(
    registrations: Sequence[Registration], mocap: MotionCapture, T_base_mocap: np.ndarray | None
) -> pd.DataFrame:
    """Compare registrations, including their errors at the markers on the person.

    Parameters
    ----------
    registrations : sequence of Registration
        The registrations to compare.
    mocap : MotionCapture
        Its markers.
    T_base_mocap : array or None, shape (4, 4)
        The exact transform; None if unknown.

    Returns
    -------
    DataFrame
        Columns `method, n_points, rms_m, leave_one_out_m`, and against the exact transform `turned_rad`
        (angle between the rotations), `added_m` and `worst_m` (median and largest displacement of the markers
        on the person, all frames); NaN if unknown.
    """
    on_person = [k for k, name in enumerate(mocap.names) if name != CAMERA_MARKER]
    markers_m = mocap.points_m[:, on_person].reshape(-1, 3)
    markers_m = markers_m[np.isfinite(markers_m).all(axis=1)]
    rows = []
    for one in registrations:
        errors: tuple[float, float, float] = (np.nan, np.nan, np.nan)
        if T_base_mocap is not None:
            R = one.T_base_mocap[:3, :3].T @ T_base_mocap[:3, :3]
            moved_m = transform(one.T_base_mocap, markers_m) - transform(T_base_mocap, markers_m)
            distances_m = np.linalg.norm(moved_m, axis=1)
            errors = Rotation.from_matrix(R).magnitude(), np.median(distances_m), distances_m.max()
        rows.append((one.method, one.n_points, one.rms_m, one.leave_one_out_m, *errors))
    return pd.DataFrame(rows, columns=_COLUMNS)


def marker_pixels(
    recording: Recording,
    mocap: MotionCapture,
    registrations: Sequence[Registration],
    frames: Iterable[int],
    offset_s: float = 0.0,
) -> pd.DataFrame:
    """Projections of the measured markers into images by each registration.

    Parameters
    ----------
    recording : Recording
        The images.
    mocap : MotionCapture
        The markers.
    registrations : sequence of Registration
        What is compared.
    frames : iterable of int
        Of the images; a number may occur more than once.
    offset_s : float, optional
        To add to the motion capture's stamps to have them on the camera's clock.

    Returns
    -------
    DataFrame
        Columns `method, frame, marker, u_px, v_px`; NaN where a marker was not measured.
    """
    frames = sorted(set(frames))
    measured_m = interpolate_mocap(mocap.times_s, mocap.points_m, recording.times_s[frames] - offset_s)
    tables = []
    for one in registrations:
        T_cam_mocap = np.linalg.inv(recording.T_base_cam[frames]) @ one.T_base_mocap
        pixels_px = project(recording.intrinsics, transform(T_cam_mocap, measured_m)).reshape(-1, 2)
        labels = {"method": [one.method], "frame": frames, "marker": mocap.names}
        index = pd.MultiIndex.from_product(labels.values(), names=labels)
        tables.append(pd.DataFrame(pixels_px, index, ["u_px", "v_px"]).reset_index())
    return pd.concat(tables, ignore_index=True)
