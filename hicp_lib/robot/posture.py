"""Joint angles of the whole upper body, and of each chain."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

_LIMB = {"head": "neck_rad", "left": "left_rad", "right": "right_rad"}


def _zeros(n: int) -> np.ndarray:
    return field(default_factory=lambda: np.zeros(n))


@dataclass(frozen=True, eq=False)
class Posture:
    """Joint angles of torso, neck and both arms, radians, in the order of the kinematic tables.

    Attributes
    ----------
    torso_rad : array, shape (3,), optional
        Pitch, roll, yaw; upright by default.
    neck_rad : array, shape (3,), optional
        Pitch, roll, yaw; upright when left out.
    left_rad, right_rad : array, shape (7,), optional
        Shoulder pitch, roll, yaw, elbow, wrist prosup, pitch, yaw; hanging down by default.

    Examples
    --------
    >>> posture = Posture(torso_rad=np.array([0.1, 0.0, 0.0]))
    >>> posture.angles("head")
    array([0.1, 0. , 0. , 0. , 0. , 0. ])
    >>> posture.moved("left", np.full(10, 0.2)).angles("head")
    array([0.2, 0.2, 0.2, 0. , 0. , 0. ])
    """

    torso_rad: np.ndarray = _zeros(3)
    neck_rad: np.ndarray = _zeros(3)
    left_rad: np.ndarray = _zeros(7)
    right_rad: np.ndarray = _zeros(7)

    def angles(self, chain: str) -> np.ndarray:
        """Angles of a chain, beginning with the torso.

        Parameters
        ----------
        chain : str
            "head", "left" or "right".

        Returns
        -------
        array, shape (6,) or (10,)
        """
        return np.concatenate([self.torso_rad, getattr(self, _LIMB[chain])])

    def moved(self, chain: str, q_rad: np.ndarray) -> Posture:
        """This posture with other angles of a chain, torso included: every limb moves with it.

        Parameters
        ----------
        chain : str
            "head", "left" or "right".
        q_rad : array, shape (6,) or (10,)

        Returns
        -------
        Posture
        """
        return replace(self, torso_rad=q_rad[:3], **{_LIMB[chain]: q_rad[3:]})
