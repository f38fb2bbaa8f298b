"""The robot as a surface to render: its own camera sees its arms, and an onlooker all of it."""

from dataclasses import replace

import numpy as np

from hicp_lib.core.camera import transform
from hicp_lib.experiments.laboratory import T_WORLD_ROOT
from hicp_lib.robot.kinematics import ICub
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.shape import robot_shape
from hicp_lib.simulation.appearance.materials import plain
from hicp_lib.simulation.rendering.camera import PlacedCamera, look_at
from hicp_lib.simulation.rendering.colour_sensor import Sensor, expose
from hicp_lib.simulation.rendering.mesh import Mesh, quad, vertex_normals
from hicp_lib.simulation.rendering.render import World, render
from hicp_lib.simulation.rendering.surfaces import Look, Surface

_GLOSS, _ROUGHNESS = 0.04, 0.35  # of painted covers


def robot_surfaces(icub: ICub, posture: Posture, whole: bool = False) -> list[Surface]:
    """The robot in the world.

    Parameters
    ----------
    icub : ICub
    posture : Posture
    whole : bool, optional
        With what the camera on its own head does not see.

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
_SHARP = 1  # an owner: what belongs to somebody is drawn at every pixel
_MARGIN_M = 0.35  # what lies within this of the person belongs to the scene, such as their chair


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
    frame = render(replace(world, surfaces=[_FLOOR, *people, *sharp], backdrop=_BACKDROP), CAMERA, rng)
    return expose(frame.radiance, _SENSOR, rng, frame.person >= 0)
