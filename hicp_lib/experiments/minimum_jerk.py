"""Movements of a person as joint angles over time: postures, and minimum-jerk paths between them.

Between two postures every joint follows 10 s^3 - 15 s^4 + 6 s^5, s from 0 to 1: the smoothest path from rest
to rest, similar to human arm movements (Flash and Hogan, *The Coordination of Arm Movements*, J. Neuroscience
1985). Joints stay within the ranges of the postures, so within their limits.
"""

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from hicp_lib.simulation.body.joints import Joints


@dataclass(frozen=True)
class Posture:
    """Joint angles (radians), and the person's position: x, y on the floor in metres."""

    joints: Joints
    place_m: tuple[float, float]


@dataclass(frozen=True)
class Move:
    """A movement that takes `duration_s` and ends in a posture; a pause if that is the same as before."""

    duration_s: float
    to: Posture


def between(a: Posture, b: Posture, share: float) -> Posture:
    """The posture at a fraction of the path from one to another.

    Parameters
    ----------
    a, b : Posture
        Joints missing in one of them are zero there.
    share : float
        0 to 1.

    Returns
    -------
    Posture
    """
    names = [*a.joints | b.joints]  # in the same order in every process, unlike a set
    start, end = (np.array([p.joints.get(name, 0.0) for name in names]) for p in (a, b))
    place = np.array(a.place_m) + share * (np.array(b.place_m) - a.place_m)
    joints = dict(zip(names, (start + share * (end - start)).tolist(), strict=True))
    return Posture(joints, (float(place[0]), float(place[1])))


def minimum_jerk(s: float) -> float:
    """Fraction of the path after a fraction `s` of the time, both 0 to 1.

    Examples
    --------
    >>> minimum_jerk(0.0), minimum_jerk(0.5), minimum_jerk(1.0)
    (0.0, 0.5, 1.0)
    """
    return s**3 * (10 - 15 * s + 6 * s * s)


@dataclass
class Motion:
    """A sequence of movements from a first posture, sampled only as far as needed.

    Attributes
    ----------
    first : Posture
        Until time 0.
    moves : iterator of Move
        The following movements, endless.

    Examples
    --------
    >>> from itertools import repeat
    >>> low, high = (Posture({"left_elbow_flexion": angle}, (0.0, 0.0)) for angle in (0.0, 1.0))
    >>> bending = Motion(low, repeat(Move(2.0, high)))
    >>> bending.at(1.0).joints, bending.still_since_s(5.0)
    ({'left_elbow_flexion': 0.5}, 2.0)
    """

    first: Posture
    moves: Iterator[Move]
    _ends_s: list[float] = field(default_factory=lambda: [0.0])
    _postures: list[Posture] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._postures.append(self.first)

    def at(self, time_s: float) -> Posture:
        """The posture at a time, in seconds."""
        k = self._move_at(time_s)
        if k == 0:
            return self.first
        start_s, end_s = self._ends_s[k - 1 : k + 1]
        share = minimum_jerk((time_s - start_s) / (end_s - start_s))
        return between(self._postures[k - 1], self._postures[k], share)

    def still_since_s(self, time_s: float) -> float:
        """Since when the posture has been the one at a time; the time itself if it is changing."""
        k = start = self._move_at(time_s)
        while start and self._postures[start - 1] == self._postures[start]:
            start -= 1
        return time_s if 0 < start == k else self._ends_s[start]

    def _move_at(self, time_s: float) -> int:
        """The movement at a time, from 1 on; 0 before all. Samples movements up to there."""
        if time_s <= 0:
            return 0
        while self._ends_s[-1] <= time_s:
            move = next(self.moves)
            self._ends_s.append(self._ends_s[-1] + move.duration_s)
            self._postures.append(move.to)
        return bisect_right(self._ends_s, time_s)
