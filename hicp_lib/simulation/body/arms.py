"""Poses of the arms: each function takes joints with both arms hanging and poses the arms.

All take a `Draft` and the joint angles of the whole body (radians, by joint), and return the angles
with those of the arms changed. They return None if the sampled pose violates joint limits; then sample again.
"""

from dataclasses import dataclass

import numpy as np

from hicp_lib.simulation.body.hands import sample_hand
from hicp_lib.simulation.body.identities import PEOPLE, Rng
from hicp_lib.simulation.body.joints import Joints, pose_from_joints, radians
from hicp_lib.simulation.body.model import Body, pose_bones
from hicp_lib.simulation.body.reach import reach
from hicp_lib.simulation.body.self_collision import CollisionModel

Ranges = dict[str, tuple[float, float]]

_OTHER = {"left": "right", "right": "left"}
_OUTWARD = {"left": 1, "right": -1}  # along y, which points to the person's left

_WRISTS_DEG = PEOPLE["wrists_deg"]  # the order of sampling


@dataclass(frozen=True)
class Draft:
    """Inputs for sampling a pose.

    Attributes
    ----------
    rng : numpy.random.Generator
    body : Body
    model : CollisionModel
        Sizes of the posed shape.
    room_m : float
        Minimum distance of the arms from the body.
    """

    rng: Rng
    body: Body
    model: CollisionModel
    room_m: float


def uniform(rng: Rng, ranges: Ranges, prefix: str = "") -> Joints:
    """Joint angles sampled uniformly from ranges.

    Parameters
    ----------
    rng : numpy.random.Generator
    ranges : dict of str to tuple of float
        Degrees, by joint.
    prefix : str, optional
        Prefix of the joints' names.

    Returns
    -------
    dict of str to float
        Radians.
    """
    return radians({name: rng.uniform(*limits) for name, limits in ranges.items()}, prefix)


def hanging_arm(draft: Draft, side: str) -> Joints:
    """One arm hanging at ease."""
    joints = uniform(draft.rng, PEOPLE["poses_deg"]["hanging"], f"{side}_")
    # For an arm of half a metre, this angle moves its middle away by `room_m`.
    joints[f"{side}_shoulder_abduction"] += draft.room_m / 0.25
    return joints


def hanging(draft: Draft, joints: Joints) -> Joints:
    """Both arms stay hanging."""
    return joints


def swinging(draft: Draft, joints: Joints) -> Joints:
    """Arms swing against the legs, as in walking."""
    swung = dict(joints)
    for side, other in _OTHER.items():
        swung[f"{side}_shoulder_flexion"] += 0.8 * joints[f"{other}_hip_flexion"]
        swung[f"{side}_shoulder_flexion"] -= np.radians(6)
    return swung


def one_reaching(draft: Draft, joints: Joints) -> Joints | None:
    """One arm reaches forward."""
    return _to_the_front(draft, joints, _side(draft.rng), "one")


def both_reaching(draft: Draft, joints: Joints) -> Joints | None:
    """Both arms reach forward."""
    left = _to_the_front(draft, joints, "left", "both")
    return left and _to_the_front(draft, left, "right", "both")


def pointing(draft: Draft, joints: Joints) -> Joints | None:
    """One arm, nearly straight, points somewhere ahead or to its side; the other hand is at ease."""
    side = _side(draft.rng)
    joints = joints | sample_hand(draft.rng, "relaxed", f"{_OTHER[side]}_")
    found = _to_the_front(draft, joints, side, "pointing")
    return found and found | uniform(draft.rng, _WRISTS_DEG["pointing"], f"{side}_")


def _to_the_front(draft: Draft, joints: Joints, side: str, kind: str) -> Joints | None:
    """An arm towards a direction (azimuth outward from straight ahead), by a share of its length."""
    ranges = PEOPLE["to_the_front"][kind]
    heads = _heads(draft, joints, side)
    chain = np.array([heads[bone] for bone in ("upperarm01", "lowerarm01", "wrist")])
    length = np.linalg.norm(np.diff(chain, axis=0), axis=1).sum()
    azimuth, elevation = (np.radians(draft.rng.uniform(*ranges[a])) for a in ("azimuth_deg", "elevation_deg"))
    direction = np.array([np.cos(azimuth), np.sin(azimuth) * _OUTWARD[side], np.tan(elevation)])
    direction /= np.linalg.norm(direction)
    target = heads["upperarm01"] + draft.rng.uniform(*ranges["share"]) * length * direction
    return _bring(draft, joints, side, target, (0, draft.rng.uniform(0.1, 0.9), -1), "front")


