"""Distance of a joint from the camera, and whether it is occluded.

Both come from motion capture and the depth image, so any recording has them.
"""

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view

from hicp_lib.core.camera import project, transform
from hicp_lib.evaluation.space.stability import POSITION
from hicp_lib.recordings.recording import Recording, read_depth_m

# Minimum distance of an occluding surface in front of the mean of two markers: more than half the limb and
# its sleeve.
IN_FRONT_M = {"wrist": 0.06, "elbow": 0.09, "shoulder": 0.13}
_HALF_WINDOW_PX = 2


def joint_occlusion(recording: Recording, positions: pd.DataFrame) -> pd.DataFrame:
    """Distance from the camera, and occlusion by the depth image at each joint's pixel.

    Parameters
    ----------
    recording : Recording
        With depth.
    positions : DataFrame
        Columns `frame, keypoint` ("left_wrist", ...), `x_m, y_m, z_m` (base frame); NaN if unknown.

    Returns
    -------
    DataFrame
        A row for each of `positions`: columns `frame, keypoint, distance_m` (from the optical centre) and
        `sight`: "clear", "hidden" (the median depth of 5 x 5 pixels is more than `IN_FRONT_M` nearer),
        "outside" the image, "no depth" there, or "unknown" if the position is.
    """
    frames = positions["frame"].to_numpy()
    T_cam_base = np.linalg.inv(recording.T_base_cam)[frames]
    points_m = transform(T_cam_base, positions[POSITION].to_numpy(float)[:, None])[:, 0]
    margins_m = positions["keypoint"].str.split("_").str[1].map(IN_FRONT_M).to_numpy(float)
    pixels_px = project(recording.intrinsics, points_m)
    in_image = recording.intrinsics.contains(pixels_px)  # False for NaN (behind the camera)
    known = np.isfinite(points_m).all(axis=1)
    occlusions = np.where(known, "outside", "unknown").astype(object)
    for frame in np.unique(frames[in_image]):
        here = in_image & (frames == frame)
        u, v = pixels_px[here].round().astype(int).T
        padded_m = np.pad(read_depth_m(recording, int(frame)), _HALF_WINDOW_PX, constant_values=np.nan)
        windows_m = sliding_window_view(padded_m, (2 * _HALF_WINDOW_PX + 1,) * 2)[v, u]
        near_m = pd.DataFrame(windows_m.reshape(len(u), -1)).median(axis=1)  # over measured pixels
        is_hidden = near_m < points_m[here, 2] - margins_m[here]
        occlusions[here] = np.select([near_m.isna(), is_hidden], ["no depth", "hidden"], "clear")
    distances_m = np.linalg.norm(points_m, axis=1)
    return positions[["frame", "keypoint"]].assign(distance_m=distances_m, sight=occlusions)
