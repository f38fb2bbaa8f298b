"""Separation by ISO/TS 15066: how far a person and a moving robot must be for the robot to stop in time.

`S = v_h (T_r + T_s) + v_r T_r + v_r T_s / 2 + C + Z_d + Z_r`: what the person covers until
the robot stands, what the robot covers while it reacts and while it brakes evenly, how far the person's
body gets before it is noticed, and how uncertain the places of both are. A yardstick for drawing only:
nothing in this project is a safety function.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

HUMAN_SPEED_M_S = 1.6
"""How fast a person is taken to be when nobody measures it."""


@dataclass(frozen=True)
class Separation:
    """The terms of the protective separation distance; metres, seconds.

    Attributes
    ----------
    human_m_s, robot_m_s : float
        Speeds towards each other.
    reaction_s : float
        T_r, from what happens to the robot's reaction.
    stopping_s : float
        T_s, from there to standstill.
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
    human_m_s: float = HUMAN_SPEED_M_S

    def terms_m(self) -> dict[str, float]:
        """The summands of the distance.

        Returns
        -------
        dict of str to float
            By what they stand for.
        """
        return {
            "person, until the robot stands": self.human_m_s * (self.reaction_s + self.stopping_s),
            "robot, while it reacts": self.robot_m_s * self.reaction_s,
            "robot, while it brakes": self.robot_m_s * self.stopping_s / 2,
            "intrusion": self.intrusion_m,
            "uncertainty of the person's place": self.human_uncertainty_m,
            "uncertainty of the robot's place": self.robot_uncertainty_m,
        }

    @property
    def distance_m(self) -> float:
        """The sum: nearer than this the robot would have to be stopping already."""
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
        A row per term and for their sum, of each detector: columns `detector`, `term`, `value` (metres).
    """
    rows = [
        {"detector": name, "term": term, "value": value}
        for name, separation in separations.items()
        for term, value in (separation.terms_m() | {"sum": separation.distance_m}).items()
    ]
    return pd.DataFrame(rows, columns=["detector", "term", "value"])
