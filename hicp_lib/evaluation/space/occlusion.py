"""How the camera stands to a joint: how far it is, and whether something is in front of it.

Both come from motion capture and the depth image, so any recording has them.
"""

import numpy as np
import pandas as pd

from hicp_lib.core.camera import project, transform
from hicp_lib.evaluation.space.stability import POSITION
from hicp_lib.recordings.recording import Recording, read_depth_m

OCCLUSIONS = ("clear", "hidden", "outside", "no depth", "unknown")
# How far in front of the middle between two markers something must be to hide the joint: more than half
# the limb and its sleeve.
IN_FRONT_M = {"wrist": 0.06, "elbow": 0.09, "shoulder": 0.13}
_HALF_WINDOW_PX = 2


def joint_occlusion(recording: Recording, positions: pd.DataFrame) -> pd.DataFrame:
    """Distance from the camera, and what the depth image has at each joint's pixel.

    Parameters
    ----------
    recording : Recording
        With depth.
    positions : DataFrame
        Columns `frame, keypoint` ("left_wrist", ...), `x_m, y_m, z_m` (base frame); NaN where not known.

    Returns
    -------
    DataFrame
        A row for each of `positions`: columns `frame, keypoint, distance_m` (from the optical centre) and
        `sight`: "clear", "hidden" (the median depth of 5 x 5 pixels is more than `IN_FRONT_M` nearer),
        "outside" the image, "no depth" there, or "unknown" where the position is.
    """
    frames = positions["frame"].to_numpy()
    T_cam_base = np.linalg.inv(recording.T_base_cam)[frames]
    points_m = transform(T_cam_base, positions[POSITION].to_numpy(float)[:, None])[:, 0]
    margins_m = positions["keypoint"].str.split("_").str[1].map(IN_FRONT_M).to_numpy(float)
    pixels_px = project(recording.intrinsics, points_m)
    in_image = recording.intrinsics.contains(pixels_px)  # not where NaN: behind the camera
    known = np.isfinite(points_m).all(axis=1)
    occlusions = np.where(known, "outside", "unknown").astype(object)
    for frame in np.unique(frames[in_image]):
        depth_m = read_depth_m(recording, int(frame))
        for row in np.flatnonzero(in_image & (frames == frame)):
            near_m = _median_depth_m(depth_m, pixels_px[row])
            hidden = near_m < points_m[row, 2] - margins_m[row]
            occlusions[row] = "no depth" if np.isnan(near_m) else "hidden" if hidden else "clear"
    distances_m = np.linalg.norm(points_m, axis=1)
    return positions[["frame", "keypoint"]].assign(distance_m=distances_m, sight=occlusions)


def _median_depth_m(depth_m: np.ndarray, pixel_px: np.ndarray) -> float:
    """Of the measured pixels around one; NaN where none is."""
    column, row = (round(place) for place in pixel_px)
    low = [max(place - _HALF_WINDOW_PX, 0) for place in (row, column)]
    window = depth_m[low[0] : row + _HALF_WINDOW_PX + 1, low[1] : column + _HALF_WINDOW_PX + 1]
    measured = window[np.isfinite(window)]
    return float(np.median(measured)) if measured.size else np.nan
