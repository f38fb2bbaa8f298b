"""What a person does before the robot, one gesture after another: reaches, waves, crosses the arms, touches
the table between them, steps aside.
"""

from collections.abc import Callable, Iterator

import numpy as np

from hicp_lib.experiments.laboratory import posed
from hicp_lib.experiments.minimum_jerk import Move, Posture, between
from hicp_lib.simulation.body.joints import Joints, pose_from_joints, radians, within_limits
from hicp_lib.simulation.body.model import load_body
from hicp_lib.simulation.body.poses import sample_joints
from hicp_lib.simulation.body.reach import reach
from hicp_lib.simulation.body.self_collision import collision_model, self_collision_distance_m

Rng = np.random.Generator

DISTANCE_M = 1.65  # of the person from the robot's root, along the floor
TABLE_HEIGHT_M = 0.72
TABLE_M = ((-0.6, 0.75), (0.6, 1.3))  # two corners of its top, (x, y)
_LEGS = ("hip_flexion", "hip_abduction", "hip_rotation", "knee_flexion", "ankle_flexion")
_WRIST_M = 0.07  # a wrist above the table that its hand lies on
_LEANING_DEG = {"spine_flexion": 28.0, "neck_flexion": 10.0}
_PALM_DOWN_DEG = {"forearm_supination": -70.0, "wrist_flexion": -15.0}
_WAVING_DEG = {
    "shoulder_abduction": 65.0, "shoulder_flexion": 15.0, "shoulder_rotation": -80.0,
    "elbow_flexion": 100.0, "forearm_supination": -50.0, "wrist_flexion": 0.0,
}  # fmt: skip
_SWINGING = (("shoulder_abduction", 1), ("elbow_flexion", -1))  # how the joints go to and fro
_PENETRATION_M = 0.03  # skin and clothes give way this far on the way from one posture to the next
_N_TRIES = 12


class Gestures:
    """Draws what one person does next; every movement ends in a posture from which any other may follow.

    Parameters
    ----------
    rng : numpy.random.Generator
    shape : array, shape (n_shapes,)
        The person's.
    """

    def __init__(self, rng: Rng, shape: np.ndarray):
        self.rng, self.body, self.shape = rng, load_body(), shape
        self.collision_model = collision_model(self.body, shape)
        self.place_m = (0.0, DISTANCE_M)
        drawn = sample_joints(rng, self.body, "standing", shape)
        self.legs = {name: angle for name, angle in drawn.items() if name.endswith(_LEGS)}
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
        joints = self.now.joints | radians(_LEANING_DEG)
        pelvis_m = posed(self.shape, self._standing(joints)).heads_m[0]
        for side in self.rng.permutation(["left", "right"])[: self.rng.integers(1, 3)]:
            joints = self._with_hand_on_table(joints, str(side), pelvis_m)
        posture = self._standing(joints)
        if self._is_free(posture):
            yield from self._go(posture)

    def _with_hand_on_table(self, joints: Joints, side: str, pelvis_m: np.ndarray) -> Joints:
        """A wrist a little beyond the table's edge, the palm down."""
        ahead_m = pelvis_m[1] - TABLE_M[1][1] + self.rng.uniform(0.1, 0.18)
        left_m = self.rng.uniform(0.12, 0.3) * (1 if side == "left" else -1)
        wrist_m = np.array([ahead_m, left_m, TABLE_HEIGHT_M + _WRIST_M - pelvis_m[2]])
        joints = reach(self.body, self.shape, joints, side, wrist_m, (-0.2, 0.7, -0.7)) or joints
        return joints | radians(_PALM_DOWN_DEG, f"{side}_")

    def _wave(self) -> Iterator[Move]:
        """One hand up, forearm to and fro."""
        joints = self.at_ease().joints
        side = str(self.rng.choice(["left", "right"]))
        joints = joints | radians(_WAVING_DEG, f"{side}_")
        yield from self._go(self._standing(joints))
        for swing_deg in (20, -20, 20, -20, 0):
            turned_deg = {name: _WAVING_DEG[name] + sign * swing_deg for name, sign in _SWINGING}
            self.now = self._standing(joints | radians(turned_deg, f"{side}_"))
            yield Move(0.35, self.now)

    def _step(self) -> Iterator[Move]:
        """A step to the side, and perhaps nearer or further, with a knee lifted on the way."""
        x, y = self.rng.uniform((-0.22, DISTANCE_M - 0.02), (0.22, DISTANCE_M + 0.2))
        side = "left" if x < self.place_m[0] else "right"  # the person faces the robot: their left is -x
        lifted = {f"{side}_hip_flexion": 0.5, f"{side}_knee_flexion": 0.7, f"{side}_hip_abduction": 0.12}
        middle = ((self.place_m[0] + x) / 2, (self.place_m[1] + y) / 2)
        self.place_m = (float(x), float(y))
        yield Move(0.45, Posture(self.now.joints | self.legs | lifted, middle))
        self.now = self._standing(self.now.joints)
        yield Move(0.45, self.now)

    def _go(self, posture: Posture) -> Iterator[Move]:
        """A movement as fast as people make it, then a pause."""
        self.now = posture
        yield Move(float(self.rng.uniform(0.7, 1.3)), posture)
        yield Move(float(self.rng.uniform(0.15, 0.7)), posture)

    def _is_free(self, posture: Posture) -> bool:
        """Whether the person can go to a posture without running through themselves."""
        ways = (between(self.now, posture, share).joints for share in np.linspace(0.125, 1, 8))
        gaps_m = (
            self_collision_distance_m(self.body, self.collision_model, pose_from_joints(way)) for way in ways
        )
        return within_limits(posture.joints) and all(gap_m > -_PENETRATION_M for gap_m in gaps_m)
