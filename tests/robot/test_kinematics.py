"""Kinematics against numbers worked out elsewhere, a real robot's log, and a plain product of matrices."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json, write_json
from hicp_lib.robot.kinematics import ARM_JOINTS, HEAD_JOINTS, load_icub
from hicp_lib.robot.motor_order import from_motor_order
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.segments import body_segments
from hicp_lib.robot.tables import ICUB_FILE, read_tables

GOLDEN_HEAD_DEG = [10, 5, -15, -20, 10, 25, -12, 8]
GOLDEN_ARM_DEG = [10, 5, -15, -20, 40, 10, 60, 20, -10, 5]
HAND_AT_ZERO = [[0, 1, 0], [0, 0, -1], [-1, 0, 0]]
GAZE_AT_ZERO = [[0, 0, -1], [1, 0, 0], [0, -1, 0]]


def pose(chain, link, angles_deg, **versions):
    return load_icub(**versions).chains[chain].T_root_link(link, np.deg2rad(angles_deg))


def head_position(version, **angles_deg):
    q = [angles_deg.get(joint, 0.0) for joint in HEAD_JOINTS]
    return pose("head", "head", q, head=version)[:3, 3]


def close(actual, expected, tolerance=1e-6):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance)


@pytest.mark.parametrize(
    ("version", "link", "position"),
    [
        ("v1", "torso", (-0.00781, 0, 0.2253)),
        ("v1", "neck_pitch", (-0.00781, 0, 0.2583)),
        ("v1", "head", (-0.06281, 0, 0.34080)),
        ("v2", "torso", (-0.0055, 0, 0.2553)),
        ("v2", "neck_pitch", (-0.0055, 0, 0.2648)),
        ("v2", "head", (-0.05640, 0, 0.34685)),
    ],
)
def test_head_at_zero(version, link, position):
    close(pose("head", link, np.zeros(6), head=version)[:3, 3], position)


@pytest.mark.parametrize(("eye", "y"), [("left_eye", -0.034), ("right_eye", 0.034)])
@pytest.mark.parametrize(("version", "x", "z"), [("v1", -0.06281, 0.34080), ("v2", -0.05640, 0.34685)])
def test_eyes_at_zero(eye, y, version, x, z):
    T = pose(eye, eye, np.zeros(8), head=version)
    close(T[:3, 3], (x, y, z))
    close(T[:3, :3], GAZE_AT_ZERO)
    close(pose("head", "head", np.zeros(6), head=version)[:3, :3], GAZE_AT_ZERO)


@pytest.mark.parametrize(
    ("version", "position"),
    [
        ("v1", (-0.010817, -0.094116, -0.176780)),
        ("v1.7", (-0.010817, -0.094116, -0.180780)),
        ("v2", (-0.010817, -0.084136, -0.180780)),
    ],
)
def test_hands_at_zero(version, position):
    for side, mirror in (("left", 1), ("right", -1)):
        T = pose(side, "hand", np.zeros(10), arm=version)
        close(T[:3, 3], np.array(position) * (1, mirror, 1))
        close(T[:3, :3], HAND_AT_ZERO)


@pytest.mark.parametrize(
    ("link", "z"), [("shoulder_pitch", 0.1753), ("elbow", 0.02302), ("forearm", -0.11428)]
)
def test_left_arm_at_zero(link, z):
    # The elbow's row moves 15 mm sideways, so that its own origin lies on the axis of the arm again.
    close(pose("left", link, np.zeros(10))[:3, 3], (-0.010817, -0.110116, z))


@pytest.mark.parametrize(
    ("version", "joint", "angle_deg", "position"),
    [
        ("v1", "torso_pitch", 20, (-0.175583, 0, 0.298765)),
        ("v2", "torso_pitch", 20, (-0.171628, 0, 0.306642)),
        ("v1", "neck_pitch", 20, (-0.019990, 0, 0.352646)),
        ("v2", "neck_pitch", 20, (-0.022018, 0, 0.358738)),
        ("v1", "neck_pitch", -20, (-0.098996, 0, 0.315023)),
        ("v2", "neck_pitch", -20, (-0.084642, 0, 0.323920)),
        ("v1", "neck_yaw", 20, (-0.059553, -0.018469, 0.340800)),
    ],
)
def test_head_with_one_joint_turned(version, joint, angle_deg, position):
    close(head_position(version, **{joint: angle_deg}), position)


def test_neck_pitch_looks_up():
    close(pose("head", "head", [0, 0, 0, 20, 0, 0])[:3, 2], (-0.9397, 0, 0.3420), 1e-4)


@pytest.mark.parametrize(
    ("chain", "joint", "axis"),
    [
        ("head", "torso_pitch", (0, -1, 0)),
        ("head", "torso_roll", (1, 0, 0)),
        ("head", "torso_yaw", (0, 0, -1)),
        ("head", "neck_pitch", (0, 1, 0)),
        ("head", "neck_roll", (-1, 0, 0)),
        ("head", "neck_yaw", (0, 0, 1)),
    ],
)
def test_positive_angles_turn_about_the_documented_axes(chain, joint, axis):
    q = np.zeros(6)
    q[HEAD_JOINTS.index(joint)] = 0.3
    turn = pose(chain, "head", np.rad2deg(q))[:3, :3] @ np.transpose(GAZE_AT_ZERO)
    skew = (turn - turn.T) / (2 * np.sin(0.3))
    close((skew[2, 1], skew[0, 2], skew[1, 0]), axis)


@pytest.mark.parametrize(("side", "outward"), [("left", -1), ("right", 1)])
def test_positive_arm_angles_move_the_hand_the_documented_way(side, outward):
    def moved(joint):
        q = np.where(np.array(ARM_JOINTS) == joint, 20.0, 0.0)
        return pose(side, "hand", q)[:3, 3] - pose(side, "hand", np.zeros(10))[:3, 3]

    assert moved("shoulder_pitch")[0] > 0.05  # backward is +x
    assert moved("shoulder_roll")[1] * outward > 0.05
    assert moved("elbow")[0] < -0.05


@pytest.mark.parametrize(
    ("version", "chain", "position"),
    [
        ("v1", "head", (-0.143423, -0.056001, 0.295076)),
        ("v1", "left_eye", (-0.125907, -0.083058, 0.305895)),
        ("v1", "right_eye", (-0.160939, -0.028943, 0.284256)),
        ("v2", "head", (-0.131824, -0.051933, 0.306238)),
        ("v2", "left_eye", (-0.114308, -0.078991, 0.317057)),
        ("v2", "right_eye", (-0.149340, -0.024875, 0.295419)),
    ],
)
def test_golden_head_pose(version, chain, position):
    T = pose(chain, chain, GOLDEN_HEAD_DEG[: 6 if chain == "head" else 8], head=version)
    close(T[:3, 3], position)
    rotation = {
        "head": [
            [-0.515182, 0.525970, -0.676716],
            [0.795817, 0.000407, -0.605537],
            [-0.318218, -0.850503, -0.418785],
        ],
        "left_eye": [
            [-0.433265, 0.655173, -0.618894],
            [0.870493, 0.126296, -0.475700],
            [-0.233502, -0.744847, -0.625043],
        ],
    }
    close(T[:3, :3], rotation["head" if chain == "head" else "left_eye"])


@pytest.mark.parametrize(
    ("version", "left", "right"),
    [
        ("v1", (-0.218516, -0.292587, -0.015491), (-0.341064, 0.144960, 0.001771)),
        ("v1.7", (-0.222124, -0.294092, -0.016340), (-0.344945, 0.144432, 0.000961)),
        ("v2", (-0.224347, -0.288774, -0.024487), (-0.344254, 0.139345, -0.007597)),
    ],
)
def test_golden_arm_pose(version, left, right):
    close(pose("left", "hand", GOLDEN_ARM_DEG, arm=version)[:3, 3], left)
    close(pose("right", "hand", GOLDEN_ARM_DEG, arm=version)[:3, 3], right)


@pytest.mark.parametrize(
    ("version", "left"),
    [("v1", (-0.288996, -0.163894, 0.000784)), ("v2", (-0.294146, -0.154818, -0.001806))],
)
def test_arms_mirror_each_other(version, left):
    q = [0, 0, 0, -25, 20, 0, 50, 0, 0, 0]
    close(pose("left", "hand", q, arm=version)[:3, 3], left)
    close(pose("right", "hand", q, arm=version)[:3, 3], np.array(left) * (1, -1, 1))


@pytest.mark.parametrize(
    ("angles_deg", "logged_m"),
    [
        (
            [-0.018681, 0.028571, -0.014286, 8.043956, 58.0, -6.090549, 71.923077, -44.819718, -6.989011,
             -16.10989],
            (-0.242924, 0.276539, 0.105221),
        ),
        (
            [0.332967, 0.204396, -0.014286, -56.131868, 22.043956, 71.623736, 70.252747, 1.15365, 5.494505,
             11.494505],
            (-0.274495, -0.029682, 0.083449),
        ),
        (
            [0.069231, -0.147253, -0.102198, -88.043956, 55.978022, 66.436923, 74.032967, 14.47104, -1.362637,
             23.714286],
            (-0.302566, 0.155197, 0.278005),
        ),
    ],
)  # fmt: skip
def test_positions_a_real_robot_logged(angles_deg, logged_m):
    """Right hand, from the controller's log in robotology/skeleton3D, Humanoids 2018 data set."""
    close(pose("right", "hand", angles_deg, arm="v1")[:3, 3], logged_m, 2e-6)
    q = from_motor_order(angles_deg[2::-1], [*angles_deg[3:], *np.zeros(9)], ARM_JOINTS)
    close(load_icub().chains["right"].T_root_link("hand", q)[:3, 3], logged_m, 2e-6)


