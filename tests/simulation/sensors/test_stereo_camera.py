"""The depth camera against what stereo geometry says of planes, boxes and steps."""

from dataclasses import replace

import numpy as np
import pytest

from hicp_lib.simulation.appearance import materials
from hicp_lib.simulation.body.model import REGIONS
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.camera import PlacedCamera, look_at, pixel_rays
from hicp_lib.simulation.rendering.raycast import RayScene
from hicp_lib.simulation.rendering.surfaces import Surface
from hicp_lib.simulation.sensors.depth_alignment import align_to_colour
from hicp_lib.simulation.sensors.depth_camera import depth_imager, simulate_depth
from hicp_lib.simulation.sensors.stereo_camera import D435, D435_VGA
from tests.simulation.sensors.bare_depth import simulate_raw_depth, without_errors

GREY = materials.plain(np.full(3, 0.5))
# In the world as in the camera: x right, y down, z forward.
COLOUR = PlacedCamera(640, 480, 615.0, 615.0, 319.5, 239.5, np.eye(4))
EXACT = without_errors(D435)


def _wall(z, x=(-20, 20), y=(-20, 20), parts=None):
    mesh = g.quad([x[0], y[0], z], [x[1] - x[0], 0, 0], [0, y[1] - y[0], 0])
    return Surface(mesh, GREY, 0, None if parts is None else np.full(len(mesh.triangles), parts, np.int16))


def _raw(surfaces, settings, seed=0):
    return simulate_raw_depth(RayScene(surfaces), COLOUR, settings, np.random.default_rng(seed))


def _aligned(surfaces, settings, seed=0, colour=COLOUR):
    return simulate_depth(RayScene(surfaces), colour, settings, np.random.default_rng(seed))


# The table of sigma = z^2 s / (f B) for s = 0.08 px: metres, then millimetres.
@pytest.mark.parametrize(
    ("mode", "z_m", "sigma_mm"),
    [(D435, 0.5, 0.94), (D435, 1.0, 3.77), (D435, 3.0, 34.0), (D435_VGA, 1.0, 4.17), (D435_VGA, 2.0, 16.7)],
)
def test_noise_on_a_wall_has_the_spread_the_vendor_states(mode, z_m, sigma_mm):
    depth_m = _raw([_wall(z_m)], replace(mode, disparity_step_px=0, depth_units_per_m=0))[:, 80:]
    assert 1e3 * depth_m.std() == pytest.approx(sigma_mm, rel=0.05)
    assert depth_m.mean() == pytest.approx(z_m, rel=2e-3)


def test_noise_is_correlated_over_the_matching_window_and_no_further():
    noise = (
        D435.focal_baseline / _raw([_wall(1.0)], replace(D435, disparity_step_px=0, depth_units_per_m=0))
    )[:, 80:] - D435.focal_baseline
    correlation = [np.mean(noise[:, lag:] * noise[:, :-lag]) / noise.var() for lag in (1, 3, 10)]
    assert correlation[0] > 0.9 and 0.3 < correlation[1] < 0.8 and abs(correlation[2]) < 0.05


def test_noise_of_one_frame_says_nothing_of_the_next_ones():
    settings = replace(D435, disparity_step_px=0, depth_units_per_m=0, width_px=1700)
    wall = [_wall(1.0)]
    noise = np.stack([_raw(wall, settings, seed)[:, 80:].ravel() for seed in range(4)]).astype(float) - 1.0
    assert np.abs(np.corrcoef(noise) - np.eye(4)).max() < 0.05
    assert noise.std() == pytest.approx(3.77e-3, rel=0.05)  # in an image wider than the noise that is kept


@pytest.mark.parametrize("mode", [D435, D435_VGA])
@pytest.mark.parametrize("z_m", [0.3, 0.5, 1.0, 2.0])
def test_the_left_edge_has_a_band_as_wide_as_the_disparity(mode, z_m):
    settings = replace(without_errors(mode), left_band=True)
    missing = np.isnan(_raw([_wall(z_m)], settings))
    width = missing.sum(axis=1)
    assert (np.abs(width - mode.focal_baseline / z_m) <= 1).all()
    assert not missing[:, width.max() :].any()


@pytest.mark.parametrize("mode", [D435, D435_VGA])
def test_nothing_nearer_than_the_searched_disparities_allow(mode):
    nearest_m = mode.focal_px * mode.baseline_m / 126
    settings = replace(without_errors(mode), nearest_m=mode.nearest_m)
    assert np.isnan(_raw([_wall(nearest_m - 1e-3)], settings)).all()
    assert np.isfinite(_raw([_wall(nearest_m + 1e-3)], settings)).all()


