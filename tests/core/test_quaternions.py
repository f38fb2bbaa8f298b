"""Rotations and quaternions agree with SciPy's to the last digit: no result depends on whose they are."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from hicp_lib.core.quaternions import matrices_from_quaternions, quaternions_from_matrices


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
