"""A person who sits still at a table in front of the robot, hands on it, for the stability test.

The person keeps one posture for the whole recording; only the robot moves.
"""

import numpy as np

from hicp_lib.core.memo import memoised
from hicp_lib.experiments.laboratory import MOVEMENTS, chair, furnished, posed, table
from hicp_lib.experiments.minimum_jerk import Posture
from hicp_lib.simulation.appearance.people import appearance_of, dress
from hicp_lib.simulation.body.hands import sample_hand
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.body.joints import Joints, radians
from hicp_lib.simulation.body.model import Body, PosedBody, load_body
from hicp_lib.simulation.body.reach import reach
from hicp_lib.simulation.rendering.render import World

VIEWS = {"upper": "level", "lower": "tilted"}
"""The paper's two views, and the camera holder each is seen with."""
DISTANCE_M = 1.15  # of the person's pelvis from the robot's root, along the floor
_PLACE_M = (0.0, DISTANCE_M)
TABLE_HEIGHT_M = 0.72
_TABLE_EDGE_M = 0.20  # the table's edge in front of the pelvis
_TABLE_DEPTH_M = 0.55
_WRISTS_M = {"left": (0.40, 0.12), "right": (0.36, -0.18)}  # in front of the pelvis, to the person's left
_WRISTS_APART_M = 0.05  # maximum deviation of a person's wrists from these
_POSTURE_SD_DEG = 4.0  # of the spine and neck angles between people
_DEG = MOVEMENTS["seated_deg"]
_CONTACT_M = 0.003  # gap between the lowest point of hand or forearm and the table
_N_ROUNDS = 6


@memoised(1)
def seated_person(subject: Subject) -> tuple[World, PosedBody]:
    """A subject's scene: a person at a table in a furnished room. The same in every process."""
    identity = subject.identity
    body, appearance, rng = load_body(), appearance_of(identity, skirts=False), identity.draw("room", "table")
    person = _sit_down(body, appearance.shape, identity.draw("poses"))
    edge_m = DISTANCE_M - _TABLE_EDGE_M
    top = table(rng, (-0.65, edge_m - _TABLE_DEPTH_M), (0.65, edge_m), TABLE_HEIGHT_M)
    seat = chair(rng, _PLACE_M, _seat_height_m(body, person))
    surfaces = [top, *seat, *dress(appearance, person, 0)]
    clear = [(0.0, DISTANCE_M - 0.2, 0.9), (0.0, DISTANCE_M + 0.4, 0.7)]
    return furnished(identity, surfaces, clear), person


def _sit_down(body: Body, shape: str, rng: np.random.Generator) -> PosedBody:
    """The posture, with the arms brought down until the hands lie on the table."""
    upright = [name for name in _DEG["posture"] if name.startswith(("spine", "neck"))]
    held = {name: rng.normal(_DEG["posture"][name], _POSTURE_SD_DEG) for name in upright}
    joints = radians(_DEG["posture"] | held)
    apart_m = _WRISTS_APART_M
    wrists_m = {side: rng.uniform(-apart_m, apart_m, 2) + at for side, at in _WRISTS_M.items()}
    for side in _WRISTS_M:
        joints |= sample_hand(rng, "open", f"{side}_") | radians(_DEG["hand"], f"{side}_")
    wrist_heights_m = dict.fromkeys(_WRISTS_M, TABLE_HEIGHT_M + 0.05)
    for _ in range(_N_ROUNDS):
        pelvis_m = posed(shape, Posture(joints, _PLACE_M)).heads_m[0, 2]
        for side, (ahead_m, left_m) in wrists_m.items():
            target_m = np.array([ahead_m, left_m, wrist_heights_m[side] - pelvis_m])
            joints = _with_arm(body, shape, joints, side, target_m)
        person = posed(shape, Posture(joints, _PLACE_M))
        for side in _WRISTS_M:
            wrist_heights_m[side] += TABLE_HEIGHT_M + _CONTACT_M - _lowest_m(body, person, side)
    return person


def _with_arm(body: Body, shape: str, joints: Joints, side: str, wrist_m: np.ndarray) -> Joints:
    found = reach(body, shape, joints, side, wrist_m, elbow_toward=(-0.1, 0.8, -0.7))
    if found is None:
        raise ValueError(f"the {side} hand cannot reach the table")
    return found


def _lowest_m(body: Body, person: PosedBody, side: str) -> float:
    """Height of the lowest point of a hand and forearm above the table's top."""
    limbs = body.in_regions("hand", "forearm")
    own = (body.vertices_m[0, :, 1] > 0) == (side == "left")
    over_table = person.vertices_m[:, 1] < DISTANCE_M - _TABLE_EDGE_M
    return float(person.vertices_m[limbs & own & over_table, 2].min())


def _seat_height_m(body: Body, person: PosedBody) -> float:
    """Right under hips and thighs."""
    near = np.abs(person.vertices_m[:, 1] - DISTANCE_M) < 0.2
    return float(person.vertices_m[body.in_regions("hips", "thigh") & near, 2].min()) - 0.008
