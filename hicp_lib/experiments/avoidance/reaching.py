"""Scripted behaviour of people near the robot: they reach for its left hand, or are bystanders.

The paper's three trials (section IV-E): reaching for the robot's hand with a hand, sitting and standing, and
approaching it with the head, sitting. Unless the robot avoids, the person's skin comes within `CONTACT_M` of
it; if it does, they follow the hand's position of `REACTION_S` ago, as far as they can reach. Two scripts of
bystanders (`BYSTANDERS`), who stay at least `BYSTAND_M` away: one gestures, one passes by. Every script has
the same phases (`PHASES_S`): far, getting ready, approach, near, leaving, far again.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from hicp_lib.core.camera import transform
from hicp_lib.core.memo import memoised
from hicp_lib.core.rotations import about
from hicp_lib.experiments import laboratory as lab
from hicp_lib.experiments.avoidance.skin_distance import robot_spheres, skin_distance_m
from hicp_lib.experiments.minimum_jerk import Posture, between, minimum_jerk
from hicp_lib.robot.home import HOME_M, home_posture
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.simulation.appearance.people import Appearance, appearance_of, dress
from hicp_lib.simulation.body.hands import sample_hand
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.body.joints import pose_from_joints, radians
from hicp_lib.simulation.body.model import PosedBody, load_body, pose_bones
from hicp_lib.simulation.body.reach import reach
from hicp_lib.simulation.rendering.render import World
from hicp_lib.simulation.rendering.surfaces import Surface

PHASES_S = {"far": 0.6, "ready": 0.9, "approach": 1.1, "near": 1.0, "leave": 1.0}
"""Durations for which the person is far, gets ready, approaches, stays near, and leaves."""
READY_S = PHASES_S["far"] + PHASES_S["ready"]
NEAR_S = READY_S + PHASES_S["approach"]
"""Start of the approach, and its end, when the person is as near as they would come to a still robot."""
LEAVES_S = NEAR_S + PHASES_S["near"], sum(PHASES_S.values())
"""Start and end of leaving."""
LOOKED_AT_S = READY_S - 0.3, LEAVES_S[0] + 0.3
"""Period in which perception matters; before and after, people are too far away."""
CONTACT_M, BYSTAND_M = 0.01, 0.36
REACTION_S = 0.2
"""Visual reaction time of the person (150 to 200 ms to a target that jumps)."""

_DEG = lab.MOVEMENTS["reaching_deg"]
_LEANS_DEG = np.arange(0.0, 100.1, 5.0)  # total bend of the trunk; the neck does not follow
_FINE_DEG = np.arange(0.0, 100.1, 0.25)
_LEAN_SHARES = {lab.PELVIS_LEAN: 0.35, "spine_flexion": 0.65, "neck_flexion": -0.45}  # the head stays upright
_FROM = np.array([-0.66, 0.55, 0.45])  # direction of the approaching hand, root frame: from the palm's side
_WRISTS_M = np.arange(0.70, 0.04, -0.03)  # distances of the wrist from the palm, from far to near
_PASSES_M = np.arange(1.5, 0.4, -0.05)  # distances of a passer-by, likewise
_PASSES_X_M = (-0.9, 0.1, 0.9)  # start, middle and end
_N_HALVINGS = 6  # of the step that contains the contact
_READY_M = 0.24  # distance of the ready posture from the end of the approach
_HEAD_FROM_DEG = 20.0  # how much more upright the trunk is in the head's ready posture
_STRETCHED = 0.97  # usable fraction of the arm's length; the trunk bends for the rest
_REST_M = np.array([0.16, 0.19, 0.08])  # a sitting person's wrist in front of, beside and above the pelvis
_SEAT_M = 0.11  # height of the pelvis's origin above the seat
# Where elbows go, see `reach`: with the hands in the lap, and of the arm that reaches.
_ELBOW_AT_REST, _ELBOW_REACHING = (-0.5, 0.7, -0.5), (-0.2, 0.5, -0.9)
Reach = Callable[[np.ndarray], Posture]
"""From an assumed position of the robot's hand (3,), root frame, to the person's posture touching it."""


@dataclass(frozen=True)
class Staging:
    """Staging of a script.

    Attributes
    ----------
    sits : bool
        Whether the person sits.
    place_m : tuple of float
        Position on the floor (x, y), world frame.
    by : str
        What approaches: "hand", "head", or for bystanders "gesture" or "passing".
    """

    sits: bool
    place_m: tuple[float, float]
    by: str


BYSTANDERS, SCRIPTS = (
    {name: Staging(sits, (x_m, y_m), by) for name, (sits, x_m, y_m, by) in lab.MOVEMENTS[kind].items()}
    for kind in ("bystanders", "scripts")
)


@dataclass(frozen=True, eq=False)
class Script:
    """A trial ready for rendering; times in seconds from its start.

    Attributes
    ----------
    name : str
        Key of `SCRIPTS` or `BYSTANDERS`.
    room : World
        Without the person.
    appearance : Appearance
        The person's.
    rest, ready : minimum_jerk.Posture
        Posture before, and at the start of the approach.
    touch : callable
        Posture when they touch the robot's hand, see `Reach`.
    """

    name: str
    room: World
    appearance: Appearance
    rest: Posture
    ready: Posture
    touch: Reach

    def posture_at(self, time_s: float, hand_m: np.ndarray) -> Posture:
        """The person's posture at a time, for an assumed position of the robot's hand (3,), root frame."""
        if time_s <= READY_S:
            return _way(self.rest, self.ready, (time_s - PHASES_S["far"]) / PHASES_S["ready"])
        there = self.touch(hand_m)
        if time_s <= LEAVES_S[0]:
            return _way(self.ready, there, (time_s - READY_S) / PHASES_S["approach"])
        return _way(there, self.rest, (time_s - LEAVES_S[0]) / PHASES_S["leave"])


@dataclass(frozen=True)
class Moment:
    """The state of a script at a time.

    Attributes
    ----------
    script : str
    subject : Subject
    time_s : float
    hand_m : tuple of float
        The robot's hand as the person sees it, root frame.
    """

    script: str
    subject: Subject
    time_s: float
    hand_m: tuple[float, ...] = tuple(HOME_M["left"])

    @property
    def person(self) -> PosedBody:
        """The person's body, without clothes, in the world."""
        return _person(self._still)

    def world(self, robot: list[Surface]) -> World:
        """The scene at this time."""
        room = script(self.script, self.subject).room
        return replace(room, surfaces=[*room.surfaces, *_worn(self._still), *robot])

    @property
    def _still(self) -> "Moment":
        # A still person is posed and dressed only once.
        return replace(self, time_s=float(np.clip(self.time_s, PHASES_S["far"], LEAVES_S[1])))


