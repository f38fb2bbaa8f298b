"""A person who moves in front of the robot, with motion capture; the robot stands still.

The system has its own clock and world frame: it starts before the camera, whose clock differs. The true
values of both are in `simulation.json`, for comparison only.
"""

from dataclasses import dataclass, replace

import numpy as np

from hicp_lib.core.keypoints import INDEX
from hicp_lib.core.memo import memoised
from hicp_lib.experiments.laboratory import furnished, posed, table
from hicp_lib.experiments.minimum_jerk import Motion
from hicp_lib.experiments.recordings.gestures import DISTANCE_M, TABLE_HEIGHT_M, TABLE_M, Gestures
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.simulation.appearance import materials as m
from hicp_lib.simulation.appearance.people import Appearance, appearance_of, dress, part_of_vertices
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.body.model import PosedBody, load_body
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.render import World
from hicp_lib.simulation.rendering.surfaces import Surface
from hicp_lib.simulation.sensors import markers
from hicp_lib.simulation.sensors import motion_capture as mc

HEAD_RAD = np.radians([0.0, 0.0, 0.0, 9.0, 0.0, 0.0])
"""Pose of the robot's head: slightly up, so that the person is visible from the thighs to the hair."""

_AT_TABLE = 0.5  # fraction of the people; the others can step close
_LEAD_S = (0.3, 0.9)  # lead of motion capture before the first frame, and lag after the last
_BALL_M = 0.006  # radius of a marker


@dataclass(frozen=True, eq=False)
class MovingPerson:
    """A person who moves in a room, with markers on; times in seconds from the first frame.

    Attributes
    ----------
    room : World
        Without the person.
    table : Surface or None
        In the room, if it has one between person and robot.
    appearance : Appearance
    motion : Motion
    """

    room: World
    table: Surface | None
    appearance: Appearance
    motion: Motion

    def person_at(self, time_s: float) -> PosedBody:
        """The person, not dressed."""
        return _person(self, self.motion.still_since_s(time_s))

    def at(self, time_s: float) -> tuple[World, PosedBody]:
        """The scene, and the person in it."""
        return _staged(self, self.motion.still_since_s(time_s))


# A still person is posed and dressed only once.
@memoised(4)
def _person(scene: MovingPerson, motion_s: float) -> PosedBody:
    return posed(scene.appearance.shape, scene.motion.at(motion_s))


@memoised(4)
def _staged(scene: MovingPerson, motion_s: float) -> tuple[World, PosedBody]:
    person, vertices = _person(scene, motion_s), markers.marker_vertices(scene.appearance.shape)
    worn = [*dress(scene.appearance, person, 0), _marker_balls(person, vertices)]
    return replace(scene.room, surfaces=[*scene.room.surfaces, *worn]), person


def _marker_balls(person: PosedBody, vertices: np.ndarray) -> Surface:
    """The markers on a person as grey balls; each belongs to the body part to which it is attached."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 7)
    profile_m = _BALL_M * np.c_[np.cos(angle), np.sin(angle)]
    balls = [g.lathe(profile_m, centre_m, 10) for centre_m in markers.markers_m(person, vertices)]
    owner = np.repeat(part_of_vertices(load_body())[vertices], [len(ball.triangles) for ball in balls])
    return Surface(g.concatenate(balls), m.plain(np.full(3, 0.55), 0.35), 0, owner)


@memoised(1)
def moving_person(subject: Subject) -> MovingPerson:
    """A subject's scene: person, motion and room. The same in every process."""
    identity = subject.identity
    appearance, rng = appearance_of(identity, skirts=False), identity.draw("room", "table")
    top = table(rng, *TABLE_M, TABLE_HEIGHT_M) if rng.random() < _AT_TABLE else None
    room = furnished(identity, [top] if top else [], [(0.0, DISTANCE_M, 1.3), (0.0, 0.9, 0.8)])
    gestures = Gestures(identity.draw("poses"), appearance.shape, at_table=top is not None)
    return MovingPerson(room, top, appearance, Motion(gestures.now, gestures.moves()))


def capture(
    subject: Subject, duration_s: float, T_world_camera: np.ndarray
) -> tuple[MotionCapture, np.ndarray, float]:
    """Motion capture of a moving subject, starting before the first frame.

    Parameters
    ----------
    subject : Subject
        The person; also determines frame, clock and noise.
    duration_s : float
        From the first frame to the last.
    T_world_camera : array, shape (4, 4)
        The camera, which has a marker too; it does not move.

    Returns
    -------
    exported : MotionCapture
        The exported measurements.
    T_mocap_world : array, shape (4, 4)
    lead_s : float
        Time from the zero of its clock to the first frame.
    """
    scene, rng = moving_person(subject), subject.stream("motion capture")
    T_mocap_world, lead_s = mc.mocap_frame(rng), float(rng.uniform(*_LEAD_S))
    n = int(round((duration_s + 2 * lead_s) * mc.QUALISYS.rate_hz)) + 1
    clock_s, vertices = np.arange(n) / mc.QUALISYS.rate_hz, markers.marker_vertices(scene.appearance.shape)
    cameras_m = mc.room_cameras_m(mc.QUALISYS, scene.person_at(0.0).keypoints_m[INDEX["mid_hip"], :2])
    fixed_m = markers.camera_marker_m(T_world_camera)[None]
    obstacles = (scene.table.mesh,) if scene.table else ()
    points_m, n_seeing = mc.track_markers(
        scene.person_at, vertices, fixed_m, clock_s - lead_s, cameras_m, obstacles=obstacles
    )
    names = (*markers.JOINT_MARKERS, markers.CAMERA_MARKER)
    exported = mc.measure(clock_s, names, points_m, n_seeing, T_mocap_world, mc.QUALISYS, rng)
    return exported, T_mocap_world, lead_s
