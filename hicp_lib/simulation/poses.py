"""Poses of people near a robot, drawn within the limits of their joints.

A pose is put together from legs and trunk, arms and hands. Angles are drawn from ranges in
degrees, arms that go to a place are solved by `reach`, and a pose in which the body runs through
itself is drawn again with more room for the arms.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hicp_lib.simulation.body import Body, Pose, pose_bones
from hicp_lib.simulation.clearance import Outline, clearance_m, outline
from hicp_lib.simulation.joints import FINGERS, LIMITS_DEG, pose_from_joints, within_limits
from hicp_lib.simulation.reach import reach

Ranges = dict[str, tuple[float, float]]
Joints = dict[str, float]

_N_TRIES = 30
_ROOM_STEP_M = 0.006  # arms keep this much further from the body with every try
_PENETRATION_M = 0.02  # skin and clothes give way this far

_TRUNK_DEG: Ranges = {
    "spine_flexion": (-4, 8), "spine_bend": (-4, 4), "spine_turn": (-8, 8),
    "neck_flexion": (-10, 14), "neck_bend": (-8, 8), "neck_turn": (-22, 22),
    "eye_pitch": (-8, 8), "eye_turn": (-15, 15),
}  # fmt: skip
_STANDING_DEG: Ranges = {
    "hip_flexion": (-4, 8), "hip_abduction": (-1, 5), "hip_rotation": (-18, 2), "knee_flexion": (1, 10),
}  # fmt: skip
_SITTING_DEG: Ranges = {
    "hip_flexion": (78, 95), "hip_abduction": (0, 14), "hip_rotation": (-12, 5), "knee_flexion": (70, 100),
}  # fmt: skip
_HANGING_DEG: Ranges = {
    "shoulder_flexion": (-8, 14), "shoulder_abduction": (-2, 8), "shoulder_rotation": (0, 35),
    "elbow_flexion": (4, 35), "forearm_supination": (-35, 10),
    "wrist_flexion": (-5, 20), "wrist_deviation": (-10, 5),
}  # fmt: skip
_RAISED_DEG: tuple[Ranges, ...] = (
    {"shoulder_flexion": (100, 165), "shoulder_abduction": (-5, 20), "shoulder_rotation": (-10, 30),
     "elbow_flexion": (5, 70), "forearm_supination": (-60, 60)},
    {"shoulder_abduction": (85, 150), "shoulder_flexion": (0, 20), "shoulder_rotation": (-30, 30),
     "elbow_flexion": (5, 60), "forearm_supination": (-40, 60)},
    {"shoulder_abduction": (30, 75), "shoulder_flexion": (0, 30), "shoulder_rotation": (-90, -65),
     "elbow_flexion": (80, 130), "forearm_supination": (-70, -20)},
)  # fmt: skip

# Per hand: spread, knuckle, middle and end joint of the fingers, then the thumb's.
_FINGER_JOINTS = ("spread", "knuckle", "middle", "end")
_THUMB_JOINTS = ("thumb_base", "thumb_spread", "thumb_knuckle", "thumb_end")
HANDS_DEG: dict[str, tuple[tuple[float, float], ...]] = {
    "open": ((0, 7), (-8, 10), (0, 12), (0, 8), (-12, 5), (5, 35), (-5, 10), (-5, 15)),
    "relaxed": ((-2, 4), (12, 32), (15, 40), (8, 25), (0, 12), (5, 20), (0, 15), (5, 20)),
    "grip": ((-2, 3), (35, 55), (35, 60), (20, 40), (5, 25), (-5, 15), (5, 25), (5, 30)),
    "fist": ((-2, 2), (72, 88), (85, 99), (50, 72), (4, 14), (-24, -16), (22, 36), (25, 42)),
    "pointing": ((-2, 2), (65, 85), (80, 98), (45, 70), (15, 30), (-20, -5), (15, 35), (20, 45)),
    "spread": ((12, 19), (-14, 0), (0, 8), (0, 5), (-20, -5), (30, 48), (-10, 5), (-10, 10)),
}
"""Ranges of a hand's joints in degrees, of the fingers first, in the order of their joints."""
_STRAIGHT_INDEX_DEG = {"knuckle": (-5, 15), "middle": (0, 12), "end": (0, 8)}
_FINGER_JITTER_DEG = 4.0


def sample_pose(
    rng: np.random.Generator, body: Body, kind: str | None = None, shape: int | str | np.ndarray = 0
) -> Pose:
    """A random pose.

    Parameters
    ----------
    kind : one of `KINDS`; drawn as well when left out
    shape : whose pose it will be, as in `pose_body`; arms keep clear of that shape's body

    Raises
    ------
    ValueError
        For an unknown kind.
    """
    return pose_from_joints(sample_joints(rng, body, kind, shape))


