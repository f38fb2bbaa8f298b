"""Rigid alignment: exact on exact points, the best proper rotation, and refusals."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from hicp_lib.core.alignment import arun
from hicp_lib.core.errors import InputError

seeds = st.integers(0, 2**32 - 1)
quaternions = arrays(float, 4, elements=st.floats(-1, 1)).filter(lambda q: np.linalg.norm(q) > 0.1)
shifts = arrays(float, 3, elements=st.floats(-3, 3))


def moved(points, quaternion, shift):
    return Rotation.from_quat(quaternion).apply(points) + shift


@given(seeds, st.integers(3, 12), quaternions, shifts)
def test_random_transforms_are_recovered_exactly(seed, n, quaternion, shift):
    points = np.random.default_rng(seed).uniform(-1, 1, (n, 3))
    fit = arun(points, moved(points, quaternion, shift))
    assume(fit.spread_ratio > 0.1)
    assert np.abs(fit.T_b_a[:3, :3] - Rotation.from_quat(quaternion).as_matrix()).max() < 1e-12
    assert np.abs(fit.T_b_a[:3, 3] - shift).max() < 1e-12
    assert fit.rms_m < 1e-12 and fit.residuals_m.max() < 1e-12


@given(seeds, quaternions)
def test_turned_about_the_origin_noise_moves_it_nowhere(seed, quaternion):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (8, 3)) + [0, 0, 3]
    turn = Rotation.from_quat(quaternion)
    exact, noisy = turn.apply(points), turn.apply(points * rng.uniform(0.9, 1, (8, 1)))
    assert np.abs(arun(points, exact, about_origin=True).T_b_a[:3, :3] - turn.as_matrix()).max() < 1e-12
    fit = arun(points, noisy, about_origin=True)  # each too near, on its own line of sight
    assert np.array_equal(fit.T_b_a[:3, 3], np.zeros(3))
    assert np.abs(fit.T_b_a[:3, :3] - turn.as_matrix()).max() < 1e-12


@given(seeds, quaternions, shifts)
def test_points_in_a_plane_give_a_rotation_not_its_mirror_image(seed, quaternion, shift):
    points = np.random.default_rng(seed).uniform(-1, 1, (6, 3)) * [1, 1, 0]
    fit = arun(points, moved(points, quaternion, shift))
    assume(fit.spread_ratio > 0.1)
    assert np.linalg.det(fit.T_b_a[:3, :3]) == pytest.approx(1)
    assert np.abs(fit.T_b_a[:3, :3] - Rotation.from_quat(quaternion).as_matrix()).max() < 1e-12


@given(seeds, quaternions)
def test_noisy_points_get_the_rotation_scipy_finds(seed, quaternion):
    rng = np.random.default_rng(seed)
    a = rng.uniform(-1, 1, (8, 3))
    b = moved(a, quaternion, [1, 2, 3]) + rng.normal(0, 0.3, a.shape)
    fit = arun(a, b)
    expected, _ = Rotation.align_vectors(b - b.mean(axis=0), a - a.mean(axis=0))
    assert np.abs(fit.T_b_a[:3, :3] - expected.as_matrix()).max() < 1e-8


def test_a_reflection_is_answered_by_the_best_rotation():
    a = np.random.default_rng(0).uniform(-1, 1, (8, 3))
    b = a * [1, 1, -1]
    fit = arun(a, b)
    assert np.linalg.det(fit.T_b_a[:3, :3]) == pytest.approx(1)
    expected, _ = Rotation.align_vectors(b - b.mean(axis=0), a - a.mean(axis=0))
    assert np.abs(fit.T_b_a[:3, :3] - expected.as_matrix()).max() < 1e-10


def test_leave_one_out_shows_the_point_that_is_wrong_more_than_its_residual_does():
    a = np.random.default_rng(1).uniform(-1, 1, (8, 3))
    b = a.copy()
    b[3] += [0.1, 0, 0]
    fit = arun(a, b)
    assert fit.leave_one_out_m[3] == pytest.approx(0.1)
    assert fit.residuals_m[3] < 0.1 and fit.leave_one_out_m.argmax() == 3


def test_three_points_fix_a_transform_but_none_of_them_can_be_left_out():
    a = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    fit = arun(a, a + 1)
    assert np.allclose(fit.T_b_a, [[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1], [0, 0, 0, 1]], atol=1e-14)
    assert np.isnan(fit.leave_one_out_m).all()


@pytest.mark.parametrize(
    "points, said",
    [
        (np.linspace(0, 1, 8)[:, None] * [1, 2, 3], "on a line or in one place (singular-value ratio"),
        (np.ones((8, 3)), "on a line or in one place (singular-value ratio 0.0e+00"),
        (np.eye(3)[:2], "2 matched points do not fix"),
        (np.array([[0, 0, 0], [1, 0, 0], [0, 1, np.nan]]), "must be finite"),
    ],
)
def test_points_that_determine_nothing_are_refused_in_one_line(points, said):
    with pytest.raises(InputError) as error:
        arun(points, points)
    assert said in str(error.value) and "\n" not in str(error.value)


@given(seeds)
def test_a_line_of_points_is_refused_whichever_side_it_is_on(seed):
    rng = np.random.default_rng(seed)
    line = rng.uniform(-1, 1, (6, 1)) * rng.normal(size=3) + rng.uniform(-2, 2, 3)
    spread = rng.uniform(-1, 1, (6, 3))
    for a, b in ((line, spread), (spread, line)):
        with pytest.raises(InputError, match="singular-value ratio"):
            arun(a, b)