@memoised(64)
def _person(moment: Moment) -> PosedBody:
    scene = script(moment.script, moment.subject)
    return lab.posed(scene.appearance.shape, scene.posture_at(moment.time_s, np.array(moment.hand_m)))


@memoised(4)
def _worn(moment: Moment) -> list[Surface]:
    return dress(script(moment.script, moment.subject).appearance, _person(moment), 0)


@memoised()
def script(name: str, subject: Subject = Subject()) -> Script:
    """A script of `SCRIPTS` or `BYSTANDERS` as a subject follows it in a room of theirs.

    Examples
    --------
    >>> fingertip_m = Moment("standing, hand", Subject(), NEAR_S).person.keypoints_m[127]
    >>> bool(np.linalg.norm(lab.in_root(fingertip_m) - HOME_M["left"]) < 0.3)
    True
    """
    staging, identity = (SCRIPTS | BYSTANDERS)[name], subject.identity
    appearance, rng = appearance_of(identity, skirts=False), identity.draw("room", "chair")
    rest = _rest(identity.draw("poses"), appearance.shape, staging)
    rest, ready, touch = _WAYS[staging.by](appearance.shape, rest)
    x, y = staging.place_m
    seat = []
    if staging.sits:
        seat = lab.chair(rng, (x, y), float(lab.posed(appearance.shape, rest).heads_m[0, 2]) - _SEAT_M)
    passed = [(px, y - 0.4, 0.7) for px in _PASSES_X_M if staging.by == "passing"]
    room = lab.furnished(identity, seat, [(x, y - 0.2, 0.8), (x, y + 0.4, 0.7), *passed])
    return Script(name, room, appearance, rest, ready, touch)