def sample_joints(
    rng: np.random.Generator, body: Body, kind: str | None = None, shape: int | str | np.ndarray = 0
) -> Joints:
    """Joint angles (radians) of a random pose, within `joints.LIMITS_DEG`; see `sample_pose`."""
    kind = str(rng.choice(list(KINDS))) if kind is None else kind
    if kind not in KINDS:
        raise ValueError(f"no kind of pose {kind!r}; there are {', '.join(KINDS)}")
    person = outline(body, shape)
    best, best_gap_m = None, -np.inf
    for attempt in range(_N_TRIES):
        joints = _draw(rng, _Draft(body, person, attempt * _ROOM_STEP_M), kind)
        if joints is None or not within_limits(joints):
            continue
        gap_m = clearance_m(body, person, pose_from_joints(joints))
        if gap_m > best_gap_m:
            best, best_gap_m = joints, gap_m
        if gap_m > -_PENETRATION_M:
            break
    # Hardly ever needed: the pose that comes nearest to keeping clear, or none at all.
    return best if best is not None else _draw(rng, _Draft(body, person, 0.0), "standing")


def sample_hand(rng: np.random.Generator, kind: str) -> Joints:
    """Joint angles (radians) of one hand of a kind in `HANDS_DEG`, without the side's prefix."""
    fingers, thumb = HANDS_DEG[kind][:4], HANDS_DEG[kind][4:]
    joints = {}
    for joint, (low, high) in zip(_FINGER_JOINTS, fingers, strict=True):
        common = rng.uniform(low, high)
        for finger in FINGERS:
            straight = kind == "pointing" and finger == "index" and joint in _STRAIGHT_INDEX_DEG
            value = rng.uniform(*_STRAIGHT_INDEX_DEG[joint]) if straight else common
            if joint != "spread":
                value += rng.normal(0, _FINGER_JITTER_DEG)
            elif finger == "middle":
                value = 0.0
            joints[f"{finger}_{joint}"] = value
    joints |= {joint: rng.uniform(*limits) for joint, limits in zip(_THUMB_JOINTS, thumb, strict=True)}
    return {
        name: float(np.radians(np.clip(value, *LIMITS_DEG[f"left_{name}"]))) for name, value in joints.items()
    }


@dataclass(frozen=True)
class _Draft:
    """What drawing a pose needs to know: the body, its sizes, and how much room to give the arms."""

    body: Body
    person: Outline
    room_m: float


def _draw(rng: np.random.Generator, draft: _Draft, kind: str) -> Joints | None:
    """One draw of a kind, hands included; None where an arm cannot go where it should."""
    lower, arms, hands = KINDS[kind]
    joints = _uniform(rng, _TRUNK_DEG) | lower(rng)
    for side in ("left", "right"):
        hand = sample_hand(rng, str(rng.choice(hands)))
        joints |= {f"{side}_{name}": angle for name, angle in (_hanging(rng, draft) | hand).items()}
    return arms(rng, draft, joints)


def _uniform(rng: np.random.Generator, ranges: Ranges, prefix: str = "") -> Joints:
    return {prefix + name: float(np.radians(rng.uniform(*limits))) for name, limits in ranges.items()}


def _hanging(rng: np.random.Generator, draft: _Draft) -> Joints:
    joints = _uniform(rng, _HANGING_DEG)
    # An arm half a metre long: this angle moves its middle away by the room.
    joints["shoulder_abduction"] += draft.room_m / 0.25
    return joints


# Legs and trunk


def _stand(rng: np.random.Generator) -> Joints:
    joints = _uniform(rng, _STANDING_DEG, "left_") | _uniform(rng, _STANDING_DEG, "right_")
    return joints | _level_feet(joints)


def _walk(rng: np.random.Generator) -> Joints:
    joints = _stand(rng)
    swing = np.sin(rng.uniform(0, 2 * np.pi))
    for side, sign in (("left", 1), ("right", -1)):
        joints[f"{side}_hip_flexion"] = np.radians(6 + 24 * sign * swing)
        joints[f"{side}_knee_flexion"] = np.radians(rng.uniform(6, 14) + 14 * max(0, -sign * swing))
    joints["spine_turn"] = np.radians(6 * swing)
    return joints | _level_feet(joints)


def _sit(rng: np.random.Generator) -> Joints:
    joints = _uniform(rng, _SITTING_DEG, "left_") | _uniform(rng, _SITTING_DEG, "right_")
    return joints | _level_feet(joints) | _uniform(rng, {"spine_flexion": (-5, 22)})


def _lean(rng: np.random.Generator) -> Joints:
    return _stand(rng) | _uniform(rng, {"spine_flexion": (-2, 25), "neck_flexion": (-20, 8)})


