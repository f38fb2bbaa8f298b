"""The camera on the robot's head: an image and a depth image, a detector, the lifting.

The camera sits on the moving robot and sees the robot's own arms; keypoints on them are left out, since
where the robot is, is known.
"""

import time
from collections.abc import MutableMapping
from dataclasses import dataclass, field

import numpy as np

from hicp_lib.core.camera import transform
from hicp_lib.core.detections import Detections, Detector
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.experiments.avoidance.closed_loop import MOUNT, Latency, start_posture
from hicp_lib.experiments.avoidance.reaching import LOOKED_AT_S, Moment
from hicp_lib.experiments.avoidance.robot_surfaces import robot_surfaces
from hicp_lib.experiments.laboratory import COLOUR, colour_and_depth, robot_camera
from hicp_lib.lifting.robust import METHODS, lift_robust
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.robot.loop import Perception
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.segments import filter_self
from hicp_lib.simulation.rendering.render import render

RgbdImage = tuple[np.ndarray, np.ndarray]
"""Image (480, 640, 3), RGB uint8, and depth in metres (480, 640)."""
ImageCache = MutableMapping[Moment, RgbdImage]
_AT_POST_RAD = 2e-3  # a robot that nobody threatens moves less


@dataclass(frozen=True, eq=False)
class Observation:
    """One image and what was made of it.

    Attributes
    ----------
    moment : Moment
    posture : robot.posture.Posture
        The robot's.
    rgb : array, shape (480, 640, 3), dtype uint8
    detections : Detections
    perception : Perception
        The robot's own body left out.
    time_ms : float
        What detector and lifting took on this machine. It moves nothing that is simulated.
    """

    moment: Moment
    posture: Posture
    rgb: np.ndarray
    detections: Detections
    perception: Perception
    time_ms: float


@dataclass(eq=False)
class HeadCamera:
    """The camera on the head with a detector behind it; keeps what it saw.

    Attributes
    ----------
    detector : Detector
        Looks at the images.
    latency : Latency
        From image to keypoints in the loop.
    lifting : str
        One of `hicp_lib.lifting.robust.METHODS`.
    images : mapping
        Images taken from the robot's post; until it first gives way, all detectors see the same.
    observations : list of Observation
        All so far.
    """

    detector: Detector
    latency: Latency
    lifting: str = "robust"
    images: ImageCache = field(default_factory=dict)
    observations: list[Observation] = field(default_factory=list)

    def perceive(self, moment: Moment, posture: Posture, read: Posture) -> Perception:
        """Render what is to be seen, find people and lift them; remember all of it.

        Outside `LOOKED_AT_S` nothing is rendered, and nobody found.

        Parameters
        ----------
        moment : Moment
        posture : Posture
            The robot's.
        read : Posture
            The same as the robot knows it.

        Returns
        -------
        Perception
        """
        if not LOOKED_AT_S[0] <= moment.time_s <= LOOKED_AT_S[1]:
            return Perception(moment.time_s, np.zeros((0, N_KEYPOINTS, 3)), np.zeros((0, N_KEYPOINTS)))
        rgb, depth_m = self._image(moment, posture)
        start_s = time.perf_counter()
        found = self.detector.detect(rgb)
        perception = lifted(found, depth_m, moment.time_s, read, self.lifting)
        elapsed_ms = 1e3 * (time.perf_counter() - start_s)
        self.observations.append(Observation(moment, posture, rgb, found, perception, elapsed_ms))
        return perception

    def _image(self, moment: Moment, posture: Posture) -> RgbdImage:
        post = start_posture()
        if not np.allclose(posture.angles("left"), post.angles("left"), rtol=0, atol=_AT_POST_RAD):
            return photograph(moment, posture)
        taken = self.images.get(moment)
        if taken is None:
            taken = self.images[moment] = photograph(moment, post)
        return taken


def photograph(moment: Moment, posture: Posture) -> RgbdImage:
    """What the camera on the head takes.

    Parameters
    ----------
    moment : Moment
        Its subject and time draw the noise.
    posture : Posture
        The robot's.

    Returns
    -------
    rgb : array, shape (480, 640, 3), dtype uint8
    depth_m : array, shape (480, 640), dtype float32
    """
    icub, rng = load_icub(), moment.subject.stream(moment.script, round(1000 * moment.time_s))
    camera = robot_camera(icub.T_root_camera(posture.angles("head"), MOUNT))
    world = moment.world(robot_surfaces(icub, posture))
    return colour_and_depth(render(world, camera, rng), camera, rng)


def lifted(
    found: Detections, depth_m: np.ndarray, time_s: float, posture: Posture, method: str = "robust"
) -> Perception:
    """Keypoints in the root frame, without those on the robot's own body.

    Parameters
    ----------
    found : Detections
    depth_m : array, shape (480, 640)
    time_s : float
        When the image was taken.
    posture : Posture
        The robot's, then.
    method : str, optional
        One of `hicp_lib.lifting.robust.METHODS`.

    Returns
    -------
    Perception
    """
    icub = load_icub()
    in_camera = lift_robust(found.keypoints_px, depth_m, COLOUR, METHODS[method])
    T_root_camera = icub.T_root_camera(posture.angles("head"), MOUNT)
    points_m = filter_self(icub, posture, transform(T_root_camera, in_camera.points_m))
    return Perception(time_s, points_m, found.scores)
