"""Motion capture of the person who moves: markers to be seen in the images, and what the system exports.

The system has a clock and a world frame of its own: it starts before the camera does, and the camera's
clock shows something else. What both truly are goes into `simulation.json`, for comparison only.
"""

from collections.abc import Callable

import numpy as np

from hicp_lib.core.keypoints import INDEX
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.simulation.appearance import materials as m
from hicp_lib.simulation.appearance.people import part_of_vertices
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.body.model import PosedBody, load_body
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.surfaces import Surface
from hicp_lib.simulation.sensors import motion_capture as mc
from hicp_lib.simulation.sensors.markers import CAMERA_MARKER, JOINT_MARKERS, camera_marker_m, markers_m

_LEAD_S = (0.3, 0.9)  # how long before the first frame motion capture starts; as long after the last it ends
_BALL_M = 0.006  # radius of a marker


def capture(
    person_at: Callable[[float], PosedBody],
    vertices: np.ndarray,
    T_world_camera: np.ndarray,
    obstacles: tuple[g.Mesh, ...],
    duration_s: float,
    subject: Subject,
) -> tuple[MotionCapture, np.ndarray, float]:
    """Motion capture of a person, from before the first frame on.

    Parameters
    ----------
    person_at : callable
        From seconds since the first frame to the person in the world.
    vertices : array of int, shape (12,)
        See `sensors.markers.marker_vertices`.
    T_world_camera : array, shape (4, 4)
        The camera that carries a marker too; it stays where it is.
    obstacles : tuple of g.Mesh
        What hides markers besides the person.
    duration_s : float
        From the first frame to the last.
    subject : Subject
        Who it is; draws frame, clock and noise.

    Returns
    -------
    exported : MotionCapture
        What the system exports.
    T_mocap_world : array, shape (4, 4)
    lead_s : float
        Its clock shows zero so long before the first frame.
    """
    rng = subject.stream("motion capture")
    T_mocap_world, lead_s = mc.mocap_frame(rng), float(rng.uniform(*_LEAD_S))
    n = int(round((duration_s + 2 * lead_s) * mc.QUALISYS.rate_hz)) + 1
    clock_s = np.arange(n) / mc.QUALISYS.rate_hz
    cameras_m = mc.room_cameras_m(mc.QUALISYS, person_at(0.0).keypoints_m[INDEX["mid_hip"], :2])
    fixed_m = camera_marker_m(T_world_camera)[None]
    times_s = clock_s - lead_s
    points_m, n_seeing = mc.track_markers(
        person_at, vertices, fixed_m, times_s, cameras_m, obstacles=obstacles
    )
    names = (*JOINT_MARKERS, CAMERA_MARKER)
    exported = mc.measure(clock_s, names, points_m, n_seeing, T_mocap_world, mc.QUALISYS, rng)
    return exported, T_mocap_world, lead_s


def marker_balls(person: PosedBody, vertices: np.ndarray, number: int) -> list[Surface]:
    """The markers on a person as grey balls; each counts as the part of the body it is taped to.

    Parameters
    ----------
    person : PosedBody
    vertices : array of int, shape (12,)
        See `sensors.markers.marker_vertices`.
    number : int
        Of the person.

    Returns
    -------
    list of Surface
    """
    parts = part_of_vertices(load_body())[vertices]
    balls = [_ball(centre_m) for centre_m in markers_m(person, vertices)]
    owner = np.repeat(parts, [len(ball.triangles) for ball in balls])
    return [Surface(g.concatenate(balls), m.plain(np.full(3, 0.55), 0.35), number, owner)]


def _ball(centre_m: np.ndarray) -> g.Mesh:
    angle = np.linspace(-np.pi / 2, np.pi / 2, 7)
    return g.lathe(_BALL_M * np.c_[np.cos(angle), np.sin(angle)], centre_m, 10)
