"""Closed-loop simulation: the robot sees the person, avoids, and sees from its new posture.

Time advances in the controller's periods. Joints follow their velocities exactly, but are read with noise.
The camera runs independently; whenever the detector is free, it takes the next image, and its result reaches
the loop after a stated latency. The person also sees the robot and follows its hand.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from hicp_lib.core.errors import InputError
from hicp_lib.core.memo import memoised
from hicp_lib.experiments.avoidance.reaching import LEAVES_S, LOOKED_AT_S, REACTION_S, Moment
from hicp_lib.experiments.avoidance.skin_distance import robot_spheres, skin_distance_m
from hicp_lib.experiments.laboratory import in_root
from hicp_lib.robot.controller import Controller, Settings
from hicp_lib.robot.home import HOME_M, home_posture
from hicp_lib.robot.kinematics import ARM_JOINTS, ICub, load_icub
from hicp_lib.robot.loop import AvoidanceLoop, Command, Perception, Threat
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.tracking import KeypointTracker, Trust
from hicp_lib.simulation.body.identities import Subject

MOUNT = "tilted"
NECK_RAD = np.radians([3.0, 0.0, 4.0])
"""Pose of the robot's head: it looks at its left hand and at a person who reaches for it."""
STARTS_S = LOOKED_AT_S[0] - 0.2
"""Start of runs, when people are still far."""
HAND_COLUMNS = ("followed_x_m", "followed_y_m", "followed_z_m")
_POSED_S = 0.1  # the person's skin is posed at this interval, and interpolated linearly
_ROW_PERIODS = 2  # control periods from one row to the next


@dataclass(frozen=True)
class Latency:
    """Stated latency from light to keypoints in the loop; a measured one would depend on the machine.

    Attributes
    ----------
    exposure_s : float
        From the centre of the exposure to its end.
    transport_s : float
        Readout, cable and driver.
    queue_s : float
        Until the detector is free.
    inference_s : float
        Detector and lifting; no other image is processed meanwhile.

    Raises
    ------
    InputError
        If one of them is not a number of seconds.
    """

    exposure_s: float = 0.0
    transport_s: float = 0.0
    queue_s: float = 0.0
    inference_s: float = 0.0

    def __post_init__(self) -> None:
        for name, value_s in vars(self).items():
            if not (isinstance(value_s, int | float) and 0 <= value_s < np.inf):
                raise InputError(f"{name} is {value_s!r}; expected seconds, 0 or more")

    @property
    def total_s(self) -> float:
        """The sum."""
        return self.exposure_s + self.transport_s + self.queue_s + self.inference_s


@dataclass(frozen=True)
class Trial:
    """A trial to simulate.

    Attributes
    ----------
    script : str
        The person's behaviour, a key of `SCRIPTS` or `BYSTANDERS`.
    duration_s : float
        Duration of the trial.
    subject : Subject
        The person; also determines room and noise.
    camera_hz : float
        Images per second, if perception keeps up.
    follow_m_s : float
        Maximum speed with which the person follows the robot's hand; 0: they go to its initial position.
    joint_noise_rad : float
        Standard deviation of each reading of a joint.
    """

    script: str
    duration_s: float = 5.4
    subject: Subject = Subject()
    camera_hz: float = 10.0
    follow_m_s: float = 0.8
    joint_noise_rad: float = 0.0


Perceive = Callable[[Moment, Posture, Posture], Perception]
"""Perceives the people at a moment, from the robot's posture, and that posture as the robot measures it."""


def true_keypoints(moment: Moment, posture: Posture, read: Posture) -> Perception:
    """The upper bound: all true keypoints, including occluded ones.

    Parameters
    ----------
    moment : Moment
    posture, read : Posture
        Not used.

    Returns
    -------
    Perception
    """
    points_m = in_root(moment.person.keypoints_m)[None]
    return Perception(moment.time_s, points_m, np.ones(points_m.shape[:2]))


class Follower:
    """The person of a trial, who moves to where the robot's hand was a reaction time ago.

    Parameters
    ----------
    trial : Trial
    """

    def __init__(self, trial: Trial):
        self.trial = trial
        self._hands: list[tuple[float, np.ndarray]] = []
        self._followed_m = [np.array(HOME_M["left"])]  # every `_POSED_S`

    def see(self, time_s: float, hand_m: np.ndarray) -> None:
        """Record the position of the robot's hand; in the order of time, at least every `REACTION_S` / 2."""
        self._hands.append((time_s, hand_m))
        while len(self._followed_m) * _POSED_S < min(time_s + REACTION_S / 2, LEAVES_S[0]) + 1e-9:
            then_s, last_m = len(self._followed_m) * _POSED_S - REACTION_S, self._followed_m[-1]
            seen_m = next((m for t, m in reversed(self._hands) if t <= then_s + 1e-9), last_m)
            away_m = seen_m - last_m
            share = min(1.0, self.trial.follow_m_s * _POSED_S / max(float(np.linalg.norm(away_m)), 1e-9))
            self._followed_m.append(last_m + share * away_m)

    def moment(self, time_s: float) -> Moment:
        """The moment at a time, at most `_POSED_S` after the last recorded one."""
        before = min(int(time_s / _POSED_S + 1e-9), len(self._followed_m) - 1)
        after = min(before + 1, len(self._followed_m) - 1)
        first_m, then_m = self._followed_m[before], self._followed_m[after]
        hand_m = first_m + min(time_s / _POSED_S - before, 1.0) * (then_m - first_m)
        # A robot without a threat moves by less, so that all conditions then see the same.
        return Moment(self.trial.script, self.trial.subject, time_s, tuple(hand_m.round(3).tolist()))

    def skin_m(self, time_s: float) -> np.ndarray:
        """Vertices (v, 3) of the person's skin, root frame."""
        before = int(time_s / _POSED_S + 1e-9)
        first, then = (_skin_m(self.moment(round(k * _POSED_S, 9))) for k in (before, before + 1))
        return first + np.float32(time_s / _POSED_S - before) * (then - first)


