"""A person who moves before the robot, watched by motion capture: reaches, waves, crosses the arms,
touches the table between them, steps aside. The robot stands still.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from hicp_lib.simulation.arms import Joints
from hicp_lib.simulation.body import Body, PosedBody, load_body, pose_body
from hicp_lib.simulation.clearance import Outline, clearance_m, outline
from hicp_lib.simulation.experiments.laboratory import adult, facing_robot, furnished, table
from hicp_lib.simulation.experiments.mocap import marker_balls
from hicp_lib.simulation.experiments.motion import Motion, Move, Posture, between
from hicp_lib.simulation.joints import pose_from_joints, within_limits
from hicp_lib.simulation.people import Appearance, dress
from hicp_lib.simulation.poses import sample_joints
from hicp_lib.simulation.reach import reach
from hicp_lib.simulation.render import World
from hicp_lib.simulation.sensors.markers import marker_vertices
from hicp_lib.simulation.surfaces import Surface

Rng = np.random.Generator

HEAD_RAD = np.radians([0.0, 0.0, 0.0, 9.0, 0.0, 0.0])
"""Where the robot holds its head: a little up, so that the person is seen from the thighs to the hair."""
DISTANCE_M = 1.65  # of the person from the robot's root, along the floor
TABLE_HEIGHT_M = 0.72
_TABLE_M = ((-0.6, 0.75), (0.6, 1.3))  # two corners of its top, (x, y)
_LEGS = ("hip_flexion", "hip_abduction", "hip_rotation", "knee_flexion", "ankle_flexion")
_TOUCH_DEG = {"spine_flexion": 28.0, "neck_flexion": 10.0}
_WAVING_DEG = {
    "shoulder_abduction": 65.0, "shoulder_flexion": 15.0, "shoulder_rotation": -80.0,
    "elbow_flexion": 100.0, "forearm_supination": -50.0, "wrist_flexion": 0.0,
}  # fmt: skip
_SWINGING = (("shoulder_abduction", 1), ("elbow_flexion", -1))  # how the joints go to and fro
_PENETRATION_M = 0.03  # skin and clothes give way this far on the way from one posture to the next
_N_TRIES = 12


class _Mover:
    """Draws what one person does next; every movement ends in a posture from which any other may follow."""

    def __init__(self, rng: Rng, body: Body, shape: np.ndarray):
        self.rng, self.body, self.shape = rng, body, shape
        self.person: Outline = outline(body, shape)
        self.place_m = (0.0, DISTANCE_M)
        self.legs = {
            name: angle
            for name, angle in sample_joints(rng, body, "standing", shape).items()
            if name.endswith(_LEGS)
        }
        self.now = self.at_ease()

    def at_ease(self) -> Posture:
        """Standing, arms hanging."""
        return self._standing(sample_joints(self.rng, self.body, "standing", self.shape))

    def moves(self) -> Iterator[Move]:
        """Movements without end, in rounds in which each kind of gesture comes once.

        The first round has a fixed order, so that a short recording holds hands that reach out.
        """
        gestures: list[Callable[[], Iterator[Move]]] = [
            lambda: self._gesture("reaching"), self._touch_table, lambda: self._gesture("hips"),
            lambda: self._gesture("reaching_both"), self._wave, lambda: self._gesture("crossed"),
            lambda: self._gesture("face"), self._step, lambda: self._gesture("pointing"),
        ]  # fmt: skip
        order = np.arange(len(gestures))
        while True:
            for k in order:
                yield from gestures[k]()
            order = self.rng.permutation(order)

    def _standing(self, joints: Joints) -> Posture:
        """A posture with the arms and trunk of some joints, on this person's own legs and place."""
        return Posture({k: v for k, v in joints.items() if not k.endswith(_LEGS)} | self.legs, self.place_m)

    def _gesture(self, kind: str) -> Iterator[Move]:
        for _ in range(_N_TRIES):
            posture = self._standing(sample_joints(self.rng, self.body, kind, self.shape))
            if self._is_free(posture):
                yield from self._go(posture)
                return
        yield from self._go(self.at_ease())

    def _touch_table(self) -> Iterator[Move]:
        """Lean forward, one or both hands onto the table."""
        joints = dict(self.now.joints) | {name: float(np.radians(v)) for name, v in _TOUCH_DEG.items()}
        pelvis_m = self._posed(self._standing(joints)).heads_m[0]
        for side in self.rng.permutation(["left", "right"])[: self.rng.integers(1, 3)]:
            sign = 1 if side == "left" else -1
            ahead_m = pelvis_m[1] - _TABLE_M[1][1] + self.rng.uniform(0.1, 0.18)
            up_m = TABLE_HEIGHT_M + 0.07 - pelvis_m[2]
            wrist_m = np.array([ahead_m, sign * self.rng.uniform(0.12, 0.3), up_m])
            joints = reach(self.body, self.shape, joints, side, wrist_m, (-0.2, 0.7, -0.7)) or joints
            joints |= {
                f"{side}_forearm_supination": np.radians(-70),
                f"{side}_wrist_flexion": np.radians(-15),
            }
        posture = self._standing(joints)
        if self._is_free(posture):
            yield from self._go(posture)

    def _wave(self) -> Iterator[Move]:
        """One hand up, forearm to and fro."""
        joints = dict(self.at_ease().joints)
        side = str(self.rng.choice(["left", "right"]))
        up = _WAVING_DEG
        joints |= {f"{side}_{name}": float(np.radians(angle)) for name, angle in up.items()}
        yield from self._go(self._standing(joints))
        for swing_deg in (20, -20, 20, -20, 0):
            turned = {f"{side}_{name}": np.radians(up[name] + swing_deg * sign) for name, sign in _SWINGING}
            self.now = self._standing(joints | turned)
            yield Move(0.35, self.now)

    def _step(self) -> Iterator[Move]:
        """A step to the side, and perhaps nearer or further, with a knee lifted on the way."""
        x, y = self.rng.uniform((-0.22, DISTANCE_M - 0.02), (0.22, DISTANCE_M + 0.2))
        side = "left" if x < self.place_m[0] else "right"  # the person faces the robot: their left is -x
        lifted = {f"{side}_hip_flexion": 0.5, f"{side}_knee_flexion": 0.7, f"{side}_hip_abduction": 0.12}
        middle = tuple(np.add(self.place_m, (x, y)) / 2)
        self.place_m = (float(x), float(y))
        yield Move(0.45, Posture(dict(self.now.joints) | self.legs | lifted, middle))
        self.now = self._standing(self.now.joints)
        yield Move(0.45, self.now)

    def _go(self, posture: Posture) -> Iterator[Move]:
        """A movement as fast as people make it, then a pause."""
        self.now = posture
        yield Move(float(self.rng.uniform(0.7, 1.3)), posture)
        yield Move(float(self.rng.uniform(0.15, 0.7)), posture)

    def _is_free(self, posture: Posture) -> bool:
        """Whether the person can go to a posture without running through themselves."""
        ways = [between(self.now, posture, share).joints for share in np.linspace(0.125, 1, 8)]
        return within_limits(posture.joints) and all(
            clearance_m(self.body, self.person, pose_from_joints(way)) > -_PENETRATION_M for way in ways
        )

    def _posed(self, posture: Posture) -> PosedBody:
        return posed(self.body, self.shape, posture)