@pytest.mark.parametrize(
    ("version", "mount", "position", "axis"),
    [
        ("v2", "level", (-0.0854, -0.0544, 0.4642), (-0.9939, -0.0415, -0.1026)),
        ("v2", "tilted", (-0.1206, -0.0579, 0.4009), (-0.7087, -0.0351, -0.7046)),
        ("v1", "level", (-0.0918, -0.0544, 0.4582), (-0.9939, -0.0415, -0.1026)),
        ("v1", "tilted", (-0.1271, -0.0579, 0.3949), (-0.7087, -0.0351, -0.7046)),
    ],
)
def test_camera_in_the_root_frame(version, mount, position, axis):
    T = load_icub(head=version).T_root_camera(np.zeros((2, 6)), mount)
    assert T.shape == (2, 4, 4)
    close(T[:, :3, 3], [position, position], 6e-5)
    close(T[:, :3, 2], [axis, axis], 6e-5)


@pytest.mark.parametrize(("mount", "down_deg"), [("level", 5.9), ("tilted", 44.8)])
def test_camera_looks_down_as_its_holder_says(mount, down_deg):
    axis = load_icub().T_root_camera(np.zeros(6), mount)[:3, 2]
    assert np.rad2deg(np.arcsin(-axis[2])) == pytest.approx(down_deg, abs=0.05)


