"""The robot's body as thick lines, for drawing it in 3D.

Ends are origins of links; thicknesses are rough, to be looked at, not measured with.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hicp_lib.robot.kinematics import ARM_JOINTS, HEAD_JOINTS, TORSO_JOINTS, ICub


class Segment(NamedTuple):
    """A capsule in the root frame."""

    part: str  # "torso", "shoulders", "neck", "head", "left_upper_arm", "left_forearm", "left_hand", ...
    start_m: np.ndarray  # (3,)
    end_m: np.ndarray  # (3,)
    radius_m: float


def body_segments(
    icub: ICub,
    head_rad: np.ndarray | None = None,
    left_rad: np.ndarray | None = None,
    right_rad: np.ndarray | None = None,
) -> list[Segment]:
    """Torso, neck, head and arms at the given angles.

    Parameters
    ----------
    head_rad : (6,) angles of the torso and the neck, `HEAD_JOINTS`; zero when left out
    left_rad, right_rad : (10,) angles of torso and arm, `ARM_JOINTS`; an arm left out hangs down from the
        torso as `head_rad` has it

    Returns
    -------
    ten segments, torso first
    """
    head = np.zeros(len(HEAD_JOINTS)) if head_rad is None else np.asarray(head_rad, dtype=float)
    hanging = np.zeros(len(ARM_JOINTS))
    hanging[:3] = head[: len(TORSO_JOINTS)]
    neck = _origins(icub, "head", head)
    arms = {
        side: _origins(icub, side, hanging if angles is None else angles)
        for side, angles in (("left", left_rad), ("right", right_rad))
    }
    segments = [
        Segment("torso", np.zeros(3), neck["torso"], 0.07),
        Segment("shoulders", arms["left"]["shoulder_pitch"], arms["right"]["shoulder_pitch"], 0.05),
        Segment("neck", neck["torso"], neck["neck_roll"], 0.03),
        Segment("head", neck["neck_roll"], neck["head"], 0.06),
    ]
    for side, at in arms.items():
        segments += [
            Segment(f"{side}_upper_arm", at["shoulder_pitch"], at["upper_arm"], 0.035),
            Segment(f"{side}_forearm", at["elbow"], at["forearm"], 0.03),
            Segment(f"{side}_hand", at["forearm"], at["hand"], 0.025),
        ]
    return segments


def _origins(icub: ICub, chain: str, q_rad: np.ndarray) -> dict[str, np.ndarray]:
    return {link: T[:3, 3] for link, T in icub.chains[chain].T_root_links(q_rad).items()}
