"""Angles of the whole upper body, and those of each chain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

_LIMB = {"head": "neck_rad", "left": "left_rad", "right": "right_rad"}


@dataclass(frozen=True, eq=False)
class Posture:
    """Joint angles of torso, neck and both arms, radians, in the order of the kinematic tables.

    Attributes
    ----------
    torso_rad : (3,) pitch, roll, yaw
    neck_rad : (3,) pitch, roll, yaw
    left_rad, right_rad : (7,) shoulder pitch, roll, yaw, elbow, wrist prosup, pitch, yaw
    """

    torso_rad: np.ndarray
    neck_rad: np.ndarray
    left_rad: np.ndarray
    right_rad: np.ndarray

    def angles(self, chain: str) -> np.ndarray:
        """Angles of "head" (6,), "left" or "right" (10,), beginning with the torso."""
        return np.concatenate([self.torso_rad, getattr(self, _LIMB[chain])])

    def moved(self, chain: str, q_rad: np.ndarray) -> Posture:
        """This posture with other angles of a chain, torso included: every limb moves with it."""
        return replace(self, torso_rad=q_rad[:3], **{_LIMB[chain]: q_rad[3:]})
