"""Sums that stop where a surface does, and normals that follow heights."""

import numpy as np
import pytest

from hicp_lib.simulation.rendering.filters import sum_within, tilt_by_height
from hicp_lib.simulation.rendering.gbuffer import GBuffer

ROWS, COLUMNS = 20, 24
V, U = np.mgrid[:ROWS, :COLUMNS].astype(np.float32)
FLAT = np.stack([0.01 * U, 0.01 * V, 0 * U])  # a plane seen from above, 1 cm from pixel to pixel
UP = np.stack([0 * U, 0 * U, 0 * U + 1])
ONE_SURFACE = np.zeros((ROWS, COLUMNS), np.int16)


def test_on_one_plane_each_round_sums_four_by_four():
    ones = np.ones((1, ROWS, COLUMNS), np.int16)
    for rounds in (1, 2, 3):
        sums = sum_within(ones, ONE_SURFACE, FLAT, UP, rounds)[0]
        inner = slice(2 * rounds, -2 * rounds)
        assert (sums[inner, inner] == 16**rounds).all() and sums.max() == 16**rounds


@pytest.mark.parametrize("cause", ["surface", "step"])
def test_sums_do_not_cross_to_another_surface_or_over_a_step(cause):
    right = U >= 12
    surface = np.where(right, 1, 0).astype(np.int16) if cause == "surface" else ONE_SURFACE
    positions = FLAT + (0 if cause == "surface" else 0.1 * UP * right)
    only_right = right.astype(np.int16)[None]
    sums = sum_within(only_right, surface, positions, UP, 2)[0]
    assert (sums[:, :12] == 0).all() and (sums[:, 12:] > 0).all()


def _view(surface: np.ndarray) -> GBuffer:
    pixels = np.flatnonzero(surface.ravel() >= 0)
    n = len(pixels)
    depth_m = np.ones((ROWS, COLUMNS), np.float32)
    return GBuffer(pixels, surface, depth_m, FLAT, np.zeros((3, n)), np.zeros(n, int), np.zeros((n, 2)))


def test_a_slope_of_heights_turns_the_normal_against_it():
    normals, slope = UP.astype(np.float32), 0.5
    height_m = (0.01 + slope * FLAT[0]).astype(np.float32)
    surface = np.where(U < 12, 0, 1).astype(np.int16)
    tilt_by_height(normals, height_m, _view(surface))
    expected = np.array([-slope, 0, 1]) / np.hypot(slope, 1)
    inner = normals[:, :-1, np.r_[:11, 12 : COLUMNS - 1]]
    assert np.abs(inner - expected[:, None, None]).max() < 1e-4
    assert (normals[:, :, 11] == UP[:, :, 11]).all()  # beside another surface


def test_values_come_back_from_the_grid():
    surface = np.where((U + V) % 3 == 0, 0, -1).astype(np.int16)
    view = _view(surface)
    values = np.random.default_rng(0).random((2, len(view.pixels)), np.float32)
    grid = view.on_grid(values)
    assert grid.shape == (2, ROWS, COLUMNS) and (grid[:, surface < 0] == 0).all()
    assert (view.from_grid(grid) == values).all()
