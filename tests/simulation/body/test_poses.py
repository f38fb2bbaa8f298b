import numpy as np
import pytest

from hicp_lib.core.keypoints import INDEX
from hicp_lib.simulation.body.hands import HANDS_DEG, sample_hand
from hicp_lib.simulation.body.joints import LIMITS_DEG, pose_from_joints, within_limits
from hicp_lib.simulation.body.model import load_body, pose_body
from hicp_lib.simulation.body.poses import KINDS, sample_joints, sample_pose
from hicp_lib.simulation.body.self_collision import collision_model, self_collision_distance_m

BODY = load_body()
PER_KIND = 12


@pytest.fixture(scope="module", params=list(KINDS))
def drawn(request) -> tuple[str, list]:
    """A kind, and draws of it: (shape, joints, keypoints by name)."""
    rng = np.random.default_rng(7)
    result = []
    for _ in range(PER_KIND):
        shape = str(rng.choice(BODY.shape_names))
        joints = sample_joints(rng, BODY, request.param, shape)
        points = pose_body(BODY, shape, pose_from_joints(joints)).keypoints_m
        result.append((shape, joints, {name: points[i] for name, i in INDEX.items()}))
    return request.param, result


def test_poses_keep_to_the_limits_of_the_joints(drawn):
    _, draws = drawn
    for _, joints, _ in draws:
        assert within_limits(joints)
        assert set(joints) <= set(LIMITS_DEG)


def test_poses_keep_clear_of_the_body(drawn):
    _, draws = drawn
    for shape, joints, _ in draws:
        model = collision_model(BODY, shape)
        assert self_collision_distance_m(BODY, model, pose_from_joints(joints)) > -0.045


def test_poses_are_what_they_are_called(drawn):
    kind, draws = drawn
    fits = [CHECKS[kind](points) for _, _, points in draws]
    assert all(fits), (kind, fits)


def test_poses_differ(drawn):
    _, draws = drawn
    wrists = np.array([[k["left_wrist"], k["right_wrist"]] for _, _, k in draws])
    assert wrists.std(axis=0).max() > 0.02


def span(points, *names) -> float:
    return float(np.linalg.norm(points[names[0]] - points[names[1]]))


def upright(k) -> bool:
    return k["mid_hip"][2] - max(k["left_knee"][2], k["right_knee"][2]) > 0.2


def ahead(k, side) -> float:
    return float(k[f"{side}_wrist"][0] - k[f"{side}_shoulder"][0])


def either(test):
    return lambda k: upright(k) and any(test(k, side) for side in ("left", "right"))


CHECKS = {
    "standing": lambda k: upright(k)
    and all(k[f"{s}_wrist"][2] < k[f"{s}_elbow"][2] for s in ("left", "right")),
    "walking": lambda k: upright(k) and abs(k["left_ankle"][2] - k["right_ankle"][2]) < 0.35,
    "reaching": either(lambda k, s: ahead(k, s) > 0.2),
    "reaching_both": lambda k: upright(k) and min(ahead(k, "left"), ahead(k, "right")) > 0.2,
    "pointing": either(lambda k, s: span(k, f"{s}_index_4", f"{s}_hand_root") > 1.3 * span(
        k, f"{s}_ring_4", f"{s}_hand_root") and span(k, f"{s}_wrist", f"{s}_shoulder") > 0.35),
    "crossed": lambda k: upright(k) and k["left_wrist"][1] < k["right_wrist"][1]
    and min(ahead(k, "left"), ahead(k, "right")) > 0.1,
    "raised": either(lambda k, s: k[f"{s}_wrist"][2] > k[f"{s}_shoulder"][2] - 0.05),
    "hips": lambda k: upright(k) and all(
        abs(k[f"{s}_elbow"][1]) > abs(k[f"{s}_wrist"][1]) > abs(k[f"{s}_hip"][1])
        and abs(k[f"{s}_wrist"][2] - k["mid_hip"][2]) < 0.25 for s in ("left", "right")),
    "face": either(lambda k, s: span(k, f"{s}_middle_4", "nose") < 0.26),
    "sitting": lambda k: abs(k["mid_hip"][2] - (k["left_knee"][2] + k["right_knee"][2]) / 2) < 0.17
    and min(k["left_knee"][0], k["right_knee"][0]) - k["mid_hip"][0] > 0.2,
}  # fmt: skip


def test_the_same_seed_gives_the_same_pose():
    a, b, c = (sample_pose(np.random.default_rng(seed), BODY, shape=3) for seed in (5, 5, 6))
    assert a.keys() == b.keys() and all(np.array_equal(a[bone], b[bone]) for bone in a)
    assert any(not np.array_equal(a[bone], c[bone]) for bone in a)


def test_unknown_kinds_are_refused():
    with pytest.raises(KeyError, match="dancing"):
        sample_pose(np.random.default_rng(0), BODY, "dancing")


@pytest.mark.parametrize("kind", HANDS_DEG)
def test_hands_keep_to_the_limits(kind):
    rng = np.random.default_rng(0)
    for _ in range(30):
        assert within_limits(sample_hand(rng, kind, "right_"))


def test_hands_open_and_close():
    def fingertips(kind: str) -> float:
        hand = sample_hand(np.random.default_rng(1), kind, "left_")
        k = pose_body(BODY, 0, pose_from_joints(hand)).keypoints_m
        tips = [INDEX[f"left_{finger}_4"] for finger in ("index", "middle", "ring", "little")]
        return float(np.linalg.norm(k[tips] - k[INDEX["left_hand_root"]], axis=1).mean())

    reach_m = [fingertips(kind) for kind in ("open", "relaxed", "grip", "fist")]
    assert all(a > b + 0.005 for a, b in zip(reach_m[:-1], reach_m[1:], strict=True))
