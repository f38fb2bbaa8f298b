"""The laboratory: a robot on its stand, who is before it, furniture, light and the robot's camera.

World frame: z up, floor at z = 0, metres. The robot faces the world's y axis; its root frame (x
backward, y to its right, z up) lies above the world's origin, as high as when an iCub stands upright
on its stand: 0.6 m above the floor is assumed. The robot itself is not drawn.
"""

from __future__ import annotations

import numpy as np

from hicp_lib.core.camera import Camera
from hicp_lib.simulation.appearance import materials as m
from hicp_lib.simulation.appearance.people import Appearance, random_appearance
from hicp_lib.simulation.body.model import load_body
from hicp_lib.simulation.rendering import lights
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.camera import PlacedCamera
from hicp_lib.simulation.rendering.colour_sensor import Sensor
from hicp_lib.simulation.rendering.render import World
from hicp_lib.simulation.rendering.surfaces import Surface
from hicp_lib.simulation.world.room import make_room

Rng = np.random.Generator

ROOT_HEIGHT_M = 0.6
T_WORLD_ROOT = np.array([[0.0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, ROOT_HEIGHT_M], [0, 0, 0, 1]])
COLOUR = Camera(640, 480, 616.591, 616.765, 318.482, 241.167)
"""Camera of a real D435's colour camera (data sheet values differ from unit to unit)."""
PHOTOGRAPHIC = Sensor(
    np.ones(3), exposure=0.9, blur_px=0.6, vignette=0.15, shot_noise=0.012, read_noise=0.003, contrast=1.1
)
"""The colour camera's rendition: that of a good webcam."""


def robot_camera(intrinsics: Camera, T_root_camera: np.ndarray) -> PlacedCamera:
    """The camera on the robot's head, from its pose (4, 4) in the root frame."""
    i = intrinsics
    return PlacedCamera(
        i.width_px, i.height_px, i.fx_px, i.fy_px, i.cx_px, i.cy_px, T_WORLD_ROOT @ T_root_camera
    )


def facing_robot(y_m: float, x_m: float = 0.0) -> np.ndarray:
    """T_world_body (4, 4) of a person on the floor at (x, y) who faces the robot."""
    T_world_body = np.eye(4)
    T_world_body[:2, :2] = [[0, 1], [-1, 0]]
    T_world_body[:2, 3] = x_m, y_m
    return T_world_body


def adult(rng: Rng) -> Appearance:
    """A random adult in trousers: a skirt would have to drape over a seat."""
    while True:
        appearance = random_appearance(rng)
        name = load_body().shape_names[int(np.argmax(appearance.shape))]
        if appearance.skirt is None and not name.startswith(("girl", "boy")):
            return appearance


def furnished(rng: Rng, surfaces: list[Surface], clear_m: list[tuple[float, float, float]]) -> World:
    """A lit room around surfaces; no furniture within the discs (x, y, radius) of `clear_m`."""
    room = make_room(rng, np.array([(0.0, 0.0, 0.6), *clear_m]))
    return World([*room.surfaces, *surfaces], *_lighting(room.height_m), backdrop=np.zeros(3))


def table(rng: Rng, low_m: tuple[float, float], high_m: tuple[float, float], height_m: float) -> Surface:
    """A table whose top spans from `low_m` to `high_m` (x, y), its surface at `height_m`."""
    (x0, y0), (x1, y1) = low_m, high_m
    boxes = [((x0, y0, height_m - 0.03), (x1, y1, height_m))]
    boxes += [
        ((x, y, 0.0), (x + 0.05, y + 0.05, height_m - 0.03))
        for x in (x0 + 0.03, x1 - 0.08)
        for y in (y0 + 0.03, y1 - 0.08)
    ]
    return _boxes(boxes, m.wooden(rng))


def chair(rng: Rng, middle_m: tuple[float, float], seat_m: float) -> list[Surface]:
    """A chair that faces the robot: its seat's middle (x, y) and height; the back is behind it."""
    x, y = middle_m
    half, back = 0.215, y + 0.2
    legs = [
        ((x + dx - 0.018, y + dy - 0.018, 0.0), (x + dx + 0.018, y + dy + 0.018, seat_m - 0.045))
        for dx in (-half + 0.03, half - 0.03)
        for dy in (-half + 0.03, half - 0.03)
    ]
    posts = [
        ((x + dx - 0.015, back, seat_m - 0.045), (x + dx + 0.015, back + 0.03, seat_m + 0.42))
        for dx in (-half + 0.04, half - 0.04)
    ]
    cushions = [
        ((x - half, y - half, seat_m - 0.045), (x + half, y + half, seat_m)),
        ((x - half + 0.01, back - 0.025, seat_m + 0.14), (x + half - 0.01, back, seat_m + 0.42)),
    ]
    return [
        _boxes(legs + posts, m.plain(np.full(3, 0.08), 0.3)),
        _boxes(cushions, m.upholstery(rng)),
    ]


def _boxes(spans: list, material: m.Material) -> Surface:
    low, high = np.array(spans, np.float32).swapaxes(0, 1)
    return Surface(g.boxes(low, high), material)


def _lighting(height_m: float) -> tuple[list[lights.Light], lights.Ambient]:
    """Two rows of tubes at the ceiling, and what walls and floor return of it."""
    tubes = [
        lights.Light(
            np.array([x, 0.3, height_m - 0.1]), np.array([0.1, 0, 0]), np.array([0, 0.75, 0]), np.full(3, 3.2)
        )
        for x in (-0.9, 0.9)
    ]
    grey = np.ones(3)
    return tubes, lights.Ambient(0.42 * grey, 0.3 * grey, 0.25 * grey, np.array([0, -1.0, 0]))
