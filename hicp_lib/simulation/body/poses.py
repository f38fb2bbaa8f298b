"""Random poses of people near a robot, within joint limits.

A pose consists of legs and trunk, arms and hands. Angles are sampled from ranges in degrees, arms that reach
for a position are solved by `reach`, and a pose with self-collision is sampled again with more room for the
arms.
"""

from collections.abc import Callable

import numpy as np

from hicp_lib.simulation.body import arms
from hicp_lib.simulation.body.arms import Draft, uniform
from hicp_lib.simulation.body.hands import sample_hand
from hicp_lib.simulation.body.identities import PEOPLE
from hicp_lib.simulation.body.joints import LIMITS_DEG, Joints, pose_from_joints, within_limits
from hicp_lib.simulation.body.model import Body, Pose, Shape
from hicp_lib.simulation.body.self_collision import collision_model, self_collision_distance_m

_N_TRIES = 30
_ROOM_STEP_M = 0.006  # added to the arms' distance from the body with every try
_PENETRATION_M = 0.02  # allowed penetration of skin and clothes

_RANGES_DEG = PEOPLE["poses_deg"]


def sample_pose(rng: np.random.Generator, body: Body, kind: str | None = None, shape: Shape = 0) -> Pose:
    """A random pose.

    Parameters
    ----------
    rng : numpy.random.Generator
    body : Body
    kind : str, optional
        As in `sample_joints`.
    shape : int or str or array, shape (n_shapes,), optional
        As in `sample_joints`.

    Returns
    -------
    dict of str to array
        As `pose_body` takes it.
    """
    return pose_from_joints(sample_joints(rng, body, kind, shape))


def sample_joints(rng: np.random.Generator, body: Body, kind: str | None = None, shape: Shape = 0) -> Joints:
    """Joint angles of a random pose, within `joints.LIMITS_DEG`.

    Parameters
    ----------
    rng : numpy.random.Generator
    body : Body
    kind : str, optional
        One of `KINDS`; sampled by default.
    shape : int or str or array, shape (n_shapes,), optional
        The shape to pose, as in `pose_body`; arms keep clear of its body.

    Returns
    -------
    dict of str to float
        Radians, by joint.

    Raises
    ------
    KeyError
        For an unknown kind.

    Examples
    --------
    >>> from hicp_lib.simulation.body.model import load_body
    >>> joints = sample_joints(np.random.default_rng(0), load_body(), "sitting")
    >>> bool(joints["left_knee_flexion"] > 1.2)
    True
    """
    kind = str(rng.choice(list(KINDS))) if kind is None else kind
    model = collision_model(body, shape)
    best, best_gap_m = None, -np.inf
    for attempt in range(_N_TRIES):
        joints = _draw(Draft(rng, body, model, attempt * _ROOM_STEP_M), kind)
        if joints is None or not within_limits(joints):
            continue
        gap_m = self_collision_distance_m(body, model, pose_from_joints(joints))
        if gap_m > best_gap_m:
            best, best_gap_m = joints, gap_m
        if gap_m > -_PENETRATION_M:
            break
    # Rarely needed: the pose with the least collision, or none at all.
    return best or _draw(Draft(rng, body, model, 0.0), "standing") or {}


def _draw(draft: Draft, kind: str) -> Joints | None:
    """One sample of a kind, with hands; None if an arm cannot reach its position."""
    legs, place_arms, hands = KINDS[kind]
    joints = uniform(draft.rng, _RANGES_DEG["trunk"]) | legs(draft.rng)
    for side in ("left", "right"):
        hand = sample_hand(draft.rng, str(draft.rng.choice(hands)), f"{side}_")
        joints |= arms.hanging_arm(draft, side) | hand
    return place_arms(draft, joints)


def _stand(rng: np.random.Generator, kind: str = "standing") -> Joints:
    joints = uniform(rng, _RANGES_DEG[kind], "left_") | uniform(rng, _RANGES_DEG[kind], "right_")
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
    return _stand(rng, "sitting") | uniform(rng, {"spine_flexion": (-5, 22)})


def _lean(rng: np.random.Generator) -> Joints:
    return _stand(rng) | uniform(rng, {"spine_flexion": (-2, 25), "neck_flexion": (-20, 8)})


def _level_feet(joints: Joints) -> Joints:
    """Ankle angles that keep the soles horizontal, within limits."""
    limits = np.radians(LIMITS_DEG["left_ankle_flexion"])
    return {
        f"{side}_ankle_flexion": float(
            np.clip(joints[f"{side}_hip_flexion"] - joints[f"{side}_knee_flexion"], *limits)
        )
        for side in ("left", "right")
    }


_CALM = ("relaxed", "relaxed", "open", "grip")
_ACTIVE = ("open", "open", "spread", "relaxed", "grip")

KINDS: dict[str, tuple[Callable, Callable, tuple[str, ...]]] = {
    "standing": (_stand, arms.hanging, (*_CALM, "fist")),
    "walking": (_walk, arms.swinging, (*_CALM, "fist")),
    "reaching": (_lean, arms.one_reaching, _ACTIVE),
    "reaching_both": (_lean, arms.both_reaching, _ACTIVE),
    "pointing": (_stand, arms.pointing, ("pointing",)),
    "crossed": (_stand, arms.crossed, ("relaxed", "grip")),
    "raised": (_stand, arms.raised, (*_ACTIVE, "fist")),
    "hips": (_stand, arms.on_hips, ("relaxed", "open")),
    "face": (_stand, arms.near_face, _CALM),
    "sitting": (_sit, arms.of_any_kind, (*_CALM, *_ACTIVE)),
}
"""Kinds of poses: functions that sample legs and trunk, and arms, and kinds of hands."""
