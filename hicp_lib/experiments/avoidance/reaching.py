"""The paper's three trials of avoidance as scripts: a person comes near the robot's left hand, and leaves.

Sitting, they reach for it with the hand; standing, they do; sitting, they approach it with the head
(section IV-E). Every script has the same phases (`PHASES_S`): far, getting ready, approach, near, leaving,
far again. Unless the robot gives way, the person's skin comes within `CONTACT_M` of it. They do not follow
the hand: where they go is decided beforehand.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from hicp_lib.core.camera import transform
from hicp_lib.core.memo import memoised
from hicp_lib.core.rotations import about
from hicp_lib.experiments.avoidance.skin_distance import robot_spheres, skin_distance_m
from hicp_lib.experiments.laboratory import (
    PELVIS_LEAN,
    T_WORLD_ROOT,
    chair,
    facing_robot,
    furnished,
    in_root,
    posed,
)
from hicp_lib.experiments.minimum_jerk import Motion, Move, Posture
from hicp_lib.robot.home import HOME_M, home_posture
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.robot.skin import read_skin
from hicp_lib.simulation.appearance.people import Appearance, appearance_of, dress
from hicp_lib.simulation.body.hands import sample_hand
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.body.joints import pose_from_joints, radians
from hicp_lib.simulation.body.model import PosedBody, load_body, pose_bones
from hicp_lib.simulation.body.reach import reach
from hicp_lib.simulation.rendering.render import World
from hicp_lib.simulation.rendering.surfaces import Surface

PHASES_S = {"far": 0.6, "ready": 0.9, "approach": 1.1, "near": 1.4, "leave": 1.0}
"""How long the person is far, takes to get ready, to approach, stays near, and takes to leave."""
NEAR_S = PHASES_S["far"] + PHASES_S["ready"] + PHASES_S["approach"]
"""When the person is as near as they go."""
LEAVES_S = NEAR_S + PHASES_S["near"], sum(PHASES_S.values())
"""When the person begins to leave, and has left."""
CONTACT_M = 0.01

_SITTING_DEG = {"hip_flexion": 86.0, "knee_flexion": 86.0, "hip_abduction": 12.0}
_HANGING_DEG = {"left_shoulder_abduction": 6.0, "right_shoulder_abduction": 6.0, "left_elbow_flexion": 12.0}
_HAND_DEG = {"forearm_supination": -15.0, "wrist_flexion": 0.0, "wrist_deviation": 0.0}
_LEANS_DEG = range(0, 120, 5)  # how far the trunk bends in all, tried from upright on
_LEAN_SHARES = {PELVIS_LEAN: 0.35, "spine_flexion": 0.65, "neck_flexion": -0.45}  # the eyes look ahead
_FROM = np.array([-0.66, 0.55, 0.45])  # whence the hand comes, root frame: from the palm's side
_WRISTS_M = np.arange(0.40, 0.04, -0.03)  # how far the wrist is from the robot's palm, tried from afar
_N_HALVINGS = 6  # of the step in which contact comes about
_READY_M = 0.24  # how far from the end of the approach the person gets ready
_HEAD_FROM_DEG = 20.0  # how much more upright the trunk is when the head gets ready
_MISS_M = 0.005  # a wrist this near its goal is there
_REST_M = np.array([0.16, 0.19, 0.08])  # a sitting person's wrist before, beside and above the pelvis
_SEAT_M = 0.11  # how far below the pelvis's origin a seat is
# Where elbows go, see `reach`: with the hands in the lap, and of the arm that reaches.
_ELBOW_AT_REST, _ELBOW_REACHING = (-0.5, 0.7, -0.5), (-0.2, 0.5, -0.9)


@dataclass(frozen=True)
class Staging:
    """How a script is staged.

    Attributes
    ----------
    sits, by_head : bool
        Whether the person sits, and whether they come with the head instead of the hand.
    place_m : tuple of float
        Where on the floor they are (x, y), world frame.
    """

    sits: bool
    by_head: bool
    place_m: tuple[float, float]


SCRIPTS = {
    "sitting, hand": Staging(True, False, (0.26, 1.02)),
    "standing, hand": Staging(False, False, (0.26, 0.92)),
    "sitting, head": Staging(True, True, (-0.14, 1.0)),
}


@dataclass(frozen=True, eq=False)
class Script:
    """A trial ready to be looked at; times in seconds from its beginning.

    Attributes
    ----------
    name : str
        Key of `SCRIPTS`.
    subject : Subject
        Who the person is.
    room : World
        Without the person.
    appearance : Appearance
        The person's.
    motion : Motion
        What they do, from when they begin to get ready.
    """

    name: str
    subject: Subject
    room: World
    appearance: Appearance
    motion: Motion

    def person_at(self, time_s: float) -> PosedBody:
        """The person, not dressed, in the world."""
        return _person(self, self.motion.still_since_s(time_s - PHASES_S["far"]))

    def at(self, time_s: float, robot: list[Surface]) -> tuple[World, PosedBody]:
        """All there is to see, with the robot as it is then, and the person in it."""
        motion_s = self.motion.still_since_s(time_s - PHASES_S["far"])
        surfaces = [*self.room.surfaces, *_worn(self, motion_s), *robot]
        return replace(self.room, surfaces=surfaces), _person(self, motion_s)


# Whoever keeps still is posed and dressed once.
@memoised(4)
def _person(scene: Script, motion_s: float) -> PosedBody:
    return posed(scene.appearance.shape, scene.motion.at(motion_s))


@memoised(4)
def _worn(scene: Script, motion_s: float) -> list[Surface]:
    return dress(scene.appearance, _person(scene, motion_s), 0)


@memoised()
def script(name: str, subject: Subject = Subject()) -> Script:
    """A script of `SCRIPTS` as a subject follows it in a room of theirs. The same in every process.

    Examples
    --------
    >>> scene = script("standing, hand")
    >>> tip = scene.person_at(NEAR_S).keypoints_m[127]  # of the right middle finger
    >>> bool(np.linalg.norm(in_root(tip) - HOME_M["left"]) < 0.3)
    True
    """
    staging, identity = SCRIPTS[name], subject.identity
    appearance, rng = appearance_of(identity, skirts=False), identity.draw("room", "chair")
    by = _by_head if staging.by_head else _by_hand
    rest, ready, near = by(identity.draw("poses"), appearance.shape, staging)
    x, y = staging.place_m
    seat = []
    if staging.sits:
        seat = chair(rng, (x, y), float(posed(appearance.shape, rest).heads_m[0, 2]) - _SEAT_M)
    room = furnished(identity, seat, [(x, y - 0.2, 0.8), (x, y + 0.4, 0.7)])
    return Script(name, subject, room, appearance, Motion(rest, _moves(rest, ready, near)))


def _moves(rest: Posture, ready: Posture, near: Posture) -> Iterator[Move]:
    yield Move(PHASES_S["ready"], ready)
    yield Move(PHASES_S["approach"], near)
    yield Move(PHASES_S["near"], near)
    yield Move(PHASES_S["leave"], rest)
    while True:
        yield Move(1.0, rest)


def _by_hand(rng, shape: np.ndarray, staging: Staging) -> tuple[Posture, Posture, Posture]:
    """Far, ready and near for the right hand."""
    rest = _rest(rng, shape, staging)
    pelvis_m = posed(shape, rest).heads_m[0]
    away = _FROM / np.linalg.norm(_FROM)

    def with_wrist(distance_m: float) -> Posture:
        wrist_m = transform(T_WORLD_ROOT, HOME_M["left"] + distance_m * away)
        return _leaning_reach(shape, rest, pelvis_m, wrist_m)

    near_m = _contact(_WRISTS_M, lambda distance_m: _distance_m(shape, with_wrist(distance_m)))
    return rest, with_wrist(near_m + _READY_M), with_wrist(near_m)


def _by_head(rng, shape: np.ndarray, staging: Staging) -> tuple[Posture, Posture, Posture]:
    """Far, ready and near for the head: the trunk bends forward until it is there."""
    rest = _rest(rng, shape, staging)
    near_deg = _contact(_LEANS_DEG, lambda lean_deg: _distance_m(shape, _leaning(rest, lean_deg)))
    return rest, _leaning(rest, near_deg - _HEAD_FROM_DEG), _leaning(rest, near_deg)


def _contact(way: Iterable[float], distance_m: Callable[[float], float]) -> float:
    """Where on a way the distance first falls to `CONTACT_M`; the way's end if it does not."""
    before, *further = way
    for after in [before, *further]:
        if distance_m(after) < CONTACT_M:
            break
        before = after
    for _ in range(_N_HALVINGS):
        middle = (before + after) / 2
        before, after = (before, middle) if distance_m(middle) < CONTACT_M else (middle, after)
    return float(before)