def dh_product(rows, q_rad, T_root_base):
    """Poses after every row: the product of matrices of the convention, written out."""
    T, angles, poses = np.array(T_root_base, dtype=float), iter(q_rad), {}
    for joint, link, a, d, alpha_deg, offset_deg in rows:
        theta = np.deg2rad(offset_deg) + (next(angles) if joint else 0.0)
        c, s = np.cos(theta), np.sin(theta)
        ca, sa = np.cos(np.deg2rad(alpha_deg)), np.sin(np.deg2rad(alpha_deg))
        T = T @ [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
        poses[link] = T
    return poses


angles = st.lists(st.floats(-np.pi, np.pi), min_size=10, max_size=10)


@settings(max_examples=30, deadline=None)
@given(angles, st.sampled_from(["v1", "v1.7", "v2"]), st.sampled_from(["left", "right"]))
def test_arms_against_a_plain_product(q, version, side):
    data = read_json(ICUB_FILE)
    expected = dh_product(data["torso"] + data["arm"][version][side], q, data["T_root_base"])
    chain = load_icub(arm=version).chains[side]
    found = chain.T_root_links(np.array(q))
    assert list(found) == list(expected)
    for link in expected:
        close(found[link], expected[link], 1e-12)


@settings(max_examples=30, deadline=None)
@given(angles, st.sampled_from(["v1", "v2"]), st.sampled_from(["head", "left_eye", "right_eye"]))
def test_heads_against_a_plain_product(q, version, name):
    data = read_json(ICUB_FILE)
    rows = data["torso"] + data["head"][version] + data["eyes"][name]
    chain = load_icub(head=version).chains[name]
    q = np.array(q[: len(chain.joints)])
    expected = dh_product(rows, q, data["T_root_base"])
    for link in chain.links:
        close(chain.T_root_link(link, q), expected[link], 1e-12)


@settings(max_examples=20, deadline=None)
@given(angles, st.sampled_from(["left", "right"]), st.sampled_from(["hand", "forearm", "upper_arm"]))
def test_jacobian_against_differences(q, side, link):
    chain, q, step = load_icub().chains[side], np.array(q), 1e-6
    points = np.array([[0.0, 0, 0], [0.03, -0.02, 0.05]])

    def place(q):
        T = chain.T_root_link(link, q)
        return points @ T[..., :3, :3].swapaxes(-1, -2) + T[..., None, :3, 3]

    moves = step * np.eye(10)
    expected = (place(q + moves) - place(q - moves)) / (2 * step)
    jacobian = chain.jacobian(link, q, points)
    close(jacobian, np.moveaxis(expected, 0, -1), 1e-8)
    close(chain.jacobian(link, q), jacobian[0], 1e-12)


def test_many_poses_are_those_of_each():
    chain = load_icub().chains["left"]
    q = np.random.default_rng(0).uniform(-1, 1, (2, 3, 10))
    many = chain.T_root_link("forearm", q)
    assert many.shape == (2, 3, 4, 4)
    close(many[1, 2], chain.T_root_link("forearm", q[1, 2]), 0)


def test_limits_and_cables():
    left = load_icub().chains["left"]
    assert left.joints == ARM_JOINTS
    elbow = ARM_JOINTS.index("elbow")
    close(np.rad2deg(left.limits_rad[elbow]), (5.5, 106))
    close(np.rad2deg(load_icub(limits="software").chains["left"].limits_rad[elbow]), (15, 106))
    # pitch 0, roll 10, yaw -90 degrees: roll + yaw = -80, below -66.6
    q = np.deg2rad([0, 0, 0, 0, 10, -90, 50, 0, 0, 0])
    close(np.rad2deg(left.cables @ q), (-17.1, 136.8, -80))
    assert (left.cables @ q < left.cables_lower_rad).tolist() == [False, False, True]
    assert (left.cables @ q > left.cables_upper_rad).tolist() == [False, True, False]
    assert load_icub().chains["head"].cables.shape == (0, 6)


def test_boards_report_the_torso_the_other_way_round():
    q = from_motor_order([[30, 20, 10]], [[1, 2, 3, 4, 5, 6]], HEAD_JOINTS)
    close(np.rad2deg(q), [[10, 20, 30, 1, 2, 3]], 1e-12)


@pytest.mark.parametrize(
    ("torso_deg", "head_deg", "says"),
    [
        ([[0, 0, 0], [0, 50, 0]], np.zeros((2, 6)), "row 1, torso_roll: 50 degrees"),
        ([0, 0, np.nan], np.zeros(6), "torso_pitch: nan"),
        ([0, 0], np.zeros(6), "rows of 3"),
        (np.zeros((2, 3)), np.zeros(6), "as many rows"),
        (np.zeros(3), np.zeros(2), "rows of 3"),
    ],
)
def test_impossible_angles_are_refused(torso_deg, head_deg, says):
    with pytest.raises(InputError, match=says):
        from_motor_order(torso_deg, head_deg, HEAD_JOINTS)


@pytest.mark.parametrize("versions", [{"head": "v3"}, {"arm": "v3"}, {"limits": "none"}])
def test_unknown_versions_are_refused(versions):
    with pytest.raises(InputError, match="choose one of"):
        load_icub(**versions)


def test_unknown_links_and_holders_are_refused():
    with pytest.raises(ValueError, match="no link 'tail'"):
        load_icub().chains["left"].T_root_link("tail", np.zeros(10))
    with pytest.raises(ValueError, match="no camera holder"):
        load_icub().T_root_camera(np.zeros(6), "upside-down")


@pytest.mark.parametrize("spoil", ["columns", "torso", "limits_deg", "camera_mounts"])
def test_spoilt_tables_are_refused(tmp_path, spoil):
    data = read_json(ICUB_FILE)
    changes = {
        "columns": ["joint"],
        "torso": [["torso_pitch", "torso_pitch", "long", 0, 90, 0]],
        "limits_deg": {"torso_pitch": [84, -22]},
        "camera_mounts": {"level": {"T_head_camera_m": np.diag([1, 2, 1, 1]).tolist()}},
    }
    write_json(tmp_path / "icub.json", data | {spoil: changes[spoil]})
    with pytest.raises(InputError, match="not the robot's tables"):
        read_tables(tmp_path / "icub.json")


def test_segments_join_up():
    icub = load_icub()
    head, left = np.deg2rad([10, 5, -15, -20, 10, 25]), np.deg2rad(GOLDEN_ARM_DEG)
    parts = {segment.part: segment for segment in body_segments(icub, Posture(head[:3], head[3:], left[3:]))}
    close(parts["left_hand"].end_m, icub.chains["left"].T_root_link("hand", left)[:3, 3])
    close(parts["head"].end_m, icub.chains["head"].T_root_link("head", head)[:3, 3])
    close(parts["left_forearm"].end_m, parts["left_hand"].start_m)
    # The right arm, left out, hangs from the same torso: as long as ever, and where the torso has it.
    right = icub.chains["right"].T_root_link("hand", np.deg2rad([10, 5, -15, *np.zeros(7)]))
    close(parts["right_hand"].end_m, right[:3, 3])


def test_the_thickness_of_every_part():
    radii_m = {segment.part: segment.radius_m for segment in body_segments(load_icub(), Posture())}
    arm = {"upper_arm": 0.035, "forearm": 0.03, "hand": 0.025, "fingers": 0.036}
    assert radii_m == {
        "torso": 0.07, "shoulders": 0.05, "neck": 0.03, "head": 0.06,
        **{f"{side}_{part}": radius for side in ("left", "right") for part, radius in arm.items()},
    }  # fmt: skip


@pytest.mark.parametrize("limb", ["left", "right"])
def test_segments_of_both_arms_follow_the_posture(limb):
    icub, q = load_icub(), np.deg2rad(GOLDEN_ARM_DEG)
    posture = Posture().moved(limb, q)
    parts = {segment.part: segment for segment in body_segments(icub, posture)}
    chain = icub.chains[limb]
    for part, begin, end in (("upper_arm", "shoulder_pitch", "upper_arm"), ("forearm", "elbow", "forearm")):
        segment = parts[f"{limb}_{part}"]
        close(segment.start_m, chain.T_root_link(begin, q)[:3, 3])
        close(segment.end_m, chain.T_root_link(end, q)[:3, 3])
    neck = icub.chains["head"].T_root_links(posture.angles("head"))
    close(parts["torso"].start_m, np.zeros(3))
    close(parts["torso"].end_m, neck["torso"][:3, 3])
    close(parts["neck"].end_m, parts["head"].start_m)
    close(parts["head"].start_m, neck["neck_roll"][:3, 3])
    shoulder = parts["shoulders"].start_m if limb == "left" else parts["shoulders"].end_m
    close(shoulder, chain.T_root_link("shoulder_pitch", q)[:3, 3])


def test_a_posture_says_which_limb_and_cannot_be_changed():
    posture = Posture(np.full(3, 1.0), np.full(3, 2.0), np.full(7, 3.0), np.full(7, 4.0))
    assert [posture.angles(chain)[-1] for chain in ("head", "left", "right")] == [2, 3, 4]
    moved = posture.moved("right", np.arange(10.0))
    assert moved.angles("right").tolist() == list(range(10))
    assert moved.angles("head").tolist() == [0, 1, 2, 2, 2, 2]
    assert moved.left_rad.tolist() == [3] * 7 and posture.torso_rad.tolist() == [1] * 3
    assert posture != Posture(*(getattr(posture, name) for name in vars(posture)))  # arrays: by identity
    with pytest.raises(AttributeError):
        posture.torso_rad = np.zeros(3)


def test_angles_may_overshoot_the_limits_by_five_degrees():
    low, high = np.rad2deg(load_icub().chains["head"].limits_rad[4])
    for limit, outward in ((low, -1), (high, 1)):
        q = from_motor_order(np.zeros(3), [0, limit + 4.999 * outward, 0], HEAD_JOINTS)
        close(np.rad2deg(q[4]), limit + 4.999 * outward)
        with pytest.raises(InputError, match="row 0, neck_roll: .* expected"):
            from_motor_order(np.zeros(3), [0, limit + 5.001 * outward, 0], HEAD_JOINTS)
    assert from_motor_order(np.zeros(3), [0, 10, 0, 50, 0, 0, 0], ARM_JOINTS).shape == (10,)
    with pytest.raises(InputError, match="of 7 or more"):
        from_motor_order(np.zeros(3), [0, 10, 0, 50, 0, 0], ARM_JOINTS)


@pytest.mark.parametrize(("rounding", "fits"), [(0.9e-4, True), (1.1e-4, False)])
def test_a_rotation_of_the_tables_may_be_rounded_and_no_more(tmp_path, rounding, fits):
    data = read_json(ICUB_FILE)
    data["T_root_base"][2][0] = 1 + rounding
    write_json(tmp_path / "icub.json", data)
    if fits:
        R = read_tables(tmp_path / "icub.json").T_root_base[:3, :3]
        close(R @ R.T, np.eye(3), 1e-12)
    else:
        with pytest.raises(InputError, match="not a rotation and a translation"):
            read_tables(tmp_path / "icub.json")
