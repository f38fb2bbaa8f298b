"""Where the arms go: each function takes joints with both arms hanging and places the arms.

They return None where the limits of the joints do not allow what was drawn; draw again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hicp_lib.simulation.body.hands import sample_hand
from hicp_lib.simulation.body.joints import pose_from_joints
from hicp_lib.simulation.body.model import Body, pose_bones
from hicp_lib.simulation.body.reach import reach
from hicp_lib.simulation.body.self_collision import Outline

Ranges = dict[str, tuple[float, float]]
Joints = dict[str, float]

_OTHER = {"left": "right", "right": "left"}

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
    {"shoulder_abduction": (50, 80), "shoulder_flexion": (0, 25), "shoulder_rotation": (-90, -75),
     "elbow_flexion": (85, 130), "forearm_supination": (-70, -20)},
)  # fmt: skip


@dataclass(frozen=True)
class Draft:
    """What drawing a pose needs to know: the body, its sizes, and how much room to give the arms."""

    body: Body
    person: Outline
    room_m: float


def uniform(rng: np.random.Generator, ranges: Ranges, prefix: str = "") -> Joints:
    """Joint angles (radians) drawn evenly from ranges in degrees; `prefix` goes before their names."""
    return {prefix + name: float(np.radians(rng.uniform(*limits))) for name, limits in ranges.items()}


def hanging_arm(rng: np.random.Generator, draft: Draft) -> Joints:
    """One arm hanging at ease, its joints without the prefix of a side."""
    joints = uniform(rng, _HANGING_DEG)
    # An arm half a metre long: this angle moves its middle away by the room.
    joints["shoulder_abduction"] += draft.room_m / 0.25
    return joints


def hanging(rng: np.random.Generator, draft: Draft, joints: Joints) -> Joints:
    """Both arms stay hanging."""
    return joints


def swinging(rng: np.random.Generator, draft: Draft, joints: Joints) -> Joints:
    """Arms swing against the legs, as in walking."""
    swung = {
        f"{side}_shoulder_flexion": joints[f"{side}_shoulder_flexion"]
        + 0.8 * joints[f"{other}_hip_flexion"]
        - np.radians(6)
        for side, other in _OTHER.items()
    }
    return joints | swung


def one_reaching(rng: np.random.Generator, draft: Draft, joints: Joints) -> Joints | None:
    """One arm reaches forward."""
    return _to_the_front(rng, draft, joints, _side(rng), (-25, 30), (-40, 25), (0.7, 0.99))


def both_reaching(rng: np.random.Generator, draft: Draft, joints: Joints) -> Joints | None:
    """Both arms reach forward."""
    left = _to_the_front(rng, draft, joints, "left", (-12, 25), (-40, 20), (0.7, 0.99))
    return left and _to_the_front(rng, draft, left, "right", (-12, 25), (-40, 20), (0.7, 0.99))


def pointing(rng: np.random.Generator, draft: Draft, joints: Joints) -> Joints | None:
    """One arm, nearly straight, points somewhere ahead or to its side; the other hand is at ease."""
    side = _side(rng)
    calm = {f"{_OTHER[side]}_{name}": angle for name, angle in sample_hand(rng, "relaxed").items()}
    joints = joints | calm
    joints = _to_the_front(rng, draft, joints, side, (-20, 70), (-35, 45), (0.88, 0.99))
    straight = {"wrist_flexion": (-10, 8), "wrist_deviation": (-5, 5), "forearm_supination": (-70, 10)}
    return joints and joints | uniform(rng, straight, f"{side}_")


def _to_the_front(
    rng, draft: Draft, joints: Joints, side: str, azimuth_deg, elevation_deg, stretch
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
    return _bring(rng, draft, joints, side, target, (0, rng.uniform(0.1, 0.9), -1), wrist)


def crossed(rng: np.random.Generator, draft: Draft, joints: Joints) -> Joints | None:
    """Forearms before the chest, one before the other, each wrist near the other elbow."""
    under = _side(rng)
    centre, half = draft.person.trunk_at(rng.uniform(0.52, 0.62))
    thickness = 2 * draft.person.radii_m["forearm"]
    for side, layer in ((under, 1.1), (_OTHER[under], 2.3)):
        sign = 1 if side == "left" else -1
        x = centre[0] + half[0] + layer * thickness + draft.room_m
        height = centre[2] + rng.uniform(0, 0.04) + (0.03 if side == under else 0.0)
        target = np.array([x, -sign * half[1] * rng.uniform(0.35, 0.7), height])
        wrist = {"wrist_flexion": (-5, 20), "forearm_supination": (-30, 10), "wrist_deviation": (-8, 8)}
        joints = _bring(rng, draft, joints, side, target, (0.1, 0.7, -1), wrist)
    return joints


def raised(rng: np.random.Generator, draft: Draft, joints: Joints) -> Joints:
    """One or both arms raised: forward, sideways, or with the forearms up."""
    ranges = _RAISED_DEG[rng.integers(len(_RAISED_DEG))]
    sides = ("left", "right") if rng.random() < 0.5 else (_side(rng),)
    for side in sides:
        wrist = {"wrist_flexion": (-30, 20), "wrist_deviation": (-10, 10)}
        joints = joints | uniform(rng, ranges | wrist, f"{side}_")
    return joints


def on_hips(rng: np.random.Generator, draft: Draft, joints: Joints) -> Joints | None:
    """Both hands on the hips, elbows out."""
    for side in ("left", "right"):
        sign = 1 if side == "left" else -1
        centre, half = draft.person.trunk_at(rng.uniform(0.26, 0.34))
        target = centre + np.array([rng.uniform(-0.03, 0.02), sign * (half[1] + 0.045 + draft.room_m), 0.0])
        wrist = {"wrist_flexion": (25, 45), "wrist_deviation": (-8, 15), "forearm_supination": (-45, -15)}
        joints = _bring(rng, draft, joints, side, target, (-0.4, 1, 0), wrist)
    return joints


def near_face(rng: np.random.Generator, draft: Draft, joints: Joints) -> Joints | None:
    """One hand near the face, from before the mouth to beside the ear."""
    side = _side(rng)
    sign = 1 if side == "left" else -1
    head = _heads(draft, joints, side)["head"]
    centre, half = draft.person.centres_m[-1], draft.person.half_axes_m[-1]
    middle = head + centre - draft.person.bone_heads_m[-1]
    # The hand, a face long, stands above the wrist.
    turn = np.radians(rng.uniform(15, 85))
    away = half[:2] + 0.07 + draft.room_m
    offset = (np.cos(turn) * away[0], sign * np.sin(turn) * away[1], -half[2] * rng.uniform(0.9, 1.4))
    wrist = {"wrist_flexion": (-15, 25), "wrist_deviation": (-8, 8), "forearm_supination": (-30, 60)}
    return _bring(rng, draft, joints, side, middle + offset, (0.4, 0.5, -1), wrist)


def in_lap(rng: np.random.Generator, draft: Draft, joints: Joints) -> Joints | None:
    """Hands on the thighs of a sitting person."""
    hanging_arms = joints
    for side in ("left", "right"):
        sign = 1 if side == "left" else -1
        heads = _heads(draft, hanging_arms, side)
        along = heads["upperleg01"] + rng.uniform(0.55, 0.8) * (heads["lowerleg01"] - heads["upperleg01"])
        above = draft.person.radii_m["thigh"] + draft.person.radii_m["forearm"] + 0.02 + draft.room_m
        wrist = {"wrist_flexion": (-5, 25), "wrist_deviation": (-5, 5), "forearm_supination": (-75, -50)}
        target = along + np.array([0, -sign * rng.uniform(-0.02, 0.05), above])
        joints = _bring(rng, draft, joints, side, target, (-0.6, 0.6, -0.5), wrist)
    return joints


def of_any_kind(rng: np.random.Generator, draft: Draft, joints: Joints) -> Joints | None:
    """What a sitting person does with the arms: one of the above."""
    kinds = (in_lap, in_lap, one_reaching, both_reaching, crossed, near_face)
    return kinds[rng.integers(len(kinds))](rng, draft, joints)


def _bring(
    rng, draft: Draft, joints: Joints | None, side: str, wrist_m: np.ndarray, elbow_toward, ranges: Ranges
) -> Joints | None:
    """Bring a wrist to a point, the joints beyond the elbow drawn from `ranges`; None stays None."""
    if joints is None:
        return None
    joints = joints | uniform(rng, ranges, f"{side}_")
    return reach(draft.body, draft.person.weights, joints, side, wrist_m, elbow_toward)


def _side(rng: np.random.Generator) -> str:
    return ("left", "right")[rng.integers(2)]


def _heads(draft: Draft, joints: Joints, side: str) -> dict[str, np.ndarray]:
    """Where the bones of a side and of the middle begin, from the pelvis."""
    _, heads = pose_bones(draft.body, draft.person.weights, pose_from_joints(joints))
    end = "." + side[0].upper()
    return {name.removesuffix(end): heads[i] for i, name in enumerate(draft.body.bone_names)}
