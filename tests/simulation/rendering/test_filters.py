"""Sums that stop where a surface does, and normals that follow heights."""

import numpy as np
import pytest

from hicp_lib.simulation.rendering.filters import sum_within, tilt_by_height
from hicp_lib.simulation.rendering.gbuffer import GBuffer, View
from hicp_lib.simulation.rendering.raycast import Trace

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


def test_a_slope_of_heights_turns_the_normal_against_it():
    surface = np.where(U < 12, 0, 1).astype(np.int16).ravel()
    nothing = np.zeros(len(surface), np.int32), surface, np.zeros((len(surface), 2), np.float32)
    trace = Trace(np.ones(len(surface), np.float32), *nothing)
    seen = GBuffer(View(trace, np.zeros(3, np.float32), FLAT), np.ones((ROWS, COLUMNS), bool))
    normals, slope = UP.reshape(3, -1)[:, seen.pixels].astype(np.float32), 0.5
    height_m = (0.01 + slope * FLAT[0].ravel()[seen.pixels]).astype(np.float32)
    tilted = np.empty((3, ROWS, COLUMNS))
    tilted.reshape(3, -1)[:, seen.pixels] = tilt_by_height(normals, height_m, seen)
    expected = np.array([-slope, 0, 1]) / np.hypot(slope, 1)
    inner = tilted[:, :-1, np.r_[:11, 12 : COLUMNS - 1]]
    assert np.abs(inner - expected[:, None, None]).max() < 1e-4
    assert (tilted[:, :, 11] == UP[:, :, 11]).all()  # beside another surface
    assert (tilted[:, -1] == UP[:, -1]).all() and (tilted[:, :, -1] == UP[:, :, -1]).all()


def test_pixels_lie_surface_by_surface():
    surface = np.where(U < 12, 3, -1).astype(np.int16)
    surface[:5, :5] = 1
    trace = Trace(
        np.ones(surface.size, np.float32), surface.ravel(), surface.ravel(), np.zeros((surface.size, 2))
    )
    seen = GBuffer(View(trace, np.zeros(3, np.float32), FLAT), V < 10)
    assert [(number, len(seen.pixels[part])) for number, part in seen.parts] == [(1, 25), (3, 95)]
    assert all((surface.ravel()[seen.pixels[part]] == number).all() for number, part in seen.parts)
