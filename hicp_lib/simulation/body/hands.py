"""Hands: open, relaxed, gripping, as a fist, pointing, spread."""

import numpy as np

from hicp_lib.simulation.body.identities import PEOPLE
from hicp_lib.simulation.body.joints import FINGERS, LIMITS_DEG, Joints, radians

HANDS_DEG: dict[str, dict[str, tuple[float, float]]] = PEOPLE["hands_deg"]
"""Ranges of a hand's joints in degrees, by its kind; those without `thumb` are of every finger."""
_STRAIGHT_INDEX_DEG = PEOPLE["straight_index_deg"]
_FINGER_JITTER_DEG = 4.0


def sample_hand(rng: np.random.Generator, kind: str, prefix: str = "") -> Joints:
    """Joint angles of one hand.

    Parameters
    ----------
    rng : numpy.random.Generator
    kind : str
        One of `HANDS_DEG`.
    prefix : str, optional
        Prefix of the joints' names, such as `left_`.

    Returns
    -------
    dict of str to float
        Radians.

    Examples
    --------
    >>> hand = sample_hand(np.random.default_rng(0), "fist")
    >>> bool(75 < np.degrees(hand["index_middle"]) <= 100)
    True
    """
    joints = {}
    for joint, limits in HANDS_DEG[kind].items():
        common = rng.uniform(*limits)
        if joint.startswith("thumb"):
            joints[joint] = common
            continue
        for finger in FINGERS:
            straight = kind == "pointing" and finger == "index" and joint in _STRAIGHT_INDEX_DEG
            value = rng.uniform(*_STRAIGHT_INDEX_DEG[joint]) if straight else common
            if joint != "spread":
                value += rng.normal(0, _FINGER_JITTER_DEG)
            elif finger == "middle":
                value = 0.0
            joints[f"{finger}_{joint}"] = value
    within_deg = {name: np.clip(value, *LIMITS_DEG[f"left_{name}"]) for name, value in joints.items()}
    return radians(within_deg, prefix)
