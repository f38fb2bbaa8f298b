"""Protective separation distance of ISO 10218-2:2025: how far a person must be for a robot to stop in time.

`S = S_h + S_r + S_s + C + Z_d + Z_r`: the person's travel until the robot stands still, the robot's travel
while it reacts and while it stops, the reach of a body before it is noticed, and the uncertainty of both
positions. The 2025 edition took this over from ISO/TS 15066:2016. Its text was not available: terms follow
the description of the specification by Marvel and Norcross (2017), and the new edition may have changed them.
It serves for comparison only: nothing in this project is a safety function.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from hicp_lib.core.errors import InputError

HUMAN_SPEED_M_S = 1.6
"""Assumed speed of a person when it is not measured."""


@dataclass(frozen=True)
class Brakes:
    """How the arm stops: after a delay, joints decelerate uniformly.

    Attributes
    ----------
    delay_s : float
        From the command until joints start to slow down. Assumed: one control period.
    deceleration_rad_s2 : float
        Of the joint that takes longest. Assumed (100 degrees per second squared), as no value is published
        for the iCub; it stops joints at the controller's 30 degrees per second within 0.3 s.

    Raises
    ------
    InputError
        If they are not such numbers.

    Examples
    --------
    >>> round(Brakes().stopping_s(np.deg2rad(30)), 2)
    0.32
    """

    delay_s: float = 0.02
    deceleration_rad_s2: float = np.deg2rad(100.0)

    def __post_init__(self) -> None:
        if not (0 <= self.delay_s < np.inf and 0 < self.deceleration_rad_s2 < np.inf):
            raise InputError(f"{self} never stop an arm; expected seconds, 0 or more, and rad/s^2, above 0")

    def stopping_s(self, joint_rad_s: float) -> float:
        """Time from the command to standstill, T_s, for this speed of the fastest joint."""
        return float(self.delay_s + joint_rad_s / self.deceleration_rad_s2)


ASSUMED = Brakes()


@dataclass(frozen=True)
class Separation:
    """The terms of the protective separation distance; metres, seconds.

    Attributes
    ----------
    human_m_s, robot_m_s : float
        Speeds towards each other.
    reaction_s : float
        T_r, from an event to the robot's reaction.
    stopping_s : float
        T_s, from there to standstill.
    brake_delay_s : float
        The part of it before the robot slows down.
    intrusion_m : float
        C.
    human_uncertainty_m, robot_uncertainty_m : float
        Z_d and Z_r.

    Examples
    --------
    >>> round(Separation(1.0, reaction_s=0.1, stopping_s=0.3, human_uncertainty_m=0.1).distance_m, 3)
    0.99
    """

    robot_m_s: float
    reaction_s: float
    stopping_s: float
    human_uncertainty_m: float
    robot_uncertainty_m: float = 0.0
    intrusion_m: float = 0.0
    brake_delay_s: float = 0.0
    human_m_s: float = HUMAN_SPEED_M_S

    def terms_m(self) -> dict[str, float]:
        """The summands of the distance.

        Returns
        -------
        dict of str to float
            By their meaning.
        """
        slowing_s = self.stopping_s - self.brake_delay_s
        return {
            "S_h: person, until the robot stands": self.human_m_s * (self.reaction_s + self.stopping_s),
            "S_r: robot, while it reacts": self.robot_m_s * self.reaction_s,
            "S_s: robot, while it stops": self.robot_m_s * (self.brake_delay_s + slowing_s / 2),
            "C: body beyond the keypoints": self.intrusion_m,
            "Z_d: uncertainty of the person's position": self.human_uncertainty_m,
            "Z_r: uncertainty of the robot's position": self.robot_uncertainty_m,
        }

    @property
    def distance_m(self) -> float:
        """The sum: below this distance the robot must already be stopping."""
        return sum(self.terms_m().values())


def separation_table(separations: Mapping[str, Separation]) -> pd.DataFrame:
    """The terms of several detectors and their sums.

    Parameters
    ----------
    separations : mapping of str to Separation
        By detector.

    Returns
    -------
    pd.DataFrame
        A row per term, and last for their sum: columns `term`, and by detector metres.
    """
    columns = {name: one.terms_m() | {"sum": one.distance_m} for name, one in separations.items()}
    return pd.DataFrame(columns).rename_axis("term").reset_index()
