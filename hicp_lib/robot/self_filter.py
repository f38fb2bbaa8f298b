"""Leaving out what is the robot itself: its camera sees its own arms, and detectors find people in them."""

from __future__ import annotations

import numpy as np

from hicp_lib.robot.kinematics import ICub
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.segments import body_segments

MARGIN_M = 0.02
"""How far from the robot's surface a point still counts as on it: errors of depth and of the calibration."""


def own_body_distance_m(icub: ICub, posture: Posture, points_m: np.ndarray) -> np.ndarray:
    """Distances (...) of points (..., 3), root frame, from the robot's body; negative inside, NaN stays."""
    chains = (posture.angles(name) for name in ("head", "left", "right"))
    nearest = np.full(np.shape(points_m)[:-1], np.inf)
    for segment in body_segments(icub, *chains):
        along = segment.end_m - segment.start_m
        from_start = points_m - segment.start_m
        share = np.clip(from_start @ along / max(along @ along, 1e-12), 0, 1)
        gap = np.linalg.norm(from_start - share[..., None] * along, axis=-1) - segment.radius_m
        nearest = np.minimum(nearest, gap)
    return nearest


def without_own_body(
    icub: ICub, posture: Posture, points_m: np.ndarray, margin_m: float = MARGIN_M
) -> np.ndarray:
    """The points, NaN for those within a margin of the robot's own body."""
    own = own_body_distance_m(icub, posture, points_m) < margin_m
    return np.where(own[..., None], np.nan, points_m)
