"""The robot's body as thick lines, and where its links are.

Ends are origins of links; thicknesses are rough. What the robot looks like: `hicp_lib.robot.shape`.
"""

from typing import NamedTuple

import numpy as np

from hicp_lib.robot.kinematics import ICub
from hicp_lib.robot.posture import Posture

_TIPS_M = 0.075  # from the origin of the hand's link along its x axis to the fingertips
_ARM = (
    ("upper_arm", "shoulder_pitch", "upper_arm", 0.035),
    ("forearm", "elbow", "forearm", 0.03),
    ("hand", "forearm", "hand", 0.025),
    ("fingers", "hand", "tips", 0.036),
)
_CAPSULES = (
    ("torso", "root", "head torso", 0.07),
    ("shoulders", "left shoulder_pitch", "right shoulder_pitch", 0.05),
    ("neck", "head torso", "head neck_roll", 0.03),
    ("head", "head neck_roll", "head head", 0.06),
    *((f"{s}_{part}", f"{s} {a}", f"{s} {b}", r_m) for s in ("left", "right") for part, a, b, r_m in _ARM),
)
"""Part, chain and link where it begins and where it ends, radius in metres; fingers with the thumb."""


class Segment(NamedTuple):
    """A capsule in the root frame.

    Attributes
    ----------
    part : str
        "torso", "shoulders", "neck", "head", "left_upper_arm", "left_forearm", "left_hand",
        "left_fingers", ...
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
        Twelve, torso first.

    Examples
    --------
    >>> from hicp_lib.robot.kinematics import load_icub
    >>> [segment.part for segment in body_segments(load_icub(), Posture())][:5]
    ['torso', 'shoulders', 'neck', 'head', 'left_upper_arm']
    """
    poses = link_poses(icub, posture)
    origin_m = {link: T[:3, 3] for link, T in poses.items()}
    for side in ("left", "right"):
        origin_m[f"{side} tips"] = origin_m[f"{side} hand"] + _TIPS_M * poses[f"{side} hand"][:3, 0]
    return [Segment(part, origin_m[start], origin_m[end], radius) for part, start, end, radius in _CAPSULES]


def link_poses(icub: ICub, posture: Posture, mount: str = "tilted") -> dict[str, np.ndarray]:
    """Poses of all links in the root frame.

    Parameters
    ----------
    icub : ICub
    posture : Posture
    mount : str, optional
        Holder of the camera on the head.

    Returns
    -------
    dict of str to array, shape (4, 4)
        By chain and link, such as "left forearm"; "root" and "camera" are their own.
    """
    poses = {"root": np.eye(4), "camera": icub.T_root_camera(posture.angles("head"), mount)}
    for chain in ("head", "left", "right"):
        links = icub.chains[chain].T_root_links(posture.angles(chain))
        poses |= {f"{chain} {link}": T for link, T in links.items()}
    return poses
