"""Random gestures of a person in front of the robot.

Reaching, pointing, crossing the arms, touching the table between them; and gestures that take parts of the
body out of the image: raising the arms, stepping half out of it or close, bending down, putting the hands
behind the back.
"""

from collections.abc import Callable, Iterable, Iterator
from functools import partial, reduce
from operator import or_

import numpy as np

from hicp_lib.core.keypoints import LEFT_HAND, RIGHT_HAND
from hicp_lib.experiments.laboratory import MOVEMENTS, posed
from hicp_lib.experiments.minimum_jerk import Move, Posture, between
from hicp_lib.simulation.body.arms import Ranges, uniform
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
_HANDS, _HALF_FINGER_M = {"left": LEFT_HAND, "right": RIGHT_HAND}, 0.02
_DEG = MOVEMENTS["gestures_deg"]
_ASIDE_M = ((0.5, DISTANCE_M), (0.8, DISTANCE_M + 0.2))  # half out of the image; two corners, (x, y)
_CLOSE_M = ((-0.15, 0.75), (0.15, 1.05))  # torso and arms are in this rectangle
_STEP_M = 0.5  # the longest
_PENETRATION_M = 0.03  # allowed penetration of skin and clothes between two postures
_N_TRIES = 12


class Gestures:
    """Samples a person's next gesture; every movement ends in a posture from which any other may follow.

    Parameters
    ----------
    rng : numpy.random.Generator
    shape : str
        The person's.
    at_table : bool, optional
        Whether there is a table in front of them to touch; if not, they can come near.
    """

    def __init__(self, rng: Rng, shape: str, at_table: bool = True):
        self.rng, self.body, self.shape, self.at_table = rng, load_body(), shape, at_table
        self.collision_model = collision_model(self.body, shape)
        self.place_m = (0.0, DISTANCE_M)
        drawn = sample_joints(rng, self.body, "standing", shape)
        self.legs = {name: angle for name, angle in drawn.items() if name.endswith(_LEGS)}
        self.now = self.at_ease()

    def at_ease(self) -> Posture:
        """Standing, arms hanging."""
        return self._standing(sample_joints(self.rng, self.body, "standing", self.shape))

    def moves(self) -> Iterator[Move]:
        """Endless movements, in rounds with each kind of gesture once, in random order."""
        kinds = ("reaching", "reaching_both", "hips", "crossed", "face", "pointing", "raised")
        gestures: list[Callable[[], Iterator[Move]]] = [partial(self._gesture, kind) for kind in kinds]
        gestures += [self._step, self._raise_high, self._behind_back]
        gestures += [partial(self._step_away, _ASIDE_M)]
        gestures += [self._touch_table] if self.at_table else [partial(self._step_away, _CLOSE_M), self._bend]
        while True:
            for k in self.rng.permutation(len(gestures)):
                yield from gestures[k]()

    def _standing(self, joints: Joints) -> Posture:
        """A posture with given joints of arms and trunk, and this person's own legs and position."""
        return Posture({k: v for k, v in joints.items() if not k.endswith(_LEGS)} | self.legs, self.place_m)

    def _gesture(self, kind: str) -> Iterator[Move]:
        yield from self._go(self._free(lambda: sample_joints(self.rng, self.body, kind, self.shape)))

    def _free(self, draw: Callable[[], Joints]) -> Posture:
        """The first sampled posture that the person can reach; at ease if there is none."""
        for _ in range(_N_TRIES):
            posture = self._standing(draw())
            if self._is_free(posture):
                return posture
        return self.at_ease()

    def _touch_table(self) -> Iterator[Move]:
        """Come to the table, lean forward, one or both hands onto it from above; and up again."""
        yield from self._walk(np.array([self.place_m[0], DISTANCE_M]))
        down = self._free(self._over_table)
        bent = {name: angle + 1.0 for name, angle in down.joints.items() if name.endswith("elbow_flexion")}
        above = self._standing(down.joints | bent)
        yield Move(0.6, above)
        yield from self._go(down)
        self.now = above
        yield Move(0.4, above)

    def _over_table(self) -> Joints:
        joints = self.at_ease().joints | radians(_DEG["leaning"])
        pelvis_m = posed(self.shape, self._standing(joints)).heads_m[0]
        for side in self.rng.permutation(["left", "right"])[: self.rng.integers(1, 3)]:
            joints = self._with_hand_on_table(joints, str(side), pelvis_m)
        return joints

    def _with_hand_on_table(self, joints: Joints, side: str, pelvis_m: np.ndarray) -> Joints:
        """A wrist a little beyond the table's edge, palm down, as low as the hand lies on the table."""
        ahead_m = pelvis_m[1] - TABLE_M[1][1] + self.rng.uniform(0.1, 0.18)
        left_m = self.rng.uniform(0.12, 0.3) * (1 if side == "left" else -1)
        wrist_m = np.array([ahead_m, left_m, TABLE_HEIGHT_M + 0.07 - pelvis_m[2]])
        for _ in range(3):
            joints = reach(self.body, self.shape, joints, side, wrist_m, (-0.2, 0.7, -0.7)) or joints
            joints = joints | radians(_DEG["palm_down"], f"{side}_")
            hand_m = posed(self.shape, self._standing(joints)).keypoints_m[_HANDS[side]]
            wrist_m[2] += TABLE_HEIGHT_M + _HALF_FINGER_M - hand_m[:, 2].min()
        return joints

    def _raise_high(self) -> Iterator[Move]:
        """One arm or both, beyond the upper edge of the image."""
        sides = self.rng.permutation(["left", "right"])[: self.rng.integers(1, 3)]
        yield from self._go(self._free(lambda: self._at_ease_but(_DEG["high"], sides)))

    def _at_ease_but(self, arms: Ranges, sides: Iterable[str] = ("left", "right")) -> Joints:
        drawn = (uniform(self.rng, arms, f"{side}_") for side in sides)
        return reduce(or_, drawn, self.at_ease().joints)

    def _behind_back(self) -> Iterator[Move]:
        """Both hands behind the back, hidden by the trunk, moving around the trunk."""
        joints: Joints | None = self.at_ease().joints
        centre_m, half_m = self.collision_model.trunk_at(0.3)
        for side, outward in (("left", 1), ("right", -1)):
            behind_m = centre_m + (-half_m[0] - 0.1, outward * self.rng.uniform(0.02, 0.1), 0.0)
            joints = joints and reach(self.body, self.shape, joints, side, behind_m, (-0.2, 1, 0.3))
        if joints is None:
            return
        around = joints | radians(_DEG["around"], "left_") | radians(_DEG["around"], "right_")
        for angles in (around, joints, around):
            if self._is_free(self._standing(angles)):
                yield from self._go(self._standing(angles))

    def _bend(self) -> Iterator[Move]:
        """Bend down, the hands beyond the lower edge of the image."""
        down = self._free(lambda: self._at_ease_but(_DEG["hanging_down"]) | uniform(self.rng, _DEG["bent"]))
        yield from self._go(down)
        yield from self._go(self.at_ease())

    def _step(self) -> Iterator[Move]:
        """A step to the side, and perhaps nearer or further."""
        yield from self._walk(self.rng.uniform((-0.22, DISTANCE_M - 0.02), (0.22, DISTANCE_M + 0.2)))

    def _step_away(self, corners_m: tuple[tuple[float, float], tuple[float, float]]) -> Iterator[Move]:
        """To a position in a rectangle on either side, an arm gesture there, and back."""
        home_m, side = np.array(self.place_m), self.rng.choice([-1, 1])
        yield from self._walk(self.rng.uniform(*corners_m) * (side, 1))
        yield from self._gesture(str(self.rng.choice(["hips", "crossed", "face"])))
        yield from self._walk(home_m)

    def _walk(self, to_m: np.ndarray) -> Iterator[Move]:
        """Steps to a place, each with a knee lifted on the way."""
        start_m = np.array(self.place_m)
        n_steps = int(np.ceil(np.linalg.norm(to_m - start_m) / _STEP_M))
        first = int(to_m[0] >= start_m[0])  # the person faces the robot: their left is -x
        for k in range(n_steps):
            side = ("left", "right")[(first + k) % 2]
            lifted = radians(_DEG["lifted"], f"{side}_")
            middle_m, end_m = (start_m + (k + part) / n_steps * (to_m - start_m) for part in (0.5, 1))
            yield Move(
                0.45, Posture(self.now.joints | self.legs | lifted, (float(middle_m[0]), float(middle_m[1])))
            )
            self.place_m = (float(end_m[0]), float(end_m[1]))
            self.now = self._standing(self.now.joints)
            yield Move(0.45, self.now)

    def _go(self, posture: Posture) -> Iterator[Move]:
        """A movement at human speed, then a pause."""
        self.now = posture
        yield Move(float(self.rng.uniform(0.7, 1.3)), posture)
        yield Move(float(self.rng.uniform(0.15, 0.7)), posture)

    def _is_free(self, posture: Posture) -> bool:
        """Whether the person can reach a posture without self-collision."""
        ways = (between(self.now, posture, share).joints for share in np.linspace(0.125, 1, 8))
        poses = map(pose_from_joints, ways)
        gaps_m = (self_collision_distance_m(self.body, self.collision_model, pose) for pose in poses)
        return within_limits(posture.joints) and all(gap_m > -_PENETRATION_M for gap_m in gaps_m)
