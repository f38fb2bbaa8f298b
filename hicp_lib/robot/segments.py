"""The robot's body as thick lines, for drawing it in 3D and for telling it from people.

Ends are origins of links; thicknesses are rough, to be looked at, not measured with.
"""

from typing import NamedTuple

import numpy as np

from hicp_lib.robot.kinematics import ICub
from hicp_lib.robot.posture import Posture

_UPPER_ARM_M, _FOREARM_M, _HAND_M = 0.035, 0.03, 0.025
_CAPSULES = (
    ("torso", "root", "head torso", 0.07),
    ("shoulders", "left shoulder_pitch", "right shoulder_pitch", 0.05),
    ("neck", "head torso", "head neck_roll", 0.03),
    ("head", "head neck_roll", "head head", 0.06),
    ("left_upper_arm", "left shoulder_pitch", "left upper_arm", _UPPER_ARM_M),
    ("left_forearm", "left elbow", "left forearm", _FOREARM_M),
    ("left_hand", "left forearm", "left hand", _HAND_M),
    ("right_upper_arm", "right shoulder_pitch", "right upper_arm", _UPPER_ARM_M),
    ("right_forearm", "right elbow", "right forearm", _FOREARM_M),
    ("right_hand", "right forearm", "right hand", _HAND_M),
)
"""Part, chain and link where it begins and where it ends, radius in metres."""


class Segment(NamedTuple):
    """A capsule in the root frame.

    Attributes
    ----------
    part : str
        "torso", "shoulders", "neck", "head", "left_upper_arm", "left_forearm", "left_hand", ...
    start_m, end_m : array, shape (3,)
    radius_m : float
    """

    part: str
    start_m: np.ndarray
    end_m: np.ndarray
    radius_m: float


def body_segments(icub: ICub, posture: Posture) -> list[Segment]:
    """Torso, neck, head and arms.

    Parameters
    ----------
    icub : ICub
    posture : Posture

    Returns
    -------
    list of Segment
        Ten, torso first.

    Examples
    --------
    >>> from hicp_lib.robot.kinematics import load_icub
    >>> [segment.part for segment in body_segments(load_icub(), Posture())][:5]
    ['torso', 'shoulders', 'neck', 'head', 'left_upper_arm']
    """
    origin_m = {"root": np.zeros(3)}
    for chain in ("head", "left", "right"):
        poses = icub.chains[chain].T_root_links(posture.angles(chain))
        origin_m |= {f"{chain} {link}": T[:3, 3] for link, T in poses.items()}
    return [Segment(part, origin_m[start], origin_m[end], radius) for part, start, end, radius in _CAPSULES]
