"""The recordings that can be simulated: the person in front of the robot, and the motion of both."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.memo import memoised
from hicp_lib.experiments.recordings.moving_person import HEAD_RAD, capture, moving_person
from hicp_lib.experiments.recordings.seated_person import VIEWS, seated_person
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.robot.kinematics import HEAD_JOINTS
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.body.model import PosedBody
from hicp_lib.simulation.rendering.render import World
from hicp_lib.simulation.sensors.depth_camera import DepthCamera
from hicp_lib.simulation.sensors.stereo_camera import D435
from hicp_lib.simulation.sensors.time_of_flight import AZURE_KINECT

POSES_FILE = DATA_DIR / "relative_poses.csv"
DEPTH_CAMERAS = {"d435": D435, "azure-kinect": AZURE_KINECT}
"""Depth cameras by name; nothing in this study is tuned on the second."""
_POSES_APART = 8  # offset between the first robot poses of consecutive people


@dataclass(frozen=True)
class Scenario:
    """A recording to be simulated.

    Attributes
    ----------
    n_frames, max_frames : int
        By default, and at most.
    rate_hz : float
        Frames per second.
    mount : str
        Holder of the camera on the robot's head.
    head_rad : callable
        From the number of frames to joint angles of the robot, (n, 6), in the order of `HEAD_JOINTS`.
    stage : callable
        From the subject and seconds from the first frame to the scene, and the person in it.
    capture : callable or None
        From the subject, the duration in seconds and T_world_camera to its motion capture, see `capture`.
    depth_camera : DepthCamera
    """

    n_frames: int
    max_frames: int
    rate_hz: float
    mount: str
    head_rad: Callable[[int], np.ndarray]
    stage: Callable[[Subject, float], tuple[World, PosedBody]]
    capture: Callable[[Subject, float, np.ndarray], tuple[MotionCapture, np.ndarray, float]] | None = None
    depth_camera: DepthCamera = D435

    def times_s(self, n: int) -> np.ndarray:
        """Times (n,) of the frames, the first at 0."""
        return np.arange(n) / self.rate_hz


def scenario(name: str, number: int = 0) -> Scenario:
    """A scenario by its name, or by NAME@CAMERA with another of `DEPTH_CAMERAS` than the D435.

    Parameters
    ----------
    name : str
    number : int, optional
        Of the person: determines the first of the robot's poses.

    Returns
    -------
    Scenario

    Raises
    ------
    InputError
        For an unknown name.

    Examples
    --------
    >>> scenario("relative-upper").n_frames, scenario("mocap@azure-kinect").depth_camera.width_px
    (100, 640)
    """
    base, at, camera = name.partition("@")
    camera = camera if at else "d435"
    for kind, known, chosen in (("scenario", SCENARIOS, base), ("depth camera", DEPTH_CAMERAS, camera)):
        if chosen not in known:
            raise InputError(f"no {kind} {chosen!r}; choose one of {', '.join(known)}")
    plan = SCENARIOS[base]
    first = _POSES_APART * number % plan.n_frames
    seen_by = DEPTH_CAMERAS[camera]
    return replace(plan, depth_camera=seen_by, head_rad=lambda n: plan.head_rad(first + n)[first:])


@memoised()
def relative_poses_rad(view: str) -> np.ndarray:
    """The robot's poses of a view, (n, 6) in the order of `HEAD_JOINTS`, from data/relative_poses.csv."""
    table = pd.read_csv(POSES_FILE)
    columns = [f"{joint}_deg" for joint in HEAD_JOINTS]
    return np.radians(table.loc[table["view"] == view, columns].to_numpy(float))


def _relative(view: str) -> Scenario:
    poses_rad = relative_poses_rad(view)
    return Scenario(
        n_frames=len(poses_rad),
        max_frames=len(poses_rad),
        rate_hz=0.5,  # the robot moves and comes to rest between two frames
        mount=VIEWS[view],
        head_rad=lambda n: poses_rad[np.arange(n) % len(poses_rad)],
        stage=lambda subject, time_s: seated_person(subject),
    )


SCENARIOS = {f"relative-{view}": _relative(view) for view in VIEWS} | {
    "mocap": Scenario(
        n_frames=48,
        max_frames=100_000,
        rate_hz=5.0,  # frames further apart show more of a person, and the clock offset needs seconds
        mount="level",
        head_rad=lambda n: np.tile(HEAD_RAD, (n, 1)),
        stage=lambda subject, time_s: moving_person(subject).at(time_s),
        capture=capture,
    )
}
