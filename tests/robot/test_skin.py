"""Taxels: counts, places and directions the robot's software is documented to have."""

from __future__ import annotations

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json, write_json
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.skin import SKIN_FILE, read_skin

ARMS_DOWN = Posture()
MIRROR = np.array([1, -1, 1])


@pytest.fixture
def at_zero(icub):
    skin = read_skin()
    positions, normals = skin.in_root(icub, ARMS_DOWN)
    return {part: (positions[rows], normals[rows]) for part, rows in skin.slices.items()}


def test_documented_counts():
    slices = read_skin().slices
    counts = {part: rows.stop - rows.start for part, rows in slices.items()}
    assert counts.pop("torso") == 44
    for side in ("left", "right"):
        assert counts.pop(f"{side}_hand") == 5
        assert counts.pop(f"{side}_forearm") == 24
        assert 35 <= counts.pop(f"{side}_upper_arm") <= 39
    assert not counts


def test_normals_are_unit_vectors():
    np.testing.assert_allclose(np.linalg.norm(read_skin().normals, axis=1), 1, atol=1e-12)


@pytest.mark.parametrize(("side", "y"), [("left", -0.110116), ("right", 0.110116)])
def test_forearm_lies_around_the_line_from_elbow_to_wrist(at_zero, side, y):
    positions, normals = at_zero[f"{side}_forearm"]
    across = positions[:, :2] - (-0.010817, y)
    distance = np.linalg.norm(across, axis=1)
    assert 0.0300 < distance.min() and distance.max() < 0.0485
    assert positions[:, 2].min() > -0.0895 and positions[:, 2].max() < -0.0175
    assert (np.einsum("ij,ij->i", across, normals[:, :2]) > 0.02).all()  # outward


def test_palms_face_inward(at_zero):
    np.testing.assert_allclose(at_zero["left_hand"][1], np.tile((0, 1, 0), (5, 1)), atol=1e-12)
    np.testing.assert_allclose(at_zero["right_hand"][1], np.tile((0, -1, 0), (5, 1)), atol=1e-12)


@pytest.mark.parametrize(("part", "tolerance_m"), [("hand", 1e-9), ("upper_arm", 1e-9), ("forearm", 0.01)])
def test_sides_mirror_each_other(at_zero, part, tolerance_m):
    """As sets of taxels: the right forearm's is documented to be moved and turned by a little."""
    left, right = at_zero[f"left_{part}"], at_zero[f"right_{part}"]
    distance = np.linalg.norm(left[0][:, None] * MIRROR - right[0][None], axis=2)
    assert distance.min(axis=1).max() <= tolerance_m
    np.testing.assert_allclose(left[1].mean(axis=0) * MIRROR, right[1].mean(axis=0), atol=5e-3)


def test_torso_faces_forward_and_upper_arms_outward(at_zero):
    positions, normals = at_zero["torso"]
    assert (normals[:, 0] < 0).all() and (positions[:, 0] < 0).all()  # x is backward
    assert at_zero["left_upper_arm"][1][:, 1].mean() < -0.2
    # Every taxel of an upper arm is as far from the line between shoulder and elbow.
    across = at_zero["left_upper_arm"][0][:, :2] - (-0.010817, -0.110116)
    np.testing.assert_allclose(np.linalg.norm(across, axis=1), 0.045, atol=1e-6)


def test_skin_moves_with_its_links(icub, home):
    skin = read_skin()
    positions, normals = skin.in_root(icub, home)
    rows = skin.slices["left_hand"]
    T = icub.chains["left"].T_root_link("hand", home.angles("left"))
    expected = [T @ [*point, 1] for point in skin.positions_m[rows]]
    np.testing.assert_allclose(positions[rows], np.array(expected)[:, :3], atol=1e-12)
    np.testing.assert_allclose(normals[rows], np.tile(-T[:3, 2], (5, 1)), atol=1e-12)


@pytest.mark.parametrize(
    "change",
    [
        {"columns": ["x_mm"]},
        {"parts": {"left_hand": {"taxels": [[0, 0, 0]]}}},
        {"parts": {"left_hand": {"mirrors": {"part": "left_hand"}}}},
        {"parts": {"left_hand": {"patch": {"start_mm": [0, 0, 0]}}}},
        {"parts": {"left_hand": {}}},
    ],
)
def test_spoilt_skin_is_refused(tmp_path, change):
    write_json(tmp_path / "skin.json", read_json(SKIN_FILE) | change)
    with pytest.raises(InputError, match="not the robot's skin"):
        read_skin(tmp_path / "skin.json")