def test_nothing_beyond_the_longest_range_or_where_nothing_is():
    assert np.isnan(_raw([_wall(10.1)], replace(EXACT, max_range_m=10))).all()
    assert np.isfinite(_raw([_wall(9.9)], replace(EXACT, max_range_m=10))).all()
    assert np.isnan(_aligned([_wall(1.0, x=(5, 6))], D435)).all()


def test_shadow_lies_left_of_a_box_only_and_is_as_wide_as_disparities_differ():
    near_m, far_m = 0.8, 2.0
    surfaces = [Surface(g.box([-0.1, -0.1, near_m], [0.1, 0.1, near_m + 0.05]), GREY), _wall(far_m)]
    missing = np.isnan(_raw(surfaces, replace(EXACT, shadow=True)))
    rows, columns = np.nonzero(missing)
    left = depth_imager(COLOUR, EXACT)
    edge_px = left.cx_px + left.fx_px * (-0.1 - EXACT.colour_offset_m) / near_m
    expected_px = EXACT.focal_baseline * (1 / near_m - 1 / far_m)
    widths = missing.sum(axis=1)
    box_rows = np.abs(np.arange(left.height_px) - left.cy_px) < 0.1 / near_m * left.fx_px - 1
    assert (np.abs(widths[box_rows] - expected_px) <= 1.5).all()
    assert columns.max() <= edge_px + 1 and columns.min() >= edge_px - expected_px - 2
    assert np.abs(rows - left.cy_px).max() <= 0.1 / near_m * left.fx_px + 1  # none above or below


def test_a_shadow_beside_a_thin_thing_ends_where_the_right_imager_sees_past_it():
    near_m, far_m = 0.5, 2.0
    finger = _wall(near_m, x=(-0.01, 0.01), y=(-1, 1))
    missing = np.isnan(_raw([finger, _wall(far_m)], replace(EXACT, shadow=True)))
    # It hides a strip of its own width, beside it by the difference of disparities.
    width_px = 0.02 * EXACT.focal_px / near_m
    edge_px = depth_imager(COLOUR, EXACT).cx_px + EXACT.focal_px * (-0.01 - EXACT.colour_offset_m) / near_m
    start_px = edge_px - EXACT.focal_baseline * (1 / near_m - 1 / far_m)
    columns = np.flatnonzero(missing[240])
    assert abs(len(columns) - width_px) <= 1.5
    assert abs(columns[0] - start_px) <= 1.5 and np.ptp(columns) == len(columns) - 1


def test_a_slanted_wall_casts_no_shadow_on_itself():
    slanted = Surface(g.quad([-2, -3, 3.5], [4, 0, -3], [0, 6, 0]), GREY)
    back = Surface(g.quad([-2, -3, 0.6], [4, 0, 3], [0, 6, 0]), GREY)
    for surface in (slanted, back):
        alone = _raw([surface], replace(EXACT, shadow=True))
        assert (np.isfinite(alone) == np.isfinite(_raw([surface], EXACT))).all()


def test_disparity_and_depth_are_multiples_of_their_steps():
    wall = [Surface(g.quad([-9, -9, 0.5], [18, 0, 4], [0, 18, 0]), GREY)]
    disparity = D435.focal_baseline / _raw(wall, replace(EXACT, disparity_step_px=1 / 32))
    steps = 32 * disparity[np.isfinite(disparity)]
    assert np.abs(steps - np.rint(steps)).max() < 1e-3
    depth_mm = 1e3 * _raw(wall, D435).astype(float)
    depth_mm = depth_mm[np.isfinite(depth_mm)]
    assert np.abs(depth_mm - np.rint(depth_mm)).max() < 1e-3 and len(np.unique(depth_mm)) > 100


def test_flying_pixels_lie_between_two_depths_near_the_step_and_nowhere_else():
    surfaces = [_wall(1.0, x=(-30, 0)), _wall(2.0)]
    depth_m = _raw(surfaces, replace(EXACT, edge_px=2.5, window_px=7))
    column = depth_imager(COLOUR, EXACT).cx_px - EXACT.focal_px * EXACT.colour_offset_m
    flying = (depth_m > 1.01) & (depth_m < 1.99)
    where = np.nonzero(flying)[1]
    assert 0.2 < flying.sum() / len(depth_m) < 4  # per row
    assert np.abs(where - column).max() <= 7
    sharp = _raw(surfaces, EXACT)
    assert not ((sharp > 1.01) & (sharp < 1.99)).any()
    holes = np.isnan(depth_m).sum()
    assert holes / (holes + flying.sum()) == pytest.approx(D435.edge_holes, abs=0.15)


def test_hair_gives_holes_and_skin_does_not():
    settings = replace(EXACT, hair_holes=0.3)
    scalp, face = (REGIONS.index(name) for name in ("scalp", "face"))
    assert np.isnan(_raw([_wall(1.0, parts=scalp)], settings)).mean() == pytest.approx(0.3, abs=0.03)
    assert np.isfinite(_raw([_wall(1.0, parts=face)], settings)).all()


