"""Joint angles as a lab's iCub reports them: degrees, per motor board, the torso in reverse order.

The torso's board counts yaw, roll, pitch (joints 0, 1, 2); kinematics go pitch, roll, yaw. The head's
board reports neck pitch, neck roll, neck yaw, then eyes tilt, version and vergence; an arm's board seven
arm joints, then those of the fingers. Source: the robot's documentation and iKin (data/README.md).
"""

import numpy as np
from numpy.typing import ArrayLike

from hicp_lib.core.errors import InputError
from hicp_lib.robot.tables import read_tables

TOLERANCE_DEG = 5.0  # robots overshoot their limits a little; a swapped order or radians go beyond


def from_motor_order(torso_deg: ArrayLike, limb_deg: ArrayLike, joints: tuple[str, ...]) -> np.ndarray:
    """Angles of a chain from the boards of the torso and of head or arm.

    Parameters
    ----------
    torso_deg : array, shape (..., 3)
        Yaw, roll, pitch.
    limb_deg : array, shape (..., n - 3 or more)
        Neck pitch, roll, yaw, or the arm's seven; further ones (eyes, fingers) are ignored.
    joints : tuple of str
        The chain's n, `HEAD_JOINTS` or `ARM_JOINTS` of `hicp_lib.robot.kinematics`.

    Returns
    -------
    array, shape (..., n)
        Radians.

    Raises
    ------
    InputError
        For angles that are not finite, or that the robot cannot have: usually another order or unit.

    Examples
    --------
    >>> from hicp_lib.robot.kinematics import HEAD_JOINTS
    >>> np.rad2deg(from_motor_order([30, 20, 10], [1, 2, 3, 0, 0, 0], HEAD_JOINTS)).round(9)
    array([10., 20., 30.,  1.,  2.,  3.])
    """
    torso, limb = np.asarray(torso_deg, dtype=float), np.asarray(limb_deg, dtype=float)
    n_limb = len(joints) - 3
    if torso.shape[-1:] != (3,) or limb.ndim != torso.ndim or limb.shape[-1] < n_limb:
        expected = f"expected rows of 3 (torso: yaw, roll, pitch) and of {n_limb} or more"
        shapes = f"joint angles of shapes {torso.shape} and {limb.shape}"
        raise InputError(f"{shapes}: {expected}; give as many rows of both")
    angles = np.concatenate([torso[..., ::-1], limb[..., :n_limb]], axis=-1)
    limits_deg = np.rad2deg([read_tables().limits_rad["table"][joint] for joint in joints])
    low_deg, high_deg = (limits_deg + (-TOLERANCE_DEG, TOLERANCE_DEG)).T
    possible = (angles >= low_deg) & (angles <= high_deg)
    if not possible.all():
        row, column = np.argwhere(~possible.reshape(-1, len(joints)))[0]
        low, high = limits_deg[column]
        wrong = f"{angles.reshape(-1, len(joints))[row, column]:g} degrees, expected {low:g} to {high:g}"
        hint = "give degrees, the torso as yaw, roll, pitch"
        raise InputError(f"joint angles: row {row}, {joints[column]}: {wrong}; {hint}")
    return np.deg2rad(angles)