def crossed(draft: Draft, joints: Joints) -> Joints | None:
    """Forearms before the chest, one before the other, each wrist near the other elbow."""
    under = _side(draft.rng)
    centre, half = draft.model.trunk_at(draft.rng.uniform(0.52, 0.62))
    thickness = 2 * draft.model.radii_m["forearm"]
    found: Joints | None = joints
    for side, layer in ((under, 1.1), (_OTHER[under], 2.3)):
        x = centre[0] + half[0] + layer * thickness + draft.room_m
        height = centre[2] + draft.rng.uniform(0, 0.04) + (0.03 if side == under else 0.0)
        target = np.array([x, -_OUTWARD[side] * half[1] * draft.rng.uniform(0.35, 0.7), height])
        found = _bring(draft, found, side, target, (0.1, 0.7, -1), "crossed")
    return found


def raised(draft: Draft, joints: Joints) -> Joints:
    """One or both arms raised: forward, sideways, or with the forearms up."""
    ways = PEOPLE["raised_deg"]
    ranges = ways[draft.rng.integers(len(ways))] | _WRISTS_DEG["raised"]
    for side in ("left", "right") if draft.rng.random() < 0.5 else (_side(draft.rng),):
        joints = joints | uniform(draft.rng, ranges, f"{side}_")
    return joints


def on_hips(draft: Draft, joints: Joints) -> Joints | None:
    """Both hands on the hips, elbows out."""
    found: Joints | None = joints
    for side, outward in _OUTWARD.items():
        centre, half = draft.model.trunk_at(draft.rng.uniform(0.26, 0.34))
        offset = (draft.rng.uniform(-0.03, 0.02), outward * (half[1] + 0.045 + draft.room_m), 0.0)
        found = _bring(draft, found, side, centre + offset, (-0.4, 1, 0), "hips")
    return found


def near_face(draft: Draft, joints: Joints) -> Joints | None:
    """One hand near the face, from before the mouth to beside the ear."""
    side = _side(draft.rng)
    centre, half = draft.model.centres_m[-1], draft.model.half_axes_m[-1]
    middle = _heads(draft, joints, side)["head"] + centre - draft.model.bone_heads_m[-1]
    # The hand, a face long, stands above the wrist.
    turn = np.radians(draft.rng.uniform(15, 85))
    away = half[:2] + 0.07 + draft.room_m
    below = half[2] * draft.rng.uniform(0.9, 1.4)
    offset = (np.cos(turn) * away[0], _OUTWARD[side] * np.sin(turn) * away[1], -below)
    return _bring(draft, joints, side, middle + offset, (0.4, 0.5, -1), "face")


def in_lap(draft: Draft, joints: Joints) -> Joints | None:
    """Hands on the thighs of a sitting person."""
    found: Joints | None = joints
    above = draft.model.radii_m["thigh"] + draft.model.radii_m["forearm"] + 0.02 + draft.room_m
    for side, outward in _OUTWARD.items():
        heads = _heads(draft, joints, side)
        hip, knee = heads["upperleg01"], heads["lowerleg01"]
        target = hip + draft.rng.uniform(0.55, 0.8) * (knee - hip)
        target = target + np.array([0, -outward * draft.rng.uniform(-0.02, 0.05), above])
        found = _bring(draft, found, side, target, (-0.6, 0.6, -0.5), "lap")
    return found


def of_any_kind(draft: Draft, joints: Joints) -> Joints | None:
    """Any of the above, for a sitting person."""
    kinds = (in_lap, in_lap, one_reaching, both_reaching, crossed, near_face)
    return kinds[draft.rng.integers(len(kinds))](draft, joints)


def _bring(
    draft: Draft, joints: Joints | None, side: str, wrist_m: np.ndarray, elbow_toward, wrist: str
) -> Joints | None:
    """Move a wrist to a point, sampling the joints beyond the elbow from `_WRISTS_DEG`; None stays None."""
    if joints is None:
        return None
    joints = joints | uniform(draft.rng, _WRISTS_DEG[wrist], f"{side}_")
    return reach(draft.body, draft.model.shape, joints, side, wrist_m, elbow_toward)


def _side(rng: Rng) -> str:
    return ("left", "right")[rng.integers(2)]


def _heads(draft: Draft, joints: Joints, side: str) -> dict[str, np.ndarray]:
    """Start points of the bones of a side and of the middle, relative to the pelvis."""
    _, heads = pose_bones(draft.body, draft.model.shape, pose_from_joints(joints))
    end = "." + side[0].upper()
    return {name.removesuffix(end): heads[i] for i, name in enumerate(draft.body.bone_names)}