@memoised(128)
def _skin_m(moment: Moment) -> np.ndarray:
    return in_root(moment.person.vertices_m).astype(np.float32)


@memoised()
def start_posture() -> Posture:
    """Initial posture of the robot: the left hand at its post, the head looking at it."""
    return replace(home_posture(load_icub()), neck_rad=NECK_RAD)


def simulate(
    trial: Trial,
    perceive: Perceive,
    latency: Latency = Latency(),
    avoids: bool = True,
    settings: Settings | None = None,
) -> pd.DataFrame:
    """One run of a trial, from shortly before the robot's perception becomes relevant.

    Parameters
    ----------
    trial : Trial
    perceive : callable
        A `Perceive`.
    latency : Latency, optional
        From the image to the loop.
    avoids : bool, optional
        Whether the robot avoids at all.
    settings : Settings, optional
        The controller's.

    Returns
    -------
    pd.DataFrame
        A row per two control periods: `t_s`, `distance_m` between robot and person, `activations` of all
        taxels (a list) and `activation`, the highest, `status`, `hand_error_m` (from the post), a column per
        joint in radians, `HAND_COLUMNS` (the hand's position as the person sees it), and `seen_s`, the time
        of the newest image in the loop (NaN: none yet).
    """
    icub, posture, person = load_icub(), start_posture(), Follower(trial)
    rng = trial.subject.stream(trial.script, "joints")
    loop = _loop(icub, posture, latency.total_s + between_s(trial, latency), avoids, settings or Settings())
    period_s, under_way, free_s, rows = loop.controller.settings.period_s, deque[Perception](), 0.0, []
    for k in range(round(STARTS_S / period_s), round(trial.duration_s / period_s)):
        now_s, q = k * period_s, posture.angles("left")
        person.see(now_s, icub.chains["left"].T_root_link("hand", q)[:3, 3])
        read = posture.moved("left", q + rng.normal(0.0, trial.joint_noise_rad, len(q)))
        if now_s >= free_s - 1e-9:
            under_way.append(perceive(person.moment(now_s), posture, read))
            free_s = now_s + between_s(trial, latency)
        arrived = None
        if under_way and now_s >= under_way[0].time_s + latency.total_s - 1e-9:
            arrived = under_way.popleft()
        command, threat = loop.cycle(now_s, read, arrived)
        if k % _ROW_PERIODS == 0:
            rows.append(_row(person, now_s, loop, posture, command, threat))
        posture = posture.moved("left", q + period_s * command.velocities_rad_s)
    return pd.DataFrame(rows)


def between_s(trial: Trial, latency: Latency) -> float:
    """Interval between processed images: the camera's first one after the detector is free again.

    Examples
    --------
    >>> float(between_s(Trial("sitting, hand", camera_hz=10.0), Latency(transport_s=0.5, inference_s=0.15)))
    0.2
    """
    return max(1, np.ceil(latency.inference_s * trial.camera_hz - 1e-9)) / trial.camera_hz


def _loop(icub: ICub, posture: Posture, late_s: float, avoids: bool, settings: Settings) -> AvoidanceLoop:
    """The loop, for perceptions that arrive up to `late_s` after the last one's image."""
    controller = Controller(icub, np.array(HOME_M["left"]), posture.angles("left"), settings=settings)
    # A perception holds until the next one is due, so that keypoints of slow detectors do not flicker.
    hold_s = max(Trust().hold_s, late_s)
    tracker = KeypointTracker(Trust(hold_s=hold_s, memory_s=Trust().memory_s + hold_s))
    return AvoidanceLoop(controller, tracker=tracker, avoids=avoids)


def _row(
    person: Follower, now_s: float, loop: AvoidanceLoop, posture: Posture, command: Command, threat: Threat
) -> dict:
    icub, q = loop.controller.icub, posture.angles("left")
    hand_m = icub.chains["left"].T_root_link("hand", q)[:3, 3]
    row = {
        "t_s": now_s,
        "distance_m": skin_distance_m(robot_spheres(icub, posture), person.skin_m(now_s)),
        "activation": float(threat.activations.max()),
        "activations": threat.activations.round(3).tolist(),
        "status": command.status,
        "hand_error_m": float(np.linalg.norm(hand_m - loop.controller.post_m)),
        "seen_s": loop.tracker.latest_s if np.isfinite(loop.tracker.latest_s) else np.nan,
    }
    row |= dict(zip(HAND_COLUMNS, person.moment(now_s).hand_m, strict=True))
    return row | {f"{joint}_rad": angle for joint, angle in zip(ARM_JOINTS, q.tolist(), strict=True)}
