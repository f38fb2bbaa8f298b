"""The time-of-flight camera against what phases say of walls, steps, hair and stray light."""

from dataclasses import replace

import numpy as np
import pytest

from hicp_lib.simulation.appearance import materials
from hicp_lib.simulation.body.model import REGIONS
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.camera import PlacedCamera
from hicp_lib.simulation.rendering.raycast import RayScene
from hicp_lib.simulation.rendering.surfaces import Surface
from hicp_lib.simulation.sensors.depth_camera import depth_imager, simulate_depth
from hicp_lib.simulation.sensors.time_of_flight import AZURE_KINECT
from tests.simulation.sensors.bare_depth import simulate_raw_depth

GREY = materials.plain(np.full(3, 0.5))
COLOUR = PlacedCamera(640, 480, 615.0, 615.0, 319.5, 239.5, np.eye(4))
EXACT = replace(
    AZURE_KINECT, axial_noise_m=0, blur_px=0, stray=0, wiggle_m=0, least_amplitude=0, depth_units_per_m=0
)
MIDDLE = np.s_[200:376, 220:420]


def _wall(z, x=(-20, 20), y=(-20, 20), parts=None):
    mesh = g.quad([x[0], y[0], z], [x[1] - x[0], 0, 0], [0, y[1] - y[0], 0])
    return Surface(mesh, GREY, 0, None if parts is None else np.full(len(mesh.triangles), parts, np.int16))


def _raw(surfaces, settings, seed=0):
    return simulate_raw_depth(RayScene(surfaces), COLOUR, settings, np.random.default_rng(seed))


def test_without_errors_walls_are_exact_and_aligned_to_where_the_colour_camera_sees_them():
    walls = RayScene([_wall(1.0, x=(-20, 0)), _wall(2.0)])
    aligned = simulate_depth(walls, COLOUR, EXACT, np.random.default_rng(0))
    near, far = aligned[100:380, 40:315], aligned[100:380, 345:600]
    assert np.nanmax(abs(near - 1.0)) < 1e-5 and np.nanmax(abs(far - 2.0)) < 1e-5
    # The imager is to the left: behind the near wall's right edge it sees less, by f B (1 / z - 1 / z').
    hidden_px = np.isnan(aligned[240, 300:380]).sum()
    assert hidden_px == pytest.approx(615 * 0.032 * (1 - 1 / 2), abs=2)


def test_noise_grows_with_the_square_of_the_distance_and_stays_within_the_vendors():
    noise_m = [
        _raw([_wall(z)], replace(AZURE_KINECT, depth_units_per_m=0))[MIDDLE].std() for z in (1.0, 2.0, 3.5)
    ]
    assert noise_m[1] / noise_m[0] == pytest.approx(4, rel=0.1)
    assert 0.0005 < noise_m[0] < 0.002 and noise_m[2] < 0.017


@pytest.mark.parametrize("z_m", [0.6, 1.0, 1.7, 2.5, 3.5])
def test_a_wall_is_systematically_off_by_no_more_than_the_vendor_states(z_m):
    off_m = abs(_raw([_wall(z_m)], AZURE_KINECT)[MIDDLE].mean() - z_m)
    assert off_m < 0.011 + 0.001 * z_m


def test_neither_too_near_nor_too_far_nor_where_nothing_is():
    for z_m, is_seen in ((0.49, False), (0.51, True), (3.8, True), (3.9, False)):
        assert np.isfinite(_raw([_wall(z_m)], EXACT)[MIDDLE]).all() == is_seen
    assert np.isnan(_raw([_wall(1.0, x=(5, 6))], AZURE_KINECT)).all()


def test_flying_pixels_lie_at_the_step_only():
    surfaces = [_wall(1.0, x=(-30, 0)), _wall(1.4)]
    depth_m = _raw(surfaces, replace(EXACT, blur_px=0.7))
    step = depth_imager(COLOUR, EXACT).cx_px + 504.0 * 0.032 / 1.0
    flying = (abs(depth_m - 1.0) > 0.01) & (abs(depth_m - 1.4) > 0.01)
    assert 0.5 < flying.sum() / len(depth_m) < 4  # per row
    assert abs(np.nonzero(flying)[1] - step).max() <= 3
    assert not (abs(_raw(surfaces, EXACT) - 1.2) < 0.19).any()


def test_hair_is_noisier_and_far_away_has_no_depth():
    scalp, face = (REGIONS.index(name) for name in ("scalp", "face"))
    near = [_raw([_wall(1.0, parts=part)], AZURE_KINECT)[MIDDLE].std() for part in (face, scalp)]
    assert near[1] > 3 * near[0]
    assert np.isnan(_raw([_wall(3.5, parts=scalp)], AZURE_KINECT)[MIDDLE]).all()
    assert np.isfinite(_raw([_wall(3.5, parts=face)], AZURE_KINECT)[MIDDLE]).all()


def test_a_bright_thing_pulls_what_is_beside_it_nearer():
    surfaces = [_wall(0.6, x=(-1, 0)), _wall(1.2)]
    beside = np.s_[200:376, 355:375]
    pulled, alone = _raw(surfaces, replace(EXACT, stray=0.02))[beside], _raw(surfaces, EXACT)[beside]
    assert 0.001 < np.median(alone - pulled) < 0.03
