"""Anatomical joint angles and the corresponding rotations of bones.

A `Joints` maps joint names to radians, all zero in the body model's reference stance (see
`body`): standing at attention, arms hanging, palms to the thighs. Joints of a limb are named
`left_...` or `right_...`; positive is flexion (for the ankle: toes down), abduction (away from the
middle), inward rotation (the toes or the bent forearm turn to the middle), supination (the hanging
palm turns forward), deviation towards the thumb, a turn or bend to the person's left.
"""

from collections.abc import Mapping

import numpy as np

from hicp_lib.core.memo import memoised
from hicp_lib.core.rotations import about, rotation
from hicp_lib.simulation.body.identities import PEOPLE
from hicp_lib.simulation.body.model import Pose

Joints = dict[str, float]

FINGERS = ("index", "middle", "ring", "little")

_LIMBS = {limb: tuple(ranges) for limb, ranges in PEOPLE["limb_joints_deg"].items()}
LIMITS_DEG: dict[str, tuple[float, float]] = PEOPLE["trunk_joints_deg"] | {
    f"{side}_{joint}": limits
    for side in ("left", "right")
    for ranges in PEOPLE["limb_joints_deg"].values()
    for joint, limits in ranges.items()
}
"""Range of every joint in degrees: the normal ranges of the American Academy of Orthopaedic
Surgeons (Joint Motion: Method of Measuring and Recording, 1965), where it gives one; thumb, finger
spread and eyes are estimates."""

# How a movement is distributed over several bones, from the first to the last.
_SHARES = PEOPLE["movement_shares"]
# The shoulder girdle moves with an arm raised beyond this.
_GIRDLE_FROM_RAD = np.radians(25.0)
# Left limbs in the reference stance: tilt and direction of the arm, and the hinge the thumb bends about.
ARM_TILT_RAD = np.radians(9.0)
HANGING = about(0, ARM_TILT_RAD) @ np.array([0.0, 0.0, -1.0])
_THUMB_HINGE = np.array([0.61, 0.77, -0.18])
# Rotations seen in a mirror between left and right: factors of a matrix's elements.
_MIRROR = np.array([[1.0, -1, 1], [-1, 1, -1], [1, -1, 1]])


def radians(angles_deg: Mapping[str, float], prefix: str = "") -> Joints:
    """Joint angles in radians from degrees; `prefix` goes before their names."""
    return {prefix + name: float(np.radians(angle)) for name, angle in angles_deg.items()}


def within_limits(angles: Joints, margin_rad: float = 1e-9) -> bool:
    """Whether every joint lies in its range, see `LIMITS_DEG`.

    Raises
    ------
    KeyError
        For a joint that does not exist.

    Examples
    --------
    >>> within_limits({"left_elbow_flexion": 1.5}), within_limits({"left_elbow_flexion": -0.5})
    (True, False)
    """
    limits = {name: np.radians(LIMITS_DEG[name]) for name in angles}
    return all(low - margin_rad <= angles[name] <= high + margin_rad for name, (low, high) in limits.items())


def pose_from_joints(angles: Joints) -> Pose:
    """Rotations of the bones; joints left out stay at zero.

    Parameters
    ----------
    angles : mapping of str to float
        Joint angles in radians, by the names in `LIMITS_DEG`.

    Returns
    -------
    dict of str to array
        By bone, as `pose_body` takes them.

    Raises
    ------
    KeyError
        For a joint that does not exist.

    Examples
    --------
    >>> pose_from_joints({"spine_turn": 1.0})["spine03"]
    array([-0.  ,  0.  ,  0.25])
    """
    unknown = sorted(set(angles) - set(LIMITS_DEG))
    if unknown:
        raise KeyError(f"no joint {unknown[0]!r}")
    pose = _trunk(angles)
    for side in ("left", "right"):
        for limb, joints in _LIMBS.items():
            pose |= _limb(limb, side, tuple([angles.get(f"{side}_{joint}", 0.0) for joint in joints]))
    return pose


@memoised(256)  # during the search for a pose, most limbs do not change
def _limb(name: str, side: str, angles: tuple[float, ...]) -> dict[str, np.ndarray]:
    """Rotations of a limb's bones by the angles of its joints, in the order of `_LIMBS`."""
    turns = _BONES[name](dict(zip(_LIMBS[name], angles, strict=True)))
    matrices = {bone: turn if turn.ndim == 2 else rotation(turn) for bone, turn in turns.items()}
    if side == "left":
        return {f"{bone}.L": matrix for bone, matrix in matrices.items()}
    return {f"{bone}.R": matrix * _MIRROR for bone, matrix in matrices.items()}


