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
from hicp_lib.experiments.avoidance.closed_loop import MOUNT, start_posture
from hicp_lib.experiments.avoidance.reaching import Script
from hicp_lib.experiments.avoidance.robot_surfaces import robot_surfaces
from hicp_lib.experiments.laboratory import COLOUR, colour_and_depth, robot_camera
from hicp_lib.lifting.paper import lift
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.robot.loop import Perception
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.self_filter import filter_self
from hicp_lib.simulation.rendering.render import render

RgbdImage = tuple[np.ndarray, np.ndarray]
"""Image (480, 640, 3), RGB uint8, and depth in metres (480, 640)."""
ImageCache = MutableMapping[tuple, RgbdImage]
_AT_POST_RAD = 1e-6  # a robot that nobody threatens moves less


@dataclass(frozen=True, eq=False)
class Observation:
    """One image and what was made of it.

    Attributes
    ----------
    rgb : array, shape (480, 640, 3), dtype uint8
    detections : Detections
    perception : Perception
        The robot's own body left out.
    time_ms : float
        What detector and lifting took on this machine. It moves nothing that is simulated.
    """

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
    delay_s : float
        From image to keypoints in the loop.
    images : mapping
        Images taken from the robot's post; until it first gives way, all detectors see the same.
    observations : list of Observation
        All so far.
    """

    detector: Detector
    delay_s: float
    images: ImageCache = field(default_factory=dict)
    observations: list[Observation] = field(default_factory=list)

    def perceive(self, script: Script, time_s: float, posture: Posture) -> Perception:
        """Render what is to be seen, find people and lift them; remember all of it.

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
        rgb, depth_m = self._image(script, time_s, posture)
        start_s = time.perf_counter()
        found = self.detector.detect(rgb)
        perception = lifted(found, depth_m, time_s, posture)
        elapsed_ms = 1e3 * (time.perf_counter() - start_s)
        self.observations.append(Observation(rgb, found, perception, elapsed_ms))
        return perception

    def _image(self, script: Script, time_s: float, posture: Posture) -> RgbdImage:
        angles, post = posture.angles("left"), start_posture().angles("left")
        if not np.allclose(angles, post, rtol=0, atol=_AT_POST_RAD):
            return photograph(script, time_s, posture)
        key = (script.name, script.subject, time_s, angles.tobytes())
        taken = self.images.get(key)
        if taken is None:
            taken = self.images[key] = photograph(script, time_s, posture)
        return taken


def photograph(script: Script, time_s: float, posture: Posture) -> RgbdImage:
    """What the camera on the head takes.

    Parameters
    ----------
    script : Script
    time_s : float
        From the script's beginning.
    posture : Posture
        The robot's.

    Returns
    -------
    rgb : array, shape (480, 640, 3), dtype uint8
    depth_m : array, shape (480, 640), dtype float32
    """
    icub, rng = load_icub(), script.subject.stream(script.name, round(1000 * time_s))
    camera = robot_camera(icub.T_root_camera(posture.angles("head"), MOUNT))
    world, _ = script.at(time_s, robot_surfaces(icub, posture))
    return colour_and_depth(render(world, camera, rng), camera, rng)


def lifted(found: Detections, depth_m: np.ndarray, time_s: float, posture: Posture) -> Perception:
    """Keypoints in the root frame, without those on the robot's own body.

    Parameters
    ----------
    found : Detections
    depth_m : array, shape (480, 640)
    time_s : float
        When the image was taken.
    posture : Posture
        The robot's, then.

    Returns
    -------
    Perception
    """
    icub = load_icub()
    in_camera_m = lift(found.keypoints_px, depth_m, COLOUR).points_m
    T_root_camera = icub.T_root_camera(posture.angles("head"), MOUNT)
    points_m = filter_self(icub, posture, transform(T_root_camera, in_camera_m))
    return Perception(time_s, points_m, found.scores)
