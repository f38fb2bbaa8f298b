import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.simulation.body.joints import pose_from_joints, within_limits
from hicp_lib.simulation.body.model import load_body, pose_bones
from hicp_lib.simulation.body.reach import reach

BODY = load_body()


def heads(shape, joints) -> dict[str, np.ndarray]:
    _, found = pose_bones(BODY, shape, pose_from_joints(joints))
    return dict(zip(BODY.bone_names, found, strict=True))


@given(
    st.sampled_from(BODY.shape_names), st.sampled_from(["left", "right"]), st.floats(-0.6, 0.9),
    st.floats(-0.7, 0.5), st.floats(0.6, 0.95),
)  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_the_wrist_arrives(shape, side, azimuth, elevation, stretch):
    before = heads(shape, {"spine_flexion": 0.3})
    end, sign = side[0].upper(), 1 if side == "left" else -1
    chain = [before[f"{bone}.{end}"] for bone in ("upperarm01", "lowerarm01", "wrist")]
    length = sum(np.linalg.norm(b - a) for a, b in zip(chain[:-1], chain[1:], strict=True))
    direction = np.array([np.cos(azimuth), sign * np.sin(azimuth), np.tan(elevation)])
    target = chain[0] + stretch * length * direction / np.linalg.norm(direction)
    joints = reach(BODY, shape, {"spine_flexion": 0.3}, side, target)
    assert joints is not None and within_limits(joints)
    assert joints["spine_flexion"] == 0.3 and all(name.startswith((side, "spine")) for name in joints)
    assert heads(shape, joints)[f"wrist.{end}"] == pytest.approx(target, abs=0.01)


def test_out_of_reach_the_arm_stretches_towards_the_point():
    target = np.array([3.0, 0.5, 0.6])
    joints = reach(BODY, 0, {}, "left", target)
    after = heads(0, joints)
    shoulder, elbow, wrist = (after[f"{bone}.L"] for bone in ("upperarm01", "lowerarm01", "wrist"))
    assert joints["left_elbow_flexion"] < np.radians(10)
    for part in (elbow - shoulder, wrist - shoulder):
        angle = np.arccos(
            part @ (target - shoulder) / np.linalg.norm(part) / np.linalg.norm(target - shoulder)
        )
        assert angle < np.radians(6)


def test_what_joints_do_not_allow_is_not_reached():
    assert reach(BODY, 0, {}, "left", heads(0, {})["upperarm01.L"] + [0.02, 0, 0]) is None
    behind = heads(0, {})["upperarm01.R"] + [-0.45, 0.3, 0.1]
    assert reach(BODY, 0, {}, "right", behind) is None


def test_the_elbow_goes_where_it_is_wanted():
    target = heads(0, {})["upperarm01.L"] + [0.3, -0.05, -0.15]
    low, out = (
        heads(0, reach(BODY, 0, {}, "left", target, toward))["lowerarm01.L"]
        for toward in ((0, 0, -1), (0, 1, 0))
    )
    assert out[1] > low[1] + 0.05 and low[2] < out[2] - 0.02