def _distance_m(shape: np.ndarray, posture: Posture) -> float:
    """Between the person and the robot at its post."""
    return skin_distance_m(_robot_at_post(), in_root(posed(shape, posture).vertices_m))


@memoised()
def _robot_at_post() -> tuple[np.ndarray, np.ndarray]:
    icub = load_icub()
    return robot_spheres(icub, read_skin(), home_posture(icub))


def _rest(rng, shape: np.ndarray, staging: Staging) -> Posture:
    """Upright; arms hang, or lie in the lap."""
    joints = radians(_HANGING_DEG)
    if staging.sits:
        joints |= radians(_SITTING_DEG, "left_") | radians(_SITTING_DEG, "right_")
    for side in ("left", "right"):
        joints |= sample_hand(rng, "open", f"{side}_") | radians(_HAND_DEG, f"{side}_")
        if staging.sits:
            wrist_m = _REST_M * [1, 1 if side == "left" else -1, 1]
            joints = reach(load_body(), shape, joints, side, wrist_m, _ELBOW_AT_REST) or joints
    return Posture(joints, staging.place_m)


def _leaning(posture: Posture, lean_deg: float) -> Posture:
    """The trunk bent forward by an angle, shared by hips, spine and neck."""
    lean = float(np.radians(lean_deg))
    bent = {joint: share * lean for joint, share in _LEAN_SHARES.items()}
    return replace(posture, joints=posture.joints | bent)


def _leaning_reach(shape: np.ndarray, posture: Posture, pelvis_m: np.ndarray, wrist_m: np.ndarray) -> Posture:
    """The right wrist at a point of the world, the trunk no further bent than that takes."""
    body = load_body()
    from_pelvis = facing_robot(0.0)[:3, :3].T @ (wrist_m - pelvis_m)
    best, best_miss_m = posture, np.inf
    for lean_deg in _LEANS_DEG:
        bent = dict(_leaning(posture, lean_deg).joints)
        lean = bent.pop(PELVIS_LEAN)
        target = about(1, lean).T @ from_pelvis
        found = reach(body, shape, bent, "right", target, _ELBOW_REACHING)
        if found is None:
            continue
        _, heads = pose_bones(body, shape, pose_from_joints(found))
        miss_m = float(np.linalg.norm(heads[body.bone_numbers["wrist.R"]] - target))
        if miss_m < best_miss_m:
            best, best_miss_m = replace(posture, joints=found | {PELVIS_LEAN: lean}), miss_m
        if miss_m < _MISS_M:
            break
    return best
