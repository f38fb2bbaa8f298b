"""The camera on the robot's head: image and depth image, detector, lifting; and an external view.

The camera is on the moving robot and sees the robot's own arms; keypoints on them are removed, since the
robot's pose is known. The external view shows the whole robot.
"""

import time
from collections.abc import MutableMapping
from dataclasses import dataclass, field, replace

import numpy as np

from hicp_lib.core.camera import transform
from hicp_lib.core.detections import Detections, Detector
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.experiments.avoidance.closed_loop import MOUNT, start_posture
from hicp_lib.experiments.avoidance.reaching import LOOKED_AT_S, Moment
from hicp_lib.experiments.laboratory import COLOUR, T_WORLD_ROOT, colour_and_depth, robot_camera
from hicp_lib.lifting.robust import METHODS, lift_robust
from hicp_lib.robot.kinematics import ICub, load_icub
from hicp_lib.robot.loop import Perception
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.segments import filter_self
from hicp_lib.robot.shape import robot_shape
from hicp_lib.simulation.appearance.materials import plain
from hicp_lib.simulation.rendering.camera import PlacedCamera, look_at
from hicp_lib.simulation.rendering.colour_sensor import Sensor, expose
from hicp_lib.simulation.rendering.mesh import Mesh, quad, vertex_normals
from hicp_lib.simulation.rendering.render import World, render
from hicp_lib.simulation.rendering.surfaces import Look, Surface

RgbdImage = tuple[np.ndarray, np.ndarray]
"""Image (480, 640, 3), RGB uint8, and depth in metres (480, 640)."""
ImageCache = MutableMapping[Moment, RgbdImage]
_AT_POST_RAD = 2e-3  # a robot without a threat moves less


@dataclass(frozen=True, eq=False)
class Observation:
    """One image and its results.

    Attributes
    ----------
    moment : Moment
    posture : robot.posture.Posture
        The robot's.
    rgb : array, shape (480, 640, 3), dtype uint8
    detections : Detections
    perception : Perception
        Without the robot's own body.
    time_ms : float
        Time of detector and lifting on this machine. It does not influence the simulation.
    """

    moment: Moment
    posture: Posture
    rgb: np.ndarray
    detections: Detections
    perception: Perception
    time_ms: float


@dataclass(eq=False)
class HeadCamera:
    """The camera on the head with a detector; stores its observations.

    Attributes
    ----------
    detector : Detector
        Run on the images.
    lifting : str
        One of `hicp_lib.lifting.robust.METHODS`.
    images : mapping
        Images taken at the robot's post, which all detectors share until it first moves.
    observations : list of Observation
        All so far.
    """

    detector: Detector
    lifting: str = "robust"
    images: ImageCache = field(default_factory=dict)
    observations: list[Observation] = field(default_factory=list)

    def perceive(self, moment: Moment, posture: Posture, read: Posture) -> Perception:
        """Render the view, detect people and lift them, without what is on the robot; store the observation.

        Outside `LOOKED_AT_S` nothing is rendered or detected.

        Parameters
        ----------
        moment : Moment
        posture : Posture
            The robot's.
        read : Posture
            The same as measured by the robot.

        Returns
        -------
        Perception
        """
        if not LOOKED_AT_S[0] <= moment.time_s <= LOOKED_AT_S[1]:
            return Perception(moment.time_s, np.zeros((0, N_KEYPOINTS, 3)), np.zeros((0, N_KEYPOINTS)))
        rgb, depth_m = self._image(moment, posture)
        start_s = time.perf_counter()
        found, icub = self.detector.detect(rgb), load_icub()
        points_cam_m = lift_robust(found.keypoints_px, depth_m, COLOUR, METHODS[self.lifting]).points_m
        T_root_camera = icub.T_root_camera(read.angles("head"), MOUNT)
        points_m = filter_self(icub, read, transform(T_root_camera, points_cam_m))
        perception = Perception(moment.time_s, points_m, found.scores)
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
    """An image of the camera on the head.

    Parameters
    ----------
    moment : Moment
        Its subject and time determine the noise.
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
    return colour_and_depth(render(world, camera), camera, rng)


_GLOSS, _ROUGHNESS = 0.04, 0.35  # of painted covers


def robot_surfaces(icub: ICub, posture: Posture, whole: bool = False) -> list[Surface]:
    """The robot in the world.

    Parameters
    ----------
    icub : ICub
    posture : Posture
    whole : bool, optional
        With the parts that the camera on its head does not see.

    Returns
    -------
    list of Surface
    """
    shape = robot_shape(icub, posture)
    vertices_m = transform(T_WORLD_ROOT, shape.vertices_m).astype(np.float32)
    triangles = shape.triangles if whole else shape.triangles[~shape.unseen]
    normals = vertex_normals(vertices_m, triangles)
    return [Surface(Mesh(vertices_m, triangles, normals, shape.colours), _painted)]


def _painted(coords: np.ndarray, footprint_m: np.ndarray) -> Look:
    return Look(coords, gloss=_GLOSS, roughness=_ROUGHNESS)


_EYE_M, _TARGET_M = (-2.0, 0.42, 1.35), (0.0, 0.45, 0.85)  # world: from the robot's left, a little from above
CAMERA = PlacedCamera(480, 384, 490.0, 490.0, 239.5, 191.5, look_at(_EYE_M, _TARGET_M))
_SENSOR = Sensor(np.ones(3), exposure=1.15, blur_px=0.35, vignette=0.0, shot_noise=0.0, read_noise=0.0)
_FLOOR = Surface(quad([-6, -6, 0], [12, 0, 0], [0, 12, 0]), plain(np.full(3, 0.62), 0.9, 0.0))
_BACKDROP = np.full(3, 0.75)
_SHARP = 1  # a person index, so that it is rendered at every pixel
_MARGIN_M = 0.35  # objects this close to the person belong to the scene, such as the chair


def onlooker_view(world: World, robot: list[Surface]) -> np.ndarray:
    """Robot and person without the room around them.

    Parameters
    ----------
    world : World
        With the person, without the robot.
    robot : list of Surface

    Returns
    -------
    array, shape (384, 480, 3), dtype uint8
        RGB, as `CAMERA` takes it.
    """
    people = [surface for surface in world.surfaces if surface.person >= 0]
    places_m = np.concatenate([surface.mesh.vertices_m for surface in people])
    low, high = places_m.min(axis=0) - _MARGIN_M, places_m.max(axis=0) + _MARGIN_M
    others = [surface for surface in world.surfaces if surface.person < 0]
    near = [s for s in others if (s.mesh.vertices_m > low).all() and (s.mesh.vertices_m < high).all()]
    sharp = [replace(surface, person=_SHARP) for surface in [*robot, *near]]
    rng = np.random.default_rng(0)
    frame = render(replace(world, surfaces=[_FLOOR, *people, *sharp], backdrop=_BACKDROP), CAMERA)
    return expose(frame.radiance, _SENSOR, rng, frame.person >= 0)
