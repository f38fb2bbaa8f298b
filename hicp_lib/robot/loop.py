"""The avoidance loop: keypoints in, joint velocities out, one cycle every 20 ms.

`Perception` and `Command` are the whole interface to a robot: a lab wraps its own middleware (YARP, ROS)
around `AvoidanceLoop.cycle`. Nothing here is a safety function.
"""

from dataclasses import dataclass, field

import numpy as np

from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.robot.controller import Controller, NoSolution
from hicp_lib.robot.peripersonal_space import ACTIVATION_THRESHOLD, Obstacle, ReceptiveField, obstacles
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.skin import Skin, read_skin
from hicp_lib.robot.tracking import KeypointTracker

FREE, AVOIDING, STOPPED = "free", "avoiding", "stopped"
"""Status of a command: nothing is near, something is, or the arm stands still (see `reason`)."""


@dataclass(frozen=True, eq=False)
class Perception:
    """Keypoints detected in one image.

    Attributes
    ----------
    time_s : float
        When the image was taken, in the clock of the loop.
    keypoints_m : array, shape (p, 136, 3)
        Of p people (none: p = 0) in the robot's root frame, NaN where unknown.
    scores : array, shape (p, 136)
        0 to 1.

    Raises
    ------
    ValueError
        If the shapes are not these.
    """

    time_s: float
    keypoints_m: np.ndarray
    scores: np.ndarray

    def __post_init__(self) -> None:
        n, shapes = len(self.keypoints_m), (np.shape(self.keypoints_m), np.shape(self.scores))
        if shapes != ((n, N_KEYPOINTS, 3), (n, N_KEYPOINTS)):
            expected = f"(p, {N_KEYPOINTS}, 3) and (p, {N_KEYPOINTS})"
            raise ValueError(f"keypoints {shapes[0]} and scores {shapes[1]}: expected {expected}")


@dataclass(frozen=True, eq=False)
class Command:
    """Joint velocities until the next command.

    Attributes
    ----------
    time_s : float
        When it was decided, in the clock of the loop.
    velocities_rad_s : array, shape (10,)
        Of `hicp_lib.robot.kinematics.ARM_JOINTS`; zero when stopped.
    status : str
        `FREE`, `AVOIDING` or `STOPPED`.
    reason : str
        Why the arm stands still; empty otherwise.
    """

    time_s: float
    velocities_rad_s: np.ndarray
    status: str
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Threat:
    """Activations of the skin by keypoints, and the resulting obstacles.

    Attributes
    ----------
    activations : array, shape (n,)
        Of every taxel.
    obstacles : list of Obstacle
        At most one per part, from the magnitude at which joints begin to slow down.
    """

    activations: np.ndarray
    obstacles: list[Obstacle]

    @property
    def is_close(self) -> bool:
        """Whether any taxel's activation is above the threshold at which the published controller reacts."""
        return any(obstacle.magnitude > ACTIVATION_THRESHOLD for obstacle in self.obstacles)


@dataclass(eq=False)
class AvoidanceLoop:
    """Tracker, skin and controller in sequence; one object per robot and stream.

    Attributes
    ----------
    controller : Controller
        For a robot, one of its arms, and its post.
    skin : Skin
        The robot's taxels.
    sensing : ReceptiveField
        The taxels' receptive field.
    tracker : KeypointTracker
        Filters keypoints over time.
    avoids : bool
        Whether to avoid at all; if not, the arm keeps its post, and threats are still reported.
    blind_after_s : float
        The arm stops when the newest perception is older than this. Empty ones count: they mean that nobody
        is detected.

    Examples
    --------
    >>> from hicp_lib.robot.home import HOME_M, home_posture
    >>> from hicp_lib.robot.kinematics import load_icub
    >>> icub = load_icub()
    >>> home = home_posture(icub)
    >>> loop = AvoidanceLoop(Controller(icub, np.array(HOME_M["left"]), home.angles("left")))
    >>> nobody = Perception(0.0, np.zeros((0, 136, 3)), np.zeros((0, 136)))
    >>> command, threat = loop.cycle(0.0, home, nobody)
    >>> command.status, threat.obstacles
    ('free', [])
    >>> loop.cycle(2.0, home)[0].reason
    'no perception in the last 1 s'
    """

    controller: Controller
    skin: Skin = field(default_factory=read_skin)
    sensing: ReceptiveField = field(default_factory=ReceptiveField)
    tracker: KeypointTracker = field(default_factory=KeypointTracker)
    avoids: bool = True
    blind_after_s: float = 1.0

    def cycle(
        self, now_s: float, posture: Posture, perception: Perception | None = None
    ) -> tuple[Command, Threat]:
        """One cycle: process a new perception, if there is one, and compute a command.

        For any perception, the command is finite and within all bounds.

        Parameters
        ----------
        now_s : float
            In the clock of the loop.
        posture : Posture
            The robot's now.
        perception : Perception, optional

        Returns
        -------
        Command
        Threat
        """
        if perception is not None:
            self.tracker.see(perception.time_s, perception.keypoints_m, perception.scores, now_s)
        threat = self.threat(now_s, posture)
        if not now_s - self.tracker.latest_s <= self.blind_after_s:
            return self._stop(now_s, f"no perception in the last {self.blind_after_s:g} s"), threat
        try:
            velocities = self.controller.velocities(posture, threat.obstacles if self.avoids else [])
        except NoSolution as error:
            return self._stop(now_s, str(error)), threat
        status = AVOIDING if self.avoids and threat.is_close else FREE
        return Command(now_s, velocities, status), threat

    def threat(self, now_s: float, posture: Posture) -> Threat:
        """Activations by the currently trusted keypoints, and the resulting obstacles.

        Parameters
        ----------
        now_s : float
        posture : Posture

        Returns
        -------
        Threat
        """
        points, weights = self.tracker.points(now_s)
        positions, normals = self.skin.in_root(self.controller.icub, posture)
        activations = self.sensing.activations(positions, normals, points.reshape(-1, 3), weights.ravel())
        return Threat(activations, obstacles(self.skin, activations, self.controller.settings.onset))

    def _stop(self, now_s: float, reason: str) -> Command:
        self.controller.stop()
        return Command(now_s, np.zeros(len(self.controller.rest_rad)), STOPPED, reason)
