"""Where the robot holds its hand when nobody is near."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from hicp_lib.core.errors import InputError
from hicp_lib.robot.kinematics import ICub
from hicp_lib.robot.posture import Posture

HOME_M = {"left": (-0.30, -0.20, 0.05), "right": (-0.30, 0.20, 0.05)}
"""Places of the palms in the root frame in front of the robot (robotology/peripersonal-space, 2015)."""

_ELBOW_BENT_RAD = np.deg2rad([-25.0, 20.0, 0.0, 50.0, 0.0, 0.0, 0.0])


def home_posture(icub: ICub, side: str = "left", post_m: np.ndarray | None = None) -> Posture:
    """A posture with one palm at its post: torso and neck upright, the other arm bent at the elbow.

    Parameters
    ----------
    post_m : (3,) in the root frame; `HOME_M` when left out

    Raises
    ------
    InputError
        If the palm cannot get there within the limits of the joints without the torso's help.
    """
    post = np.array(HOME_M[side] if post_m is None else post_m, dtype=float)
    chain = icub.chains[side]

    def misses(arm_rad: np.ndarray) -> np.ndarray:
        q = np.concatenate([np.zeros(3), arm_rad])
        # The little weight of the posture chooses among the many that reach the post.
        return np.append(chain.T_root_link("hand", q)[:3, 3] - post, 1e-4 * (arm_rad - _ELBOW_BENT_RAD))

    # Away from the limits, where the controller slows joints down
    low, high = chain.limits_rad[3:].T
    margin = 0.05 * (high - low)
    found = least_squares(misses, _ELBOW_BENT_RAD, bounds=(low + margin, high - margin))
    if np.linalg.norm(misses(found.x)[:3]) > 1e-3:
        raise InputError(f"the {side} palm cannot be held at {post.tolist()} m; choose a nearer place")
    bent = Posture(np.zeros(3), np.zeros(3), _ELBOW_BENT_RAD, _ELBOW_BENT_RAD)
    return bent.moved(side, np.concatenate([np.zeros(3), found.x]))