def shoulder_rotation(flexion: float, abduction: float, inward: float) -> np.ndarray:
    """Rotation of the left upper arm from hanging, relative to the trunk, from its angles.

    Parameters
    ----------
    flexion, abduction, inward : float
        Radians; the arm first turns inward about itself, then is abducted, then flexed.

    Returns
    -------
    array, shape (3, 3)
    """
    tilt = ARM_TILT_RAD
    return about(1, -flexion) @ about(0, abduction + tilt) @ about(2, -inward) @ about(0, -tilt)


def shoulder_angles(swing: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Flexion, abduction and inward rotation (radians) of rotations (..., 3, 3) of the left upper arm.

    Each has shape (...). The inverse of `shoulder_rotation` for abduction between -99 and 81 degrees; beyond,
    the other of the two descriptions of the same rotation is returned.
    """
    m = swing @ about(0, ARM_TILT_RAD)
    abduction = np.arcsin(np.clip(-m[..., 1, 2], -1, 1)) - ARM_TILT_RAD
    return -np.arctan2(m[..., 0, 2], m[..., 2, 2]), abduction, -np.arctan2(m[..., 1, 0], m[..., 1, 1])


def _trunk(angles: Joints) -> dict[str, np.ndarray]:
    def vector(part: str) -> np.ndarray:
        bend, flexion, turn = (angles.get(f"{part}_{kind}", 0.0) for kind in ("bend", "flexion", "turn"))
        return np.array([-bend, flexion, turn])

    pose = {bone: share * vector("spine") for bone, share in _SHARES["spine"].items()}
    pose |= {bone: share * vector("neck") for bone, share in _SHARES["neck"].items()}
    eye = np.array([0.0, angles.get("eye_pitch", 0.0), angles.get("eye_turn", 0.0)])
    return pose | {"eye.L": eye, "eye.R": eye}


def _arm(limb: dict[str, float]) -> dict[str, np.ndarray]:
    """A left arm. Rotation about its own axis is distributed along it, so that the skin twists evenly."""
    turn = limb["shoulder_rotation"] * HANGING
    swing = shoulder_rotation(limb["shoulder_flexion"], limb["shoulder_abduction"], 0.0)
    girdle, upper = _with_girdle(swing)
    supination = -limb["forearm_supination"] * HANGING
    hand = about(1, -limb["wrist_deviation"]) @ about(0, -limb["wrist_flexion"])
    return girdle | {
        "upperarm01": upper @ rotation(turn / 2),
        "upperarm02": turn / 2,
        "lowerarm01": np.array([0.0, -limb["elbow_flexion"], 0.0]),
        "lowerarm02": supination / 2,
        "wrist": rotation(supination / 2) @ hand,
    }


def _with_girdle(swing: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Split an arm's swing into the part of collar bone and shoulder blade, and the rest for the arm."""
    axis = np.array([swing[2, 1] - swing[1, 2], swing[0, 2] - swing[2, 0], swing[1, 0] - swing[0, 1]])
    length = np.linalg.norm(axis)
    angle = np.arctan2(length, np.trace(swing) - 1)
    if angle <= _GIRDLE_FROM_RAD or length < 1e-9:
        return {}, swing
    beyond = axis / length * (angle - _GIRDLE_FROM_RAD)
    girdle = {bone: share * beyond for bone, share in _SHARES["girdle"].items()}
    # All rotate about the same axis, so the parts add up.
    return girdle, rotation(-sum(_SHARES["girdle"].values()) * beyond) @ swing


def _hand(limb: dict[str, float]) -> dict[str, np.ndarray]:
    pose = {}
    for number, finger in enumerate(FINGERS, start=2):
        # Fingers spread away from the middle one; at the knuckle both movements combine.
        outward = -limb[f"{finger}_spread"] if finger in ("index", "middle") else limb[f"{finger}_spread"]
        knuckle = about(1, outward) @ about(0, -limb[f"{finger}_knuckle"])
        pose[f"finger{number}-1"] = knuckle
        pose[f"finger{number}-2"] = np.array([-limb[f"{finger}_middle"], 0.0, 0.0])
        pose[f"finger{number}-3"] = np.array([-limb[f"{finger}_end"], 0.0, 0.0])
    pose["finger1-1"] = about(2, limb["thumb_spread"]) @ rotation(limb["thumb_base"] * _THUMB_HINGE)
    pose["finger1-2"] = limb["thumb_knuckle"] * _THUMB_HINGE
    pose["finger1-3"] = limb["thumb_end"] * _THUMB_HINGE
    return pose


def _leg(limb: dict[str, float]) -> dict[str, np.ndarray]:
    turned = about(0, limb["hip_abduction"]) @ about(2, -limb["hip_rotation"])
    return {
        "upperleg01": about(1, -limb["hip_flexion"]) @ turned,
        "lowerleg01": np.array([0.0, limb["knee_flexion"], 0.0]),
        "foot": np.array([0.0, limb["ankle_flexion"], 0.0]),
    }


_BONES = {"arm": _arm, "hand": _hand, "leg": _leg}
