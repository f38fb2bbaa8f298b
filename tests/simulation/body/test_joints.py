import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.core.keypoints import INDEX, NAMES
from hicp_lib.simulation.body.joints import (
    LIMITS_DEG,
    pose_from_joints,
    shoulder_angles,
    shoulder_rotation,
    within_limits,
)
from hicp_lib.simulation.body.model import load_body, pose_body

BODY = load_body()
# A joint's positive movement, and which way it brings a keypoint: axis (x forward, y left, z up) and sign.
DIRECTIONS = [
    ("shoulder_flexion", "wrist", 0, 1), ("shoulder_abduction", "wrist", 1, 1),
    ("elbow_flexion", "wrist", 0, 1),
    ("wrist_flexion", "middle_4", 1, -1), ("wrist_deviation", "middle_4", 0, 1),
    ("forearm_supination", "thumb_4", 1, 1), ("hip_flexion", "knee", 0, 1), ("hip_abduction", "ankle", 1, 1),
    ("hip_rotation", "big_toe", 1, -1), ("knee_flexion", "ankle", 0, -1), ("ankle_flexion", "big_toe", 2, -1),
    ("index_knuckle", "index_4", 1, -1), ("ring_middle", "ring_4", 1, -1), ("little_end", "little_4", 1, -1),
    ("index_spread", "index_4", 0, 1), ("little_spread", "little_4", 0, -1),
    ("thumb_spread", "thumb_4", 1, 1),
    ("thumb_end", "thumb_4", 0, -1),
]  # fmt: skip


def keypoints(joints: dict, shape="man_38_07") -> np.ndarray:
    """Keypoints from the pelvis."""
    posed = pose_body(BODY, shape, pose_from_joints(joints))
    return posed.keypoints_m - posed.heads_m[0]


def moved(joints: dict, keypoint: str) -> np.ndarray:
    return (keypoints(joints) - keypoints({}))[INDEX[keypoint]]


@pytest.mark.parametrize("joint, keypoint, axis, sign", DIRECTIONS)
def test_joints_of_limbs_move_as_named(joint, keypoint, axis, sign):
    for side, mirror in (("left", 1), ("right", -1 if axis == 1 else 1)):
        change = moved({f"{side}_{joint}": 0.2}, f"{side}_{keypoint}")
        assert change[axis] * sign * mirror > 0.002, (side, change)


@pytest.mark.parametrize(
    "joint, axis, sign",
    [("spine_flexion", 0, 1), ("neck_flexion", 2, -1), ("spine_bend", 1, 1), ("neck_bend", 1, 1),
     ("spine_turn", 1, 1), ("neck_turn", 1, 1)],
)  # fmt: skip
def test_joints_of_the_trunk_move_as_named(joint, axis, sign):
    assert moved({joint: 0.2}, "nose")[axis] * sign > 0.002


def test_inward_rotation_of_the_arm_swings_the_bent_forearm_inward():
    bent = {"left_elbow_flexion": np.pi / 2}
    change = keypoints(bent | {"left_shoulder_rotation": 0.3}) - keypoints(bent)
    assert change[INDEX["left_wrist"], 1] < -0.03


def test_eyes_turn():
    def pupil(joints):
        posed = pose_body(BODY, 0, pose_from_joints(joints))
        return posed.vertices_m[(BODY.field("iris_rad") == 0)][0] - posed.keypoints_m[INDEX["nose"]]

    assert (pupil({"eye_turn": 0.3}) - pupil({}))[1] > 0.003
    assert (pupil({"eye_pitch": 0.3}) - pupil({}))[2] < -0.003


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_mirrored_joints_give_the_mirrored_pose(seed):
    rng = np.random.default_rng(seed)
    joints = {name: np.radians(rng.uniform(*limits)) * 0.6 for name, limits in LIMITS_DEG.items()}
    mirrored = {}
    for name, angle in joints.items():
        if name.startswith(("left", "right")):
            mirrored[name.replace("left", "RIGHT").replace("right", "left").replace("RIGHT", "right")] = angle
        else:
            mirrored[name] = -angle if name.endswith(("bend", "turn")) else angle
    a, b = keypoints(joints), keypoints(mirrored)
    for name in NAMES:
        if name.startswith("left_") and "face" not in name:
            there = name.replace("left", "right")
            assert a[INDEX[name]] * (1, -1, 1) == pytest.approx(b[INDEX[there]], abs=3e-3)


@given(st.floats(-np.pi, np.pi), st.floats(-1.7, 1.4), st.floats(-np.pi, np.pi))
def test_shoulder_angles_invert_the_rotation(flexion, abduction, inward):
    angles = shoulder_angles(shoulder_rotation(flexion, abduction, inward))
    turn = np.subtract(angles, (flexion, abduction, inward))
    assert np.cos(turn) == pytest.approx(1, abs=1e-9)


def test_the_whole_arm_turns_as_asked_whatever_the_girdle_does():
    """Collar bone and shoulder blade take part in raising an arm without changing where it points."""
    names = list(BODY.bone_names)
    for flexion, abduction, inward in ((2.4, 0.1, 0.3), (0.2, 1.3, -0.5), (0.1, 0.1, 0.1)):
        joints = dict(
            left_shoulder_flexion=flexion, left_shoulder_abduction=abduction, left_shoulder_rotation=inward
        )
        posed = pose_body(BODY, 0, pose_from_joints(joints))
        still = pose_body(BODY, 0, {})
        turned = (posed.rotations @ still.rotations.transpose(0, 2, 1))[names.index("lowerarm01.L")]
        assert turned == pytest.approx(shoulder_rotation(flexion, abduction, inward), abs=1e-6)
    raised = pose_from_joints({"left_shoulder_abduction": 2.5})
    assert np.trace(raised["clavicle.L"]) < 1 + 2 * np.cos(0.1)


def test_limits():
    assert within_limits({}) and within_limits(
        {name: np.radians(high) for name, (_, high) in LIMITS_DEG.items()}
    )
    assert not within_limits({"left_elbow_flexion": np.radians(-5)})
    assert all(low <= 0 <= high for low, high in LIMITS_DEG.values())


def test_unknown_joints_are_refused():
    with pytest.raises(KeyError, match="left_tail_flexion"):
        pose_from_joints({"left_tail_flexion": 0.1})
    with pytest.raises(KeyError):
        within_limits({"left_tail_flexion": 0.1})
