"""The rest posture and the hand's target position (post)."""

import numpy as np
from scipy.optimize import least_squares

from hicp_lib.core.errors import InputError
from hicp_lib.robot.kinematics import ICub
from hicp_lib.robot.posture import Posture

HOME_M = {"left": (-0.30, -0.20, 0.05), "right": (-0.30, 0.20, 0.05)}
"""Positions of the palms in the root frame in front of the robot (robotology/peripersonal-space, 2015)."""

_REACHED_M = 1e-3
_POSTURE_WEIGHT = 1e-4  # metres per radian: small, to select among the many postures that reach the post
_MARGIN = 0.05  # fraction of a joint's range next to its limits, where the controller slows it down
_ELBOW_BENT_RAD = np.deg2rad([-25.0, 20.0, 0.0, 50.0, 0.0, 0.0, 0.0])


def home_posture(icub: ICub, side: str = "left", post_m: np.ndarray | None = None) -> Posture:
    """A posture with one palm at its post: torso and neck upright, the other arm bent at the elbow.

    Parameters
    ----------
    icub : ICub
    side : str, optional
        "left" or "right".
    post_m : array, shape (3,), optional
        In the root frame; by default `HOME_M`.

    Returns
    -------
    Posture

    Raises
    ------
    InputError
        If the palm cannot reach it within the joint limits with an upright torso.

    Examples
    --------
    >>> from hicp_lib.robot.kinematics import load_icub
    >>> icub = load_icub()
    >>> icub.chains["left"].T_root_link("hand", home_posture(icub).angles("left"))[:3, 3].round(2)
    array([-0.3 , -0.2 ,  0.05])
    """
    post = np.array(HOME_M[side] if post_m is None else post_m, dtype=float)
    chain = icub.chains[side]

    def misses(arm_rad: np.ndarray) -> np.ndarray:
        q = np.concatenate([np.zeros(3), arm_rad])
        palm_m = chain.T_root_link("hand", q)[:3, 3]
        return np.append(palm_m - post, _POSTURE_WEIGHT * (arm_rad - _ELBOW_BENT_RAD))

    low, high = chain.limits_rad[3:].T
    margin = _MARGIN * (high - low)
    found = least_squares(misses, _ELBOW_BENT_RAD, bounds=(low + margin, high - margin))
    if np.linalg.norm(misses(found.x)[:3]) > _REACHED_M:
        raise InputError(f"the {side} palm cannot be held at {post.tolist()} m; choose a nearer position")
    bent = Posture(left_rad=_ELBOW_BENT_RAD, right_rad=_ELBOW_BENT_RAD)
    return bent.moved(side, np.concatenate([np.zeros(3), found.x]))
