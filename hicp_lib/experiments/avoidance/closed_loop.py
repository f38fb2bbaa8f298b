"""The loop closed in simulation: the robot sees the person, gives way, and sees from its new posture.

Time advances in the controller's periods. Joints follow their velocities exactly. Images are taken at the
camera's rate, but only when the one before is done with; what was perceived reaches the loop after a delay.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import pandas as pd

from hicp_lib.core.memo import memoised
from hicp_lib.experiments.avoidance.reaching import Script, script
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
"""How the robot holds its head: it looks at its left hand and at whoever comes for it."""
_POSED_S = 0.08  # the person's skin is posed this often, and moves on straight lines in between


@dataclass(frozen=True)
class Trial:
    """What is simulated.

    Attributes
    ----------
    script : str
        What the person does, a key of `SCRIPTS`.
    duration_s : float
        For how long.
    subject : Subject
        Who the person is; draws room and noise too.
    camera_hz : float
        Images per second, if perception is as fast.
    """

    script: str
    duration_s: float = 7.6
    subject: Subject = Subject()
    camera_hz: float = 10.0


class Perceiver(Protocol):
    """What the robot perceives people with."""

    @property
    def delay_s(self) -> float:
        """From the image to when the loop knows."""
        ...

    def perceive(self, script: Script, time_s: float, posture: Posture) -> Perception:
        """Who is there, as seen from a posture.

        Parameters
        ----------
        script : Script
        time_s : float
            From the script's beginning.
        posture : Posture
            The robot's.

        Returns
        -------
        Perception
        """
        ...


@dataclass(frozen=True)
class TrueKeypoints:
    """The upper bound: every keypoint where it is, hidden or not, known at once."""

    delay_s: float = 0.0

    def perceive(self, script: Script, time_s: float, posture: Posture) -> Perception:
        """Where every keypoint is.

        Parameters
        ----------
        script : Script
        time_s : float
            From the script's beginning.
        posture : Posture
            The robot's.

        Returns
        -------
        Perception
        """
        points_m = in_root(script.person_at(time_s).keypoints_m)[None]
        return Perception(time_s, points_m, np.ones(points_m.shape[:2]))


@memoised()
def start_posture() -> Posture:
    """How the robot stands before anybody comes: the left hand at its post, the head looking at it."""
    return replace(home_posture(load_icub()), neck_rad=NECK_RAD)


def simulate(
    trial: Trial, perceiver: Perceiver, avoids: bool = True, settings: Settings | None = None
) -> pd.DataFrame:
    """One run of a trial.

    Parameters
    ----------
    trial : Trial
    perceiver : Perceiver
    avoids : bool, optional
        Whether the robot gives way at all.
    settings : Settings, optional
        The controller's.

    Returns
    -------
    pd.DataFrame
        A row per control period: `t_s`, `distance_m` between robot and person, `activations` of all taxels (a
        list) and `activation`, the highest, `status`, `hand_error_m` (from the post), a column per joint in
        radians, and `seen_s`, when the newest image that the loop knows was taken (NaN: none yet).
    """
    scene, icub = script(trial.script, trial.subject), load_icub()
    posture = start_posture()
    delay_s = perceiver.delay_s
    between_s = next_image_s(0.0, delay_s, trial.camera_hz)
    loop = _loop(icub, posture, delay_s + between_s, avoids, settings or Settings())
    period_s, under_way, free_s, rows = loop.controller.settings.period_s, None, 0.0, []
    for k in range(round(trial.duration_s / period_s)):
        now_s, arrived = k * period_s, None
        if under_way is not None and now_s >= under_way.time_s + delay_s - 1e-9:
            arrived, under_way = under_way, None
        if under_way is None and now_s >= free_s - 1e-9:
            under_way = perceiver.perceive(scene, now_s, posture)
            free_s = next_image_s(now_s, delay_s, trial.camera_hz)
            if delay_s == 0:
                arrived, under_way = under_way, None
        command, threat = loop.cycle(now_s, posture, arrived)
        rows.append(_row(trial, now_s, loop, posture, command, threat))
        posture = posture.moved("left", posture.angles("left") + period_s * command.velocities_rad_s)
    return pd.DataFrame(rows)


def next_image_s(taken_s: float, delay_s: float, camera_hz: float) -> float:
    """When the next image is taken: the camera's first one after the last is done with.

    Parameters
    ----------
    taken_s : float
        When the last image was taken.
    delay_s : float
        How long it is worked on.
    camera_hz : float

    Returns
    -------
    float
        Seconds.

    Examples
    --------
    >>> float(next_image_s(1.0, delay_s=0.15, camera_hz=10.0))
    1.2
    """
    return taken_s + max(1, np.ceil(delay_s * camera_hz - 1e-9)) / camera_hz


def _loop(icub: ICub, posture: Posture, late_s: float, avoids: bool, settings: Settings) -> AvoidanceLoop:
    """The loop, where the next perception may come `late_s` after the last one's image."""
    controller = Controller(icub, np.array(HOME_M["left"]), posture.angles("left"), settings=settings)
    # A perception holds until the next one can be there, so that slow detectors do not blink.
    hold_s = max(Trust().hold_s, late_s)
    tracker = KeypointTracker(Trust(hold_s=hold_s, memory_s=Trust().memory_s + hold_s))
    return AvoidanceLoop(controller, tracker=tracker, avoids=avoids)


def _row(
    trial: Trial, now_s: float, loop: AvoidanceLoop, posture: Posture, command: Command, threat: Threat
) -> dict:
    icub, q = loop.controller.icub, posture.angles("left")
    hand_m = icub.chains["left"].T_root_link("hand", q)[:3, 3]
    spheres = robot_spheres(icub, loop.skin, posture)
    row = {
        "t_s": now_s,
        "distance_m": skin_distance_m(spheres, person_skin_m(trial, now_s)),
        "activation": float(threat.activations.max()),
        "activations": threat.activations.round(3).tolist(),
        "status": command.status,
        "hand_error_m": float(np.linalg.norm(hand_m - loop.controller.post_m)),
        "seen_s": loop.tracker.latest_s if np.isfinite(loop.tracker.latest_s) else np.nan,
    }
    return row | {f"{joint}_rad": angle for joint, angle in zip(ARM_JOINTS, q.tolist(), strict=True)}


def person_skin_m(trial: Trial, time_s: float) -> np.ndarray:
    """Vertices (v, 3) of the person's skin at a time, root frame."""
    before = int(time_s / _POSED_S + 1e-9)
    share = time_s / _POSED_S - before
    first, then = (_posed_skin_m(trial.script, trial.subject, k) for k in (before, before + 1))
    return first + np.float32(share) * (then - first)


@memoised(256)
def _posed_skin_m(name: str, subject: Subject, k: int) -> np.ndarray:
    return in_root(script(name, subject).person_at(k * _POSED_S).vertices_m).astype(np.float32)
