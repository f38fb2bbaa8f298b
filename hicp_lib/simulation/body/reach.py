"""Move a wrist to a point: inverse kinematics of an arm with two segments."""

from collections.abc import Sequence

import numpy as np

from hicp_lib.core.rotations import between, rotation, rotations_from_vectors
from hicp_lib.simulation.body.joints import HANGING, LIMITS_DEG, Joints, pose_from_joints, shoulder_angles
from hicp_lib.simulation.body.model import Body, Shape, pose_bones

_SHOULDER = ("shoulder_flexion", "shoulder_abduction", "shoulder_rotation")
_N_SWIVELS = 36
_N_ROUNDS = 3  # the shoulder moves a little with the arm, so the solution is repeated
_LONGEST = 0.998  # usable fraction of the stretched arm


def reach(
    body: Body,
    shape: Shape,
    angles: Joints,
    side: str,
    wrist_m: np.ndarray,
    elbow_toward: Sequence[float] = (0.0, 0.3, -1.0),
) -> Joints | None:
    """Bend shoulder and elbow so that the wrist reaches a point, or gets as near as possible.

    The elbow can still swivel about the line from shoulder to wrist: of the positions within the
    joints' limits it takes the one furthest in the direction `elbow_toward`.

    Parameters
    ----------
    body : Body
    shape : int or str or array, shape (n_shapes,)
        As in `pose_body`.
    angles : dict of str to float
        Joint angles of the rest of the body, radians.
    side : str
        "left" or "right".
    wrist_m : array, shape (3,)
        Relative to the pelvis, body axes.
    elbow_toward : sequence of float, optional
        In the axes of the trunk, y away from the middle of the body.

    Returns
    -------
    dict of str to float or None
        `angles` with those of shoulder and elbow replaced; None where the limits allow no position.

    Examples
    --------
    >>> from hicp_lib.simulation.body.model import load_body
    >>> joints = reach(load_body(), "woman_25_09", {}, "left", np.array([0.4, 0.2, 0.3]))
    >>> sorted(joints)[0], 0 < joints["left_elbow_flexion"] < np.pi
    ('left_elbow_flexion', True)
    """
    result = dict(angles)
    to_left = np.array([1.0, 1.0 if side == "left" else -1.0, 1.0])
    bone, end = body.bone_numbers, side[0].upper()
    shoulder, elbow, wrist = (bone[f"{name}.{end}"] for name in ("upperarm01", "lowerarm01", "wrist"))
    for _ in range(_N_ROUNDS):
        rotations, heads = pose_bones(body, shape, pose_from_joints(result))
        lengths = np.linalg.norm(heads[elbow] - heads[shoulder]), np.linalg.norm(heads[wrist] - heads[elbow])
        target = rotations[bone["spine01"]].T @ (np.asarray(wrist_m) - heads[shoulder])
        found = _two_segments(target * to_left, lengths, np.asarray(elbow_toward, float))
        if found is None:
            return None
        result |= {f"{side}_{joint}": angle for joint, angle in found.items()}
    return result


def _two_segments(target: np.ndarray, lengths: tuple, elbow_toward: np.ndarray) -> Joints | None:
    """Joint angles of a left arm that bring its wrist to `target`, seen from the shoulder."""
    upper, fore = map(float, lengths)
    distance = min(float(np.linalg.norm(target)), _LONGEST * (upper + fore))
    cosine = (upper**2 + fore**2 - distance**2) / (2 * upper * fore)
    flexion = float(np.pi - np.arccos(np.clip(cosine, -1, 1)))
    if flexion > np.radians(LIMITS_DEG["left_elbow_flexion"][1]):
        return None
    bent = upper * HANGING + fore * rotation((0, -flexion, 0)) @ HANGING
    aim = target / np.linalg.norm(target)
    align = between(bent / np.linalg.norm(bent), aim)
    swivels = np.arange(_N_SWIVELS)[:, None] * 2 * np.pi / _N_SWIVELS
    rotations = rotations_from_vectors(swivels * aim) @ align
    angles = np.stack(shoulder_angles(rotations), axis=1)
    low, high = np.radians([LIMITS_DEG[f"left_{joint}"] for joint in _SHOULDER]).T
    allowed = ((angles >= low) & (angles <= high)).all(axis=1)
    if not allowed.any():
        return None
    best = np.argmax(np.where(allowed, rotations @ HANGING @ elbow_toward, -np.inf))
    return dict(zip(_SHOULDER, map(float, angles[best]), strict=True)) | {"elbow_flexion": flexion}