def _level_feet(joints: Joints) -> Joints:
    """Ankles that keep the soles level, as far as they bend."""
    limits = np.radians(LIMITS_DEG["left_ankle_flexion"])
    return {
        f"{side}_ankle_flexion": float(
            np.clip(joints[f"{side}_hip_flexion"] - joints[f"{side}_knee_flexion"], *limits)
        )
        for side in ("left", "right")
    }


# Arms: each takes joints with both arms hanging and returns them with the arms where they should be


def _arms_hang(rng: np.random.Generator, draft: _Draft, joints: Joints) -> Joints:
    return joints


def _arms_swing(rng: np.random.Generator, draft: _Draft, joints: Joints) -> Joints:
    for side, other in (("left", "right"), ("right", "left")):
        joints[f"{side}_shoulder_flexion"] += 0.8 * joints[f"{other}_hip_flexion"] - np.radians(6)
    return joints


def _arm_reaches(rng: np.random.Generator, draft: _Draft, joints: Joints) -> Joints | None:
    return _to_the_front(rng, draft, joints, _side(rng), (-25, 30), (-40, 25), (0.7, 0.99))


def _arms_reach(rng: np.random.Generator, draft: _Draft, joints: Joints) -> Joints | None:
    first = _to_the_front(rng, draft, joints, "left", (-12, 25), (-40, 20), (0.7, 0.99))
    return first and _to_the_front(rng, draft, first, "right", (-12, 25), (-40, 20), (0.7, 0.99))


def _arm_points(rng: np.random.Generator, draft: _Draft, joints: Joints) -> Joints | None:
    side = _side(rng)
    other = sample_hand(rng, "relaxed")
    joints |= {f"{'right' if side == 'left' else 'left'}_{name}": angle for name, angle in other.items()}
    joints = _to_the_front(rng, draft, joints, side, (-20, 70), (-35, 45), (0.88, 0.99))
    straight = {"wrist_flexion": (-10, 8), "wrist_deviation": (-5, 5), "forearm_supination": (-70, 10)}
    return joints and joints | _uniform(rng, straight, f"{side}_")


def _to_the_front(
    rng, draft: _Draft, joints: Joints, side: str, azimuth_deg, elevation_deg, stretch
) -> Joints | None:
    """An arm towards a direction (azimuth outward from straight ahead), by a share of its length."""
    heads = _heads(draft, joints, side)
    chain = np.array([heads[bone] for bone in ("upperarm01", "lowerarm01", "wrist")])
    length = np.linalg.norm(np.diff(chain, axis=0), axis=1).sum()
    azimuth, elevation = (np.radians(rng.uniform(*limits)) for limits in (azimuth_deg, elevation_deg))
    outward = np.sin(azimuth) * (1 if side == "left" else -1)
    direction = np.array([np.cos(azimuth), outward, np.tan(elevation)])
    direction /= np.linalg.norm(direction)
    target = heads["upperarm01"] + rng.uniform(*stretch) * length * direction
    wrist = {"wrist_flexion": (-50, 15), "wrist_deviation": (-10, 10), "forearm_supination": (-75, 75)}
    joints = joints | _uniform(rng, wrist, f"{side}_")
    return reach(draft.body, draft.person.weights, joints, side, target, (0, rng.uniform(0.1, 0.9), -1))


def _arms_crossed(rng: np.random.Generator, draft: _Draft, joints: Joints) -> Joints | None:
    """Forearms before the chest, one before the other, each wrist near the other elbow."""
    under = _side(rng)
    centre, half = draft.person.trunk_at(rng.uniform(0.52, 0.62))
    thickness = 2 * draft.person.radii_m["forearm"]
    for side, layer in ((under, 1.1), ("right" if under == "left" else "left", 2.3)):
        sign = 1 if side == "left" else -1
        x = centre[0] + half[0] + layer * thickness + draft.room_m
        height = centre[2] + rng.uniform(0, 0.04) + (0.03 if side == under else 0.0)
        target = np.array([x, -sign * half[1] * rng.uniform(0.35, 0.7), height])
        wrist = {"wrist_flexion": (-5, 20), "forearm_supination": (-30, 10), "wrist_deviation": (-8, 8)}
        joints = joints | _uniform(rng, wrist, f"{side}_")
        joints = reach(draft.body, draft.person.weights, joints, side, target, (0.1, 0.7, -1))
        if joints is None:
            return None
    return joints


def _arms_raised(rng: np.random.Generator, draft: _Draft, joints: Joints) -> Joints:
    ranges = _RAISED_DEG[rng.integers(len(_RAISED_DEG))]
    sides = ("left", "right") if rng.random() < 0.5 else (_side(rng),)
    for side in sides:
        wrist = {"wrist_flexion": (-30, 20), "wrist_deviation": (-10, 10)}
        joints = joints | _uniform(rng, ranges | wrist, f"{side}_")
    return joints


