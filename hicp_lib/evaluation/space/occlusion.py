"""How the camera stands to a joint: how far it is, and whether something is in front of it.

Both come from motion capture and the depth image, so any recording has them.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from hicp_lib.core.camera import project, transform
from hicp_lib.recordings.recording import Recording, read_depth_m

SIGHTS = ("clear", "hidden", "outside", "no depth", "unknown")
# How far in front of the middle between two markers something must be to hide the joint: more than half
# the limb and its sleeve.
IN_FRONT_M = {"wrist": 0.06, "elbow": 0.09, "shoulder": 0.13}
_HALF_WINDOW_PX = 2
_POSITION = ["x_m", "y_m", "z_m"]


def lines_of_sight(recording: Recording, positions: pd.DataFrame) -> pd.DataFrame:
    """Distance from the camera, and what the depth image has at each joint's pixel.

    Parameters
    ----------
    positions : columns `frame, keypoint` ("left_wrist", ...), `x_m, y_m, z_m` (base frame); NaN where
        not known

    Returns
    -------
    DataFrame, a row for each of `positions`: columns `frame, keypoint, distance_m` (from the optical
    centre) and `sight`: "clear", "hidden" (the median depth of 5 x 5 pixels is more than
    `IN_FRONT_M` nearer), "outside" the image, "no depth" there, or "unknown" where the position is
    """
    frames = positions["frame"].to_numpy()
    T_cam_base = np.linalg.inv(recording.T_base_cam)[frames]
    points_m = transform(T_cam_base, positions[_POSITION].to_numpy(float)[:, None])[:, 0]
    margins_m = positions["keypoint"].str.split("_").str[1].map(IN_FRONT_M).to_numpy(float)
    known = np.isfinite(points_m).all(axis=1)
    sights = np.full(len(positions), "unknown", dtype=object)
    for frame in np.unique(frames[known]):
        here = known & (frames == frame)
        sights[here] = _sights(points_m[here], margins_m[here], recording, int(frame))
    distances_m = np.linalg.norm(points_m, axis=1)
    return positions[["frame", "keypoint"]].assign(distance_m=distances_m, sight=sights)


def _sights(points_m: np.ndarray, margins_m: np.ndarray, recording: Recording, frame: int) -> list[str]:
    depth_m = read_depth_m(recording, frame)
    pixels_px = project(recording.intrinsics, points_m)
    sights = []
    in_image = recording.intrinsics.contains(pixels_px)  # not where NaN: behind the camera
    for (u, v), there, furthest_m in zip(pixels_px, in_image, points_m[:, 2] - margins_m, strict=True):
        if not there:
            sights.append("outside")
            continue
        row, column, half = round(v), round(u), _HALF_WINDOW_PX
        window = depth_m[max(row - half, 0) : row + half + 1, max(column - half, 0) : column + half + 1]
        near_m = np.median(window[np.isfinite(window)]) if np.isfinite(window).any() else np.nan
        sights.append("no depth" if np.isnan(near_m) else "hidden" if near_m < furthest_m else "clear")
    return sights
