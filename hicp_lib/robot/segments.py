"""The robot's body as capsules, its links' poses, and a filter for points on the robot itself.

Ends are origins of links; radii are approximate. The robot's camera sees its arms, and detectors find people
in them. The robot's appearance is in `hicp_lib.robot.shape`.
"""

from typing import NamedTuple

import numpy as np

from hicp_lib.robot.kinematics import ICub
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.tables import read_tables

_TIPS_M = 0.075  # from the origin of the hand's link along its x axis to the fingertips


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
    return [
        Segment(part, origin_m[start], origin_m[end], radius_m)
        for part, start, end, radius_m in read_tables().capsules
    ]


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
        By chain and link, such as "left forearm"; also "root" and "camera".
    """
    poses = {"root": np.eye(4), "camera": icub.T_root_camera(posture.angles("head"), mount)}
    for chain in ("head", "left", "right"):
        links = icub.chains[chain].T_root_links(posture.angles(chain))
        poses |= {f"{chain} {link}": T for link, T in links.items()}
    return poses


MARGIN_M = 0.02
"""Distance from the robot's surface up to which points count as on it, to allow for depth errors."""


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
    """Remove points on the robot's own body.

    Parameters
    ----------
    icub : ICub
    posture : Posture
    points_m : array, shape (..., 3)
        In the root frame.
    margin_m : float, optional
        Points closer to the body than this are removed.

    Returns
    -------
    array, shape (..., 3)
        NaN for removed points.
    """
    is_self = self_distance_m(icub, posture, points_m) < margin_m
    return np.where(is_self[..., None], np.nan, points_m)
