"""A person who moves before the robot, watched by motion capture; the robot stands still."""

from dataclasses import dataclass, replace

import numpy as np

from hicp_lib.core.memo import memoised
from hicp_lib.experiments.laboratory import furnished, posed, table
from hicp_lib.experiments.minimum_jerk import Motion
from hicp_lib.experiments.recordings.capture import marker_balls
from hicp_lib.experiments.recordings.gestures import DISTANCE_M, TABLE_HEIGHT_M, TABLE_M, Gestures
from hicp_lib.simulation.appearance.people import Appearance, appearance_of, dress
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.body.model import PosedBody
from hicp_lib.simulation.rendering.render import World
from hicp_lib.simulation.rendering.surfaces import Surface
from hicp_lib.simulation.sensors.markers import marker_vertices

HEAD_RAD = np.radians([0.0, 0.0, 0.0, 9.0, 0.0, 0.0])
"""Where the robot holds its head: a little up, so that the person is seen from the thighs to the hair."""

_AT_TABLE = 0.5  # of the people; the others can step close


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
        """All there is to see, and the person in it."""
        return _staged(self, self.motion.still_since_s(time_s))


# Whoever keeps still is posed and dressed once.
@memoised(4)
def _person(scene: MovingPerson, motion_s: float) -> PosedBody:
    return posed(scene.appearance.shape, scene.motion.at(motion_s))


@memoised(4)
def _staged(scene: MovingPerson, motion_s: float) -> tuple[World, PosedBody]:
    person, vertices = _person(scene, motion_s), marker_vertices(scene.appearance.shape)
    worn = [*dress(scene.appearance, person, 0), *marker_balls(person, vertices, 0)]
    return replace(scene.room, surfaces=[*scene.room.surfaces, *worn]), person


@memoised(1)
def moving_person(subject: Subject) -> MovingPerson:
    """A subject's scene: who moves how, in what room. The same in every process."""
    identity = subject.identity
    appearance, rng = appearance_of(identity, skirts=False), identity.draw("room", "table")
    top = table(rng, *TABLE_M, TABLE_HEIGHT_M) if rng.random() < _AT_TABLE else None
    room = furnished(identity, [top] if top else [], [(0.0, DISTANCE_M, 1.3), (0.0, 0.9, 0.8)])
    gestures = Gestures(identity.draw("poses"), appearance.shape, at_table=top is not None)
    return MovingPerson(room, top, appearance, Motion(gestures.now, gestures.moves()))