def _way(start: Posture, end: Posture, share: float) -> Posture:
    return between(start, end, minimum_jerk(float(np.clip(share, 0, 1))))


def _by_hand(shape: str, rest: Posture, gap_m: float = CONTACT_M) -> tuple[Posture, Posture, Reach]:
    """Far, ready and near for the right hand."""
    home_m, away = np.array(HOME_M["left"]), _FROM / np.linalg.norm(_FROM)
    with_wrist = _leaning_reach(shape, rest)
    near_m = _contact(_WRISTS_M, lambda off_m: _distance_m(shape, with_wrist(home_m + off_m * away)), gap_m)
    ready = with_wrist(home_m + (near_m + _READY_M) * away)
    return rest, ready, lambda hand_m: with_wrist(hand_m + near_m * away)


def _by_gesture(shape: str, rest: Posture) -> tuple[Posture, Posture, Reach]:
    """The right hand comes near the robot, but does not touch it, and leaves."""
    rest, ready, touch = _by_hand(shape, rest, BYSTAND_M)
    near = touch(np.array(HOME_M["left"]))
    return rest, ready, lambda hand_m: near


def _by_passing(shape: str, rest: Posture) -> tuple[Posture, Posture, Reach]:
    """From one side to the other and back, the right arm a little before the body."""
    start_x, middle_x, end_x = _PASSES_X_M
    y = _contact(_PASSES_M, lambda y: _distance_m(shape, replace(rest, place_m=(middle_x, y))), BYSTAND_M)
    start, middle, end = (replace(rest, place_m=(x, y)) for x in (start_x, middle_x, end_x))
    return start, middle, lambda hand_m: end


def _by_head(shape: str, rest: Posture) -> tuple[Posture, Posture, Reach]:
    """Far, ready and near for the head: only the trunk bends forward to approach."""
    near_deg = _contact(_LEANS_DEG, lambda lean_deg: _distance_m(shape, _leaning(rest, lean_deg)))
    bodies = [lab.posed(shape, _leaning(rest, lean_deg)) for lean_deg in _LEANS_DEG]
    skin_m = lab.in_root(lab.posed(shape, _leaning(rest, near_deg)).vertices_m)
    first = int(np.linalg.norm(skin_m - HOME_M["left"], axis=1).argmin())  # touches the hand first
    coarse_m = lab.in_root(np.array([body.vertices_m[first] for body in bodies]))
    way_m = np.stack([np.interp(_FINE_DEG, _LEANS_DEG, column) for column in coarse_m.T], axis=1)
    to_hand_m = np.array(HOME_M["left"]) - way_m[np.abs(_FINE_DEG - near_deg).argmin()]

    def touch(hand_m: np.ndarray) -> Posture:
        off_m = np.linalg.norm(way_m + to_hand_m - hand_m, axis=1)
        return _leaning(rest, float(_FINE_DEG[off_m.argmin()]))

    return rest, _leaning(rest, near_deg - _HEAD_FROM_DEG), touch


_WAYS = {"hand": _by_hand, "head": _by_head, "gesture": _by_gesture, "passing": _by_passing}


