"""The laboratory: a robot on its stand, a person in front of it, furniture, light and the robot's camera.

World frame: z up, floor at z = 0, metres. The robot faces the world's y axis; its root frame (x backward, y
to its right, z up) lies above the world's origin, at the height of an iCub on its stand: 0.6 m above the
floor is assumed. The robot itself is not drawn.
"""

from itertools import product

import numpy as np

from hicp_lib.core.camera import Camera, transform
from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json
from hicp_lib.experiments.minimum_jerk import Posture
from hicp_lib.simulation.appearance import materials as m
from hicp_lib.simulation.body.identities import Identity
from hicp_lib.simulation.body.joints import pose_from_joints
from hicp_lib.simulation.body.model import PosedBody, load_body, pose_body
from hicp_lib.simulation.rendering import lights
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.camera import PlacedCamera
from hicp_lib.simulation.rendering.colour_sensor import Sensor, expose
from hicp_lib.simulation.rendering.render import Frame, World
from hicp_lib.simulation.rendering.surfaces import Surface
from hicp_lib.simulation.sensors.depth_camera import DepthCamera, simulate_depth
from hicp_lib.simulation.sensors.stereo_camera import D435
from hicp_lib.simulation.world.furniture import legs
from hicp_lib.simulation.world.room import make_room

Rng = np.random.Generator

MOVEMENTS = read_json(DATA_DIR / "movements.json")
"""Behaviour in experiments: joint angles (degrees; one is sampled between two), and doses."""
PELVIS_LEAN = "pelvis_flexion"  # a joint of postures only: the whole trunk bends at the hips
ROOT_HEIGHT_M = 0.6
T_WORLD_ROOT = np.array([[0.0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, ROOT_HEIGHT_M], [0, 0, 0, 1]])
COLOUR = Camera(640, 480, 616.591, 616.765, 318.482, 241.167)
"""Camera of a real D435's colour camera (data sheet values differ from unit to unit)."""
PHOTOGRAPHIC = Sensor(
    np.ones(3), exposure=0.9, blur_px=0.6, vignette=0.15, shot_noise=0.012, read_noise=0.003, contrast=1.1
)
"""The colour camera's image quality: that of a good webcam."""


def robot_camera(T_root_camera: np.ndarray) -> PlacedCamera:
    """The colour camera on the robot's head, from its pose (4, 4) in the root frame.

    Examples
    --------
    >>> robot_camera(np.eye(4)).centre_m  # in the world
    array([0. , 0. , 0.6])
    """
    return PlacedCamera(**vars(COLOUR), T_world_camera=T_WORLD_ROOT @ T_root_camera)


def colour_and_depth(
    frame: Frame, camera: PlacedCamera, rng: Rng, depth_camera: DepthCamera = D435
) -> tuple[np.ndarray, np.ndarray]:
    """Images of a frame by the depth camera on the robot's head.

    Parameters
    ----------
    frame : Frame
    camera : PlacedCamera
        The camera of the frame.
    rng : numpy.random.Generator
        Of the noise of both sensors.
    depth_camera : DepthCamera, optional
        Does not affect the colour image.

    Returns
    -------
    rgb : array, shape (480, 640, 3), dtype uint8
    depth_m : array, shape (480, 640), dtype float32
        Aligned to the colour image; NaN for none.
    """
    rgb = expose(frame.radiance, PHOTOGRAPHIC, rng, frame.person >= 0)
    return rgb, simulate_depth(frame.rays, camera, depth_camera, rng)


def in_root(points_m: np.ndarray) -> np.ndarray:
    """Points (..., 3) of the world in the robot's root frame."""
    return transform(np.linalg.inv(T_WORLD_ROOT), points_m)


def facing_robot(y_m: float, x_m: float = 0.0) -> np.ndarray:
    """T_world_body (4, 4) of a person on the floor at (x, y) who faces the robot."""
    T_world_body = np.eye(4)
    T_world_body[:2, :2] = [[0, 1], [-1, 0]]
    T_world_body[:2, 3] = x_m, y_m
    return T_world_body