def test_without_errors_a_wall_is_exact():
    aligned = _aligned([_wall(1.3)], EXACT)
    assert aligned.shape == (480, 640) and aligned.dtype == np.float32
    assert np.abs(aligned - 1.3).max() < 1e-6


@pytest.mark.parametrize("mode", [D435, D435_VGA])
def test_without_errors_depth_lies_within_that_of_the_pixels_around(mode):
    pose = look_at([0.3, -2.0, 1.2], [0, 0, 0.9], roll_rad=0.1)
    colour = replace(COLOUR, T_world_camera=pose)
    angle = np.linspace(-np.pi / 2, np.pi / 2, 65)
    ball = g.lathe(np.c_[0.3 * np.cos(angle), 0.3 * np.sin(angle)], [0, 0, 0.9], 128)
    scene = RayScene([Surface(g.quad([-9, -9, 0], [18, 0, 0], [0, 18, 0]), GREY), Surface(ball, GREY, 0)])
    exact = (21.2 / scene.trace(pixel_rays(colour)).depth_m).reshape(480, 640)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(exact, 2, mode="edge"), (5, 5))
    found = 21.2 / simulate_depth(scene, colour, without_errors(mode), np.random.default_rng(0))
    seen = np.isfinite(found)
    assert seen.sum() > 0.95 * (exact > 0).sum()
    # 0.03 px of disparity is what interpolation between cast rays may cost; 1.3 mm at one metre.
    assert (found >= around.min(axis=(2, 3)) - 0.03)[seen].all()
    assert (found <= around.max(axis=(2, 3)) + 0.03)[seen].all()


def test_alignment_moves_near_things_further_and_keeps_the_nearer():
    for z_m in (0.4, 2.0):
        patch = _wall(z_m, x=(-0.05, 0.05), y=(-0.05, 0.05))
        rows, columns = np.nonzero(np.isfinite(_aligned([patch], EXACT)))
        # The middle stays that of the colour camera, wherever the left imager sees it.
        assert columns.mean() == pytest.approx(COLOUR.cx_px, abs=0.8)
        assert rows.mean() == pytest.approx(COLOUR.cy_px, abs=0.8)
        shift_px = np.nonzero(np.isfinite(_raw([patch], EXACT)))[1].mean() - depth_imager(COLOUR, EXACT).cx_px
        assert shift_px == pytest.approx(-EXACT.focal_px * 0.015 / z_m, abs=0.8)
    both = _aligned([_wall(0.5, x=(-0.1, 0.1), y=(-0.1, 0.1)), _wall(2.0)], EXACT)
    assert both[240, 320] == pytest.approx(0.5) and not np.isnan(both[100:380, 100:540]).all(axis=0).any()


def test_alignment_opens_a_gap_left_of_near_things_only_and_knows_no_other_depths():
    left = depth_imager(COLOUR, D435)
    near_left, near_right = (np.full((480, 848), z, np.float32) for z in (0.9, 1.5))
    near_left[:, 420:], near_right[:, 420:] = 1.5, 0.9
    covered, opened = (align_to_colour(depth_m, left, COLOUR) for depth_m in (near_left, near_right))
    assert np.isfinite(covered).all()
    gap_px = np.isnan(opened).sum(axis=1)
    assert (np.abs(gap_px - COLOUR.fx_px * 0.015 * (1 / 0.9 - 1 / 1.5)) <= 1.5).all()  # pixels filled whole
    for aligned in (covered, opened):
        assert set(np.unique(aligned[np.isfinite(aligned)])) == {np.float32(0.9), np.float32(1.5)}
    wide = replace(COLOUR, width_px=1280, height_px=720, fx_px=918.0, fy_px=918.0, cx_px=639.5, cy_px=359.5)
    assert np.isfinite(align_to_colour(near_left, left, wide)).all()


def test_the_same_generator_gives_the_same_depth_and_another_another():
    surfaces = [_wall(1.0, x=(-0.2, 0.2)), _wall(2.0)]
    first, again, other = (_aligned(surfaces, D435, seed) for seed in (4, 4, 5))
    assert np.array_equal(first, again, equal_nan=True) and not np.array_equal(first, other, equal_nan=True)


def test_the_aligned_image_is_that_of_the_whole_raw_one_where_errors_are_off():
    surfaces = [_wall(0.6, x=(-0.2, -0.05), y=(-0.2, 0.1)), _wall(1.5, x=(0, 3)), _wall(2.5)]
    settings = replace(EXACT, shadow=True, left_band=True, nearest_m=0.168)
    whole = align_to_colour(_raw(surfaces, settings), depth_imager(COLOUR, settings), COLOUR)
    assert np.allclose(whole, _aligned(surfaces, settings), equal_nan=True)