def _hands_on_hips(rng: np.random.Generator, draft: _Draft, joints: Joints) -> Joints | None:
    for side in ("left", "right"):
        sign = 1 if side == "left" else -1
        centre, half = draft.person.trunk_at(rng.uniform(0.26, 0.34))
        target = centre + np.array([rng.uniform(-0.03, 0.02), sign * (half[1] + 0.045 + draft.room_m), 0.0])
        wrist = {"wrist_flexion": (25, 45), "wrist_deviation": (-8, 15), "forearm_supination": (-45, -15)}
        joints = joints | _uniform(rng, wrist, f"{side}_")
        joints = reach(draft.body, draft.person.weights, joints, side, target, (-0.4, 1, 0))
        if joints is None:
            return None
    return joints


def _hand_near_face(rng: np.random.Generator, draft: _Draft, joints: Joints) -> Joints | None:
    side = _side(rng)
    sign = 1 if side == "left" else -1
    head = _heads(draft, joints, side)["head"]
    centre, half = draft.person.centres_m[-1], draft.person.half_axes_m[-1]
    middle = head + centre - draft.person.bone_heads_m[-1]
    # From before the mouth to beside the ear; the hand, a face long, stands above the wrist.
    turn = np.radians(rng.uniform(15, 85))
    away = half[:2] + 0.07 + draft.room_m
    offset = (np.cos(turn) * away[0], sign * np.sin(turn) * away[1], -half[2] * rng.uniform(0.9, 1.4))
    wrist = {"wrist_flexion": (-15, 25), "wrist_deviation": (-8, 8), "forearm_supination": (-30, 60)}
    joints = joints | _uniform(rng, wrist, f"{side}_")
    return reach(draft.body, draft.person.weights, joints, side, middle + offset, (0.4, 0.5, -1))


def _hands_in_lap(rng: np.random.Generator, draft: _Draft, joints: Joints) -> Joints | None:
    for side in ("left", "right"):
        sign = 1 if side == "left" else -1
        heads = _heads(draft, joints, side)
        along = heads["upperleg01"] + rng.uniform(0.55, 0.8) * (heads["lowerleg01"] - heads["upperleg01"])
        above = draft.person.radii_m["thigh"] + draft.person.radii_m["forearm"] + 0.02 + draft.room_m
        wrist = {"wrist_flexion": (-5, 25), "wrist_deviation": (-5, 5), "forearm_supination": (-75, -50)}
        joints = joints | _uniform(rng, wrist, f"{side}_")
        target = along + np.array([0, -sign * rng.uniform(-0.02, 0.05), above])
        joints = reach(draft.body, draft.person.weights, joints, side, target, (-0.6, 0.6, -0.5))
        if joints is None:
            return None
    return joints


def _arms_of_any_kind(rng: np.random.Generator, draft: _Draft, joints: Joints) -> Joints | None:
    kinds = (_hands_in_lap, _hands_in_lap, _arm_reaches, _arms_reach, _arms_crossed, _hand_near_face)
    return kinds[rng.integers(len(kinds))](rng, draft, joints)


def _side(rng: np.random.Generator) -> str:
    return ("left", "right")[rng.integers(2)]


def _heads(draft: _Draft, joints: Joints, side: str) -> dict[str, np.ndarray]:
    """Where the bones of a side and of the middle begin, from the pelvis."""
    _, heads = pose_bones(draft.body, draft.person.weights, pose_from_joints(joints))
    end = "." + side[0].upper()
    return {name.removesuffix(end): heads[i] for i, name in enumerate(draft.body.bone_names)}


_CALM = ("relaxed", "relaxed", "open", "grip")
_ACTIVE = ("open", "open", "spread", "relaxed", "grip")

KINDS: dict[str, tuple[Callable, Callable, tuple[str, ...]]] = {
    "standing": (_stand, _arms_hang, (*_CALM, "fist")),
    "walking": (_walk, _arms_swing, (*_CALM, "fist")),
    "reaching": (_lean, _arm_reaches, _ACTIVE),
    "reaching_both": (_lean, _arms_reach, _ACTIVE),
    "pointing": (_stand, _arm_points, ("pointing",)),
    "crossed": (_stand, _arms_crossed, ("relaxed", "grip")),
    "raised": (_stand, _arms_raised, (*_ACTIVE, "fist")),
    "hips": (_stand, _hands_on_hips, ("relaxed", "open")),
    "face": (_stand, _hand_near_face, _CALM),
    "sitting": (_sit, _arms_of_any_kind, (*_CALM, *_ACTIVE)),
}
"""Kinds of poses: what draws legs and trunk, what places the arms, and kinds of hands."""