def posed(shape: str, posture: Posture) -> PosedBody:
    """A person in a posture, facing the robot; `PELVIS_LEAN` tilts the pelvis, the legs stay."""
    joints = dict(posture.joints)
    lean = joints.pop(PELVIS_LEAN, 0.0)
    for side in ("left", "right"):
        joints[f"{side}_hip_flexion"] = joints.get(f"{side}_hip_flexion", 0.0) + lean
    x, y = posture.place_m
    pose = {**pose_from_joints(joints), "root": np.array([0.0, lean, 0.0])}
    return pose_body(load_body(), shape, pose, facing_robot(y, x))


def furnished(
    identity: Identity, surfaces: list[Surface], clear_m: list[tuple[float, float, float]]
) -> World:
    """A lit room around surfaces.

    Parameters
    ----------
    identity : Identity
        Determines room and lights.
    surfaces : list of Surface
    clear_m : list of tuple of float
        Discs (x, y, radius) without furniture.

    Returns
    -------
    World
    """
    room = make_room(identity.draw("room"), np.array([(0.0, 0.0, 0.6), *clear_m]))
    lit = _lighting(identity.draw("lights"), room.height_m)
    return World([*room.surfaces, *surfaces], *lit, backdrop=np.zeros(3))


def table(rng: Rng, low_m: tuple[float, float], high_m: tuple[float, float], height_m: float) -> Surface:
    """A table.

    Parameters
    ----------
    rng : numpy.random.Generator
    low_m, high_m : tuple of float
        Two corners of its top (x, y).
    height_m : float
        Of the top's surface.

    Returns
    -------
    Surface
    """
    (x0, y0), (x1, y1), below_m = low_m, high_m, height_m - 0.03
    corners = product((x0 + 0.03, x1 - 0.08), (y0 + 0.03, y1 - 0.08))
    feet = [((x, y, 0.0), (x + 0.05, y + 0.05, below_m)) for x, y in corners]
    return Surface(g.boxes([((x0, y0, below_m), (x1, y1, height_m)), *feet]), m.wooden(rng))


def chair(rng: Rng, middle_m: tuple[float, float], seat_m: float) -> list[Surface]:
    """A chair that faces the robot.

    Parameters
    ----------
    rng : numpy.random.Generator
    middle_m : tuple of float
        Of its seat (x, y); the back is behind it.
    seat_m : float
        Height of its seat.

    Returns
    -------
    list of Surface
    """
    x, y = middle_m
    half, back, below_m, top_m = 0.215, y + 0.2, seat_m - 0.045, seat_m + 0.42
    inset = (-half + 0.03, half - 0.03)
    frame = legs([x + dx for dx in inset], [y + dy for dy in inset], 0.018, 0.0, below_m)
    backs = [x + dx for dx in (-half + 0.04, half - 0.04)]
    frame += [((at - 0.015, back, below_m), (at + 0.015, back + 0.03, top_m)) for at in backs]
    cushions = [
        ((x - half, y - half, below_m), (x + half, y + half, seat_m)),
        ((x - half + 0.01, back - 0.025, seat_m + 0.14), (x + half - 0.01, back, top_m)),
    ]
    frame_look, cushion_look = m.plain(np.full(3, 0.08), 0.3), m.upholstery(rng)
    return [Surface(g.boxes(frame), frame_look), Surface(g.boxes(cushions), cushion_look)]


def _lighting(rng: Rng, height_m: float) -> tuple[list[lights.Light], lights.Ambient]:
    """Two rows of tubes at the ceiling, warm or cool, and their reflection by walls and floor."""
    half_u, half_v, cool = np.array([0.1, 0, 0]), np.array([0, 0.75, 0]), rng.uniform(-0.12, 0.12)
    white = rng.uniform(0.85, 1.15) * np.array([1 - cool, 1.0, 1 + cool])
    middles = (np.array([x, 0.3, height_m - 0.1]) for x in (-0.9, 0.9))
    tubes = [lights.Light(middle, half_u, half_v, 3.2 * white) for middle in middles]
    return tubes, lights.Ambient(0.42 * white, 0.3 * white, 0.25 * white, np.array([0, -1.0, 0]))
