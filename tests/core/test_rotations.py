from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hicp_lib.core.rotations import (
    about,
    between,
    matrices_from_quaternions,
    quaternions_from_matrices,
    rotation,
    rotations_from_vectors,
)

VECTORS = st.tuples(*[st.floats(-4, 4)] * 3).map(np.array)


@given(VECTORS)
def test_rotations_are_rotations_about_their_vector(vector):
    R = rotation(vector)
    assert R @ R.T == pytest.approx(np.eye(3), abs=1e-12) and np.linalg.det(R) == pytest.approx(1)
    assert R @ vector == pytest.approx(vector, abs=1e-12)
    assert np.trace(R) == pytest.approx(1 + 2 * np.cos(np.linalg.norm(vector)), abs=1e-12)
    assert rotation(-vector) == pytest.approx(R.T, abs=1e-12)


def test_a_quarter_turn_goes_the_right_way():
    assert rotation((0, 0, np.pi / 2)) @ [1, 0, 0] == pytest.approx([0, 1, 0], abs=1e-15)
    assert rotation((0, 0, 0)) == pytest.approx(np.eye(3), abs=0)


@given(st.integers(0, 2), st.floats(-7, 7))
def test_axes(axis, angle):
    assert about(axis, angle) == pytest.approx(rotation(angle * np.eye(3)[axis]), abs=1e-12)


@given(VECTORS, VECTORS)
def test_the_smallest_rotation_between_directions(a, b):
    if min(np.linalg.norm(a), np.linalg.norm(b)) < 1e-3:
        return
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    R = between(a, b)
    assert R @ a == pytest.approx(b, abs=1e-6)
    assert np.trace(R) == pytest.approx(1 + 2 * (a @ b), abs=1e-6)


@pytest.mark.parametrize("axis", range(3))
def test_opposite_directions(axis):
    a = np.eye(3)[axis]
    assert between(a, -a) @ a == pytest.approx(-a, abs=1e-12)
    assert between(a, a) == pytest.approx(np.eye(3))


def test_many_at_once():
    vectors = np.random.default_rng(0).normal(size=(7, 3))
    assert rotations_from_vectors(vectors) == pytest.approx(
        np.array([rotation(v) for v in vectors]), abs=1e-14
    )


def quaternions() -> np.ndarray:
    """Of any length and direction, the ones of half turns and of no turn among them."""
    some = np.random.default_rng(0).normal(size=(5000, 4))
    return np.concatenate([some, np.eye(4), -np.eye(4)])


def test_matrices_are_those_of_scipy():
    assert (matrices_from_quaternions(quaternions()) == Rotation.from_quat(quaternions()).as_matrix()).all()


def test_quaternions_are_those_of_scipy_with_w_not_negative():
    rotations = Rotation.from_quat(quaternions()).as_matrix()
    found = quaternions_from_matrices(rotations)
    assert (found == Rotation.from_matrix(rotations).as_quat(canonical=True)).all()
    assert (found[:, 3] >= 0).all()