def posed(body: Body, shape: np.ndarray, posture: Posture) -> PosedBody:
    """The body in a posture, facing the robot."""
    x, y = posture.place_m
    return pose_body(body, shape, pose_from_joints(posture.joints), facing_robot(y, x))


@dataclass(frozen=True)
class Moving:
    """A person who moves in a room, with markers on; times in seconds from the first frame."""

    room: World  # without the person
    table: Surface
    appearance: Appearance
    motion: Motion

    def person_at(self, time_s: float) -> PosedBody:
        """The person, not dressed."""
        return posed(load_body(), self.appearance.shape, self.motion.at(time_s))

    def at(self, time_s: float) -> tuple[World, PosedBody]:
        """All there is to see, and the person in it."""
        person, vertices = self.person_at(time_s), marker_vertices(self.appearance.shape)
        worn = [*dress(self.appearance, person, 0), *marker_balls(person, vertices, 0)]
        return replace(self.room, surfaces=[*self.room.surfaces, *worn]), person


def moving(seed: int) -> Moving:
    """The scene of a seed: who moves how, in what room. The same in every process."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 3]))
    appearance = adult(rng)
    top = table(rng, *_TABLE_M, TABLE_HEIGHT_M)
    room = furnished(rng, [top], [(0.0, DISTANCE_M, 0.8), (0.0, 0.9, 0.8)])
    mover = _Mover(rng, load_body(), appearance.shape)
    return Moving(room, top, appearance, Motion(mover.now, mover.moves()))
