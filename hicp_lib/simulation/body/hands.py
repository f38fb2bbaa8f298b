"""Hands: open, relaxed, gripping, as a fist, pointing, spread."""

import numpy as np

from hicp_lib.simulation.body.joints import FINGERS, LIMITS_DEG, Joints, radians

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


def sample_hand(rng: np.random.Generator, kind: str, prefix: str = "") -> Joints:
    """Joint angles of one hand.

    Parameters
    ----------
    rng : numpy.random.Generator
    kind : str
        One of `HANDS_DEG`.
    prefix : str, optional
        Goes before the names of the joints, such as `left_`.

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
    within_deg = {name: np.clip(value, *LIMITS_DEG[f"left_{name}"]) for name, value in joints.items()}
    return radians(within_deg, prefix)
