"""Leaving out what is the robot itself: its camera sees its own arms, and detectors find people in them."""

import numpy as np

from hicp_lib.robot.kinematics import ICub
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.segments import body_segments

MARGIN_M = 0.02
"""How far from the robot's surface a point still counts as on it: errors of depth and of the calibration."""


def self_distance_m(icub: ICub, posture: Posture, points_m: np.ndarray) -> np.ndarray:
    """Distances of points from the robot's body.

    Parameters
    ----------
    icub : ICub
    posture : Posture
    points_m : array, shape (..., 3)
        In the root frame.

    Returns
    -------
    array, shape (...)
        Metres, negative inside; NaN where a point is.

    Examples
    --------
    >>> from hicp_lib.robot.kinematics import load_icub
    >>> self_distance_m(load_icub(), Posture(), np.array([[0.0, 0.0, 0.1], [0.3, 0.0, 0.1]])).round(2)
    array([-0.07,  0.23])
    """
    nearest_m = np.full(np.shape(points_m)[:-1], np.inf)
    for segment in body_segments(icub, posture):
        along_m = segment.end_m - segment.start_m
        from_start_m = points_m - segment.start_m
        share = np.clip(from_start_m @ along_m / max(along_m @ along_m, 1e-12), 0, 1)
        gap_m = np.linalg.norm(from_start_m - share[..., None] * along_m, axis=-1) - segment.radius_m
        nearest_m = np.minimum(nearest_m, gap_m)
    return nearest_m


def filter_self(icub: ICub, posture: Posture, points_m: np.ndarray, margin_m: float = MARGIN_M) -> np.ndarray:
    """The points that are not the robot's own body.

    Parameters
    ----------
    icub : ICub
    posture : Posture
    points_m : array, shape (..., 3)
        In the root frame.
    margin_m : float, optional
        What is nearer to the body is taken for it.

    Returns
    -------
    array, shape (..., 3)
        NaN for those that are.
    """
    is_self = self_distance_m(icub, posture, points_m) < margin_m
    return np.where(is_self[..., None], np.nan, points_m)
