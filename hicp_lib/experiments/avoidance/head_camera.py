"""Eyes that look: an image and a depth image from the robot's head, a detector, the lifting.

The camera sits on the moving robot and sees the robot's own arms; keypoints on them are left out, since
where the robot is, is known.
"""

from __future__ import annotations

import time
from collections.abc import MutableMapping
from dataclasses import dataclass, field

import numpy as np

from hicp_lib.core.camera import transform
from hicp_lib.core.detections import Detections, Detector
from hicp_lib.experiments.avoidance.closed_loop import MOUNT, start_posture
from hicp_lib.experiments.avoidance.reaching import Script
from hicp_lib.experiments.avoidance.robot_surfaces import robot_surfaces
from hicp_lib.experiments.laboratory import COLOUR, PHOTOGRAPHIC, robot_camera
from hicp_lib.lifting.paper import lift
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.robot.loop import Perception
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.self_filter import filter_self
from hicp_lib.simulation.rendering.colour_sensor import expose
from hicp_lib.simulation.rendering.render import render
from hicp_lib.simulation.sensors.depth_camera import D435, simulate_depth

Photograph = tuple[np.ndarray, np.ndarray]
"""Image (480, 640, 3), RGB uint8, and depth in metres (480, 640)."""
Album = MutableMapping[tuple, Photograph]
_AT_POST_RAD = 1e-6  # a robot that nobody threatens moves less


@dataclass(frozen=True, eq=False)
class Sight:
    """One image and what was made of it; `perception` has the robot's own body left out.

    `time_ms` is what detector and lifting took on this machine. It moves nothing that is simulated.
    """

    rgb: np.ndarray
    detections: Detections
    perception: Perception
    time_ms: float


@dataclass(eq=False)
class DetectorEyes:
    """A detector behind the camera on the head; keeps what it saw.

    Attributes
    ----------
    detector : looks at the images
    delay_s : from image to keypoints in the loop
    seed : of the noise of both cameras
    album : photographs taken from the robot's post; until it first gives way, all detectors see the same
    sights : all images so far
    """

    detector: Detector
    delay_s: float
    seed: int = 0
    album: Album = field(default_factory=dict)
    sights: list[Sight] = field(default_factory=list)

    def see(self, script: Script, time_s: float, posture: Posture) -> Perception:
        """Render what is to be seen, find people and lift them; remember all of it."""
        rgb, depth_m = self._photograph(script, time_s, posture)
        start_s = time.perf_counter()
        found = self.detector.detect(rgb)
        perception = perceived(found, depth_m, time_s, posture)
        self.sights.append(Sight(rgb, found, perception, 1e3 * (time.perf_counter() - start_s)))
        return perception

    def _photograph(self, script: Script, time_s: float, posture: Posture) -> Photograph:
        angles, post = posture.angles("left"), start_posture().angles("left")
        if not np.allclose(angles, post, rtol=0, atol=_AT_POST_RAD):
            return photograph(script, time_s, posture, self.seed)
        key = (script.name, self.seed, time_s, angles.tobytes())
        taken = self.album.get(key)
        if taken is None:
            taken = self.album[key] = photograph(script, time_s, posture, self.seed)
        return taken


def photograph(script: Script, time_s: float, posture: Posture, seed: int) -> Photograph:
    """Image (480, 640, 3) and depth in metres (480, 640) from the robot's head."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, round(1000 * time_s)]))
    icub = load_icub()
    camera = robot_camera(COLOUR, icub.T_root_camera(posture.angles("head"), MOUNT))
    world, _ = script.at(time_s, robot_surfaces(icub, posture))
    frame = render(world, camera, rng)
    rgb = expose(frame.radiance, PHOTOGRAPHIC, rng, frame.person >= 0)
    return rgb, simulate_depth(frame.rays, camera, D435, rng)


def perceived(found: Detections, depth_m: np.ndarray, time_s: float, posture: Posture) -> Perception:
    """Keypoints in the root frame, without those on the robot's own body."""
    icub = load_icub()
    in_camera_m = lift(found.keypoints_px, depth_m, COLOUR).points_m
    T_root_camera = icub.T_root_camera(posture.angles("head"), MOUNT)
    points_m = filter_self(icub, posture, transform(T_root_camera, in_camera_m))
    return Perception(time_s, points_m, found.scores)