def _contact(way: Iterable[float], distance_m: Callable[[float], float], gap_m: float = CONTACT_M) -> float:
    """Position on a path where the distance first falls to `gap_m`; the path's end if it does not."""
    before, *further = way
    for after in [before, *further]:
        if distance_m(after) < gap_m:
            break
        before = after
    for _ in range(_N_HALVINGS):
        middle = (before + after) / 2
        before, after = (before, middle) if distance_m(middle) < gap_m else (middle, after)
    return float(before)


def _distance_m(shape: str, posture: Posture) -> float:
    """Between the person and the robot at its post."""
    return skin_distance_m(_robot_at_post(), lab.in_root(lab.posed(shape, posture).vertices_m))


@memoised()
def _robot_at_post() -> tuple[np.ndarray, np.ndarray]:
    icub = load_icub()
    return robot_spheres(icub, home_posture(icub))


def _rest(rng, shape: str, staging: Staging) -> Posture:
    """Upright; arms hang, or lie in the lap."""
    joints = radians(_DEG["hanging"])
    if staging.sits:
        joints |= radians(_DEG["sitting"], "left_") | radians(_DEG["sitting"], "right_")
    for side in ("left", "right"):
        joints |= sample_hand(rng, "open", f"{side}_") | radians(_DEG["hand"], f"{side}_")
        if staging.sits:
            wrist_m = _REST_M * [1, 1 if side == "left" else -1, 1]
            joints = reach(load_body(), shape, joints, side, wrist_m, _ELBOW_AT_REST) or joints
    return Posture(joints, staging.place_m)


def _leaning(posture: Posture, lean_deg: float) -> Posture:
    """The trunk bent forward by an angle, distributed over hips, spine and neck."""
    lean = float(np.radians(lean_deg))
    bent = {joint: share * lean for joint, share in _LEAN_SHARES.items()}
    return replace(posture, joints=posture.joints | bent)


def _leaning_reach(shape: str, rest: Posture) -> Reach:
    """A posture with the right wrist at a point in the root frame, bending the trunk no more than needed."""
    body, pelvis_m, to_body = load_body(), lab.posed(shape, rest).heads_m[0], lab.facing_robot(0.0)[:3, :3].T
    arm = [body.bone_numbers[f"{name}.R"] for name in ("upperarm01", "lowerarm01", "wrist")]
    shoulders_m = []
    for lean_deg in _LEANS_DEG:
        bent, lean = _bent(rest, lean_deg)
        _, heads = pose_bones(body, shape, pose_from_joints(bent))
        shoulders_m.append(about(1, lean) @ heads[arm[0]])
    length_m = np.linalg.norm(np.diff(heads[arm], axis=0), axis=1).sum()

    def with_wrist(wrist_m: np.ndarray) -> Posture:
        from_pelvis_m = to_body @ (transform(lab.T_WORLD_ROOT, wrist_m) - pelvis_m)
        lacks_m = np.linalg.norm(from_pelvis_m - shoulders_m, axis=1) - _STRETCHED * length_m
        first = int((lacks_m <= 0).argmax() if (lacks_m <= 0).any() else lacks_m.argmin())
        least_deg = np.interp(0, lacks_m[[first, max(first - 1, 0)]], _LEANS_DEG[[first, max(first - 1, 0)]])
        for lean_deg in (least_deg, *_LEANS_DEG[_LEANS_DEG > least_deg]):
            bent, lean = _bent(rest, lean_deg)
            found = reach(body, shape, bent, "right", about(1, lean).T @ from_pelvis_m, _ELBOW_REACHING)
            if found:
                return replace(rest, joints=found | {lab.PELVIS_LEAN: lean})
        return _leaning(rest, least_deg)

    return with_wrist


def _bent(rest: Posture, lean_deg: float) -> tuple[dict[str, float], float]:
    """Joints of a bent trunk without the pelvis, and the pelvis's angle (radians)."""
    joints = dict(_leaning(rest, lean_deg).joints)
    return joints, joints.pop(lab.PELVIS_LEAN)
