"""A motion capture system like Qualisys': cameras around the room, markers, noise and dropouts.

A marker is measured while at least two cameras see it, with an error of a fraction of a millimetre.
Trajectories too short to be identified again are lost. The system has its own world frame: z up, with origin
and heading set by the calibration frame on the ground.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import binary_opening

from hicp_lib.core.camera import transform
from hicp_lib.core.rotations import rotation
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.simulation.body.model import PosedBody
from hicp_lib.simulation.rendering.camera import join_rays
from hicp_lib.simulation.rendering.mesh import Mesh
from hicp_lib.simulation.rendering.raycast import RayScene
from hicp_lib.simulation.sensors.markers import body_scene, markers_m

Rng = np.random.Generator


@dataclass(frozen=True)
class MocapSystem:
    """The system and its errors.

    Attributes
    ----------
    rate_hz : float
        Measurements per second.
    noise_m : float
        Standard deviation of each coordinate; 0 for none.
    min_cameras : int
        Number of cameras that must see a marker.
    shortest_s : float
        Trajectories between dropouts that are shorter are lost; 0 keeps them.
    n_cameras : int
        Number of cameras on a ring around the scene.
    ring_m, height_m : float
        Its radius and height.
    """

    rate_hz: float = 100.0
    noise_m: float = 0.0003
    min_cameras: int = 2
    shortest_s: float = 0.05
    n_cameras: int = 8
    ring_m: float = 3.0
    height_m: float = 2.4


QUALISYS = MocapSystem()
"""Eight cameras, 100 measurements a second, 0.3 mm."""


def room_cameras_m(system: MocapSystem, middle_m: np.ndarray) -> np.ndarray:
    """Positions of the system's cameras, (n_cameras, 3), around a place on the floor (x, y).

    Examples
    --------
    >>> room_cameras_m(QUALISYS, np.zeros(2)).shape
    (8, 3)
    """
    angle = 2 * np.pi * (np.arange(system.n_cameras) + 0.5) / system.n_cameras
    ring = np.c_[np.cos(angle), np.sin(angle)] * system.ring_m + np.asarray(middle_m, float)[:2]
    return np.c_[ring, np.full(system.n_cameras, system.height_m)]


def count_seeing(scene: RayScene, points_m: np.ndarray, cameras_m: np.ndarray) -> np.ndarray:
    """Number of cameras that see each marker past the objects in the scene.

    Parameters
    ----------
    scene : RayScene
    points_m : array, shape (m, 3)
        The markers.
    cameras_m : array, shape (n_cameras, 3)

    Returns
    -------
    array of int, shape (m,)
    """
    m, c = len(points_m), len(cameras_m)
    start = np.repeat(points_m, c, axis=0)
    hidden = scene.occluded(join_rays(start.T, (np.tile(cameras_m, (m, 1)) - start).T))
    return (~hidden).reshape(m, c).sum(axis=1)


def track_markers(
    person_at: Callable[[float], PosedBody],
    vertices: np.ndarray,
    fixed_m: np.ndarray,
    times_s: np.ndarray,
    cameras_m: np.ndarray,
    every: int = 4,
    obstacles: tuple[Mesh, ...] = (),
) -> tuple[np.ndarray, np.ndarray]:
    """Trajectories of the markers on a moving person, and of fixed markers.

    Parameters
    ----------
    person_at : callable
        From seconds to the person, posed in the world; while they keep still, the same object saves time.
    vertices : array of int, shape (12,)
        Where the markers are on the person's skin.
    fixed_m : array, shape (k, 3)
        Markers that do not move.
    times_s : array, shape (n,)
        Increasing.
    cameras_m : array, shape (n_cameras, 3)
    every : int, optional
        The person is posed at every n-th time; splines interpolate between.
    obstacles : tuple of Mesh, optional
        Further occluders.

    Returns
    -------
    markers_m : array, shape (n, 12 + k, 3)
        True centres in the world.
    n_seeing : array of int, shape (n, 12 + k)
        How many cameras see each.
    """
    at = np.unique(np.append(np.arange(0, len(times_s), every), len(times_s) - 1))
    found, seeing, before = [], [], None
    for time_s in times_s[at]:
        person = person_at(float(time_s))
        if person is not before:
            markers = np.concatenate([markers_m(person, vertices), np.reshape(fixed_m, (-1, 3))])
            n_seeing = count_seeing(body_scene(person, obstacles), markers, cameras_m)
        found.append(markers)
        seeing.append(n_seeing)
        before = person
    nearest = np.rint(np.interp(np.arange(len(times_s)), at, np.arange(len(at)))).astype(int)
    followed = CubicSpline(times_s[at], found)(times_s) if len(at) > 1 else np.array(found)
    return followed, np.array(seeing)[nearest]


def mocap_frame(rng: Rng) -> np.ndarray:
    """T_mocap_world (4, 4): a world frame set by a manually placed calibration frame."""
    T_mocap_world = np.eye(4)
    tilt = rng.normal(0, np.radians(0.2), 3) * [1, 1, 0]  # of the floor
    T_mocap_world[:3, :3] = rotation(tilt) @ rotation([0, 0, rng.uniform(-np.pi, np.pi)])
    T_mocap_world[:3, 3] = rng.normal(0, [1.0, 1.0, 0.003])
    return T_mocap_world


def measure(
    times_s: np.ndarray,
    names: tuple[str, ...],
    points_m: np.ndarray,
    n_seeing: np.ndarray,
    T_mocap_world: np.ndarray,
    system: MocapSystem,
    rng: Rng,
) -> MotionCapture:
    """The system's measurements of moving markers.

    Parameters
    ----------
    times_s : array, shape (n,)
        On the system's clock, 1 / system.rate_hz apart.
    names : tuple of str
        Of the m markers.
    points_m : array, shape (n, m, 3)
        Their true centres in the world.
    n_seeing : array of int, shape (n, m)
        How many cameras see each.
    T_mocap_world : array, shape (4, 4)
        Into the system's frame.
    system : MocapSystem
    rng : numpy.random.Generator
        Of the noise.

    Returns
    -------
    MotionCapture
    """
    shortest = max(1, int(round(system.shortest_s * system.rate_hz)))
    seen = np.asarray(n_seeing) >= system.min_cameras
    measured = binary_opening(seen, np.ones((shortest, 1)))  # without shorter runs
    in_mocap_m = transform(T_mocap_world, np.reshape(points_m, (-1, 3))).reshape(np.shape(points_m))
    in_mocap_m = in_mocap_m + system.noise_m * rng.standard_normal(in_mocap_m.shape)
    in_mocap_m[~measured] = np.nan
    return MotionCapture(np.asarray(times_s, float), tuple(names), in_mocap_m, system.rate_hz)
