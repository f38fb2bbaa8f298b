"""Candidates for depths against what the head of the module says they cost."""

import numpy as np
import pytest

from hicp_lib.core.camera import Camera
from hicp_lib.core.keypoints import INDEX
from hicp_lib.lifting.depth_candidates import (
    RADIUS_M,
    Candidates,
    depth_candidates,
    depth_costs,
    refine_depths,
)

CAMERA = Camera(64, 48, 100.0, 100.0, 31.5, 23.5)
WRIST, ELBOW, FINGER = INDEX["left_wrist"], INDEX["left_elbow"], INDEX["left_index_4"]


def candidates(depth_m, cost) -> Candidates:
    """Of elbows."""
    rows = np.atleast_2d(np.array(depth_m, float))
    costs = np.broadcast_to(np.array(cost, float), rows.shape)
    return Candidates(np.tile([0.0, 0.0, 1.0], (len(rows), 1)), rows, costs, np.full(len(rows), ELBOW))


def around(keypoint, pixel_px, depth_m, below_m=0.0) -> Candidates:
    """Of one keypoint that is about a metre away."""
    place_px, below = np.array([pixel_px], float), np.full(136, below_m)
    return depth_candidates(np.array([keypoint]), place_px, np.ones(1), depth_m, CAMERA, below)


def test_a_surface_costs_the_square_of_its_distance_and_what_is_behind_it_five():
    grid_m = np.arange(0.9, 1.2, 0.01)
    costs = depth_costs(candidates([1.0, np.nan], 0.5), grid_m)[0]
    expected = {1.0: 0.5, 1.01: 1.5, 1.02: 4.5, 1.03: 5.0, 1.1: 5.0, 0.98: 4.5, 0.95: 20.0}
    for depth_m, cost in expected.items():
        assert costs[round((depth_m - 0.9) / 0.01)] == pytest.approx(cost, abs=1e-6)


def test_the_cheapest_explanation_counts():
    grid_m = np.arange(0.9, 1.2, 0.01)
    costs = depth_costs(candidates([1.0, 1.02, 1.05], [3.0, 0.0, 9.0]), grid_m)[0]
    assert costs[10] == pytest.approx(3.0)  # its own cost, not two steps from the cheaper one: 4
    assert costs[12] == pytest.approx(0.0) and costs[15] == pytest.approx(5.0)  # hidden is cheaper than 9


def test_depths_are_refined_by_candidates_that_agree():
    seen = candidates([[1.0, 1.01, 1.5]] * 2, [0.0, 0.5, 0.0])
    (near_m, hidden_m), is_seen = refine_depths(seen, np.array([1.0, 1.2]), 0.001)
    assert is_seen.tolist() == [True, False]
    weight = np.exp(-1.0)
    assert near_m == pytest.approx((1.0 + weight * 1.01) / (1 + weight)) and hidden_m == 1.2
    # As near as two sigma, or a step of the grid where that is more
    for step_m, chosen_m, is_near in ((0.001, 1.0199, True), (0.001, 1.0201, False), (0.03, 1.029, True)):
        (found_m,), _ = refine_depths(candidates([1.0], 0.0), np.array([chosen_m]), step_m)
        assert found_m == (1.0 if is_near else chosen_m)


@pytest.mark.parametrize(
    ("keypoint", "sigma_m", "farthest"), [(WRIST, 0.015, (2 / 2.2) ** 2), (FINGER, 0.008, 1)]
)
def test_candidates_lie_around_the_keypoint(keypoint, sigma_m, farthest):
    """2.2 cm at a metre are 2.2 pixels; a finger's 1.3 cm are fewer, but no less than 2 are looked at."""
    assert RADIUS_M[[WRIST, FINGER]].tolist() == [0.022, 0.013]
    found = around(keypoint, (30.0, 20.0), np.full((48, 64), 1.0))
    assert found.cost.shape == (1, 49) and found.sigma_m.tolist() == [sigma_m]
    assert found.cost.min() == 0 and found.cost.max() == pytest.approx(2 * farthest)
    np.testing.assert_allclose(found.rays, [[-0.015, -0.035, 1.0]])


def test_keypoints_lie_below_the_surface_along_the_line_of_sight():
    found = around(WRIST, (63.0, 23.5), np.full((48, 64), 1.0), below_m=0.05)
    assert np.nanmax(found.depth_m) == pytest.approx(1.0 + 0.05 / np.hypot(0.315, 1))


@pytest.mark.parametrize(("step_m", "is_steep"), [(0.029, False), (0.031, True)])
@pytest.mark.parametrize("turned", [False, True])
def test_surfaces_on_depth_steps_cost_more(step_m, is_steep, turned):
    depth_m = np.full((64, 64), 1.0)
    depth_m[:, 31:] += step_m
    depth_m = depth_m.T if turned else depth_m
    place = (20.0, 30.0) if turned else (30.0, 20.0)
    found = around(WRIST, place, depth_m[:48])
    assert (found.cost.max() > 1.7) == is_steep  # 1.65 at the corners, 1 more on the step


def test_beyond_the_image_and_in_holes_there_is_no_surface():
    depth_m = np.full((48, 64), 1.0)
    depth_m[0, 3] = np.nan
    found = around(WRIST, (0.0, 0.0), depth_m)
    assert np.isnan(found.depth_m).sum() == 49 - 16  # a quarter of the neighbourhood, its corner included
    depth_m[:] = 0
    assert np.isnan(around(WRIST, (30.0, 20.0), depth_m).depth_m).all()


@pytest.mark.parametrize("n_surfaces", [1, 4])
def test_costs_are_those_of_a_plain_loop_on_the_whole_grid(n_surfaces):
    rng, grid_m = np.random.default_rng(3), np.arange(0.9, 1.2, 0.02)
    seen_m, cost = rng.uniform(0.8, 1.3, (200, n_surfaces)), rng.uniform(0, 2, (200, n_surfaces))
    found = depth_costs(candidates(seen_m, cost), grid_m)
    for k in range(200):
        unexplained = np.where(grid_m > seen_m[k].min(), 5.0, 20.0)
        explained = ((grid_m - seen_m[k][:, None]) / 0.010) ** 2 + cost[k][:, None]
        np.testing.assert_allclose(found[k], np.minimum(unexplained, explained.min(axis=0)), atol=1e-9)


def test_one_dear_candidate_is_its_own_mean():
    assert refine_depths(candidates([1.01], 2.0), np.array([1.0]), 0.001)[0] == pytest.approx(1.01)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_depth_step_costs_one(axis):
    depth_m = np.full((48, 64), 1.0)
    flat = around(WRIST, (30.0, 30.0), depth_m).cost
    depth_m[(slice(None), slice(31, None)) if axis else slice(31, None)] += 0.05
    dearer = around(WRIST, (30.0, 30.0), depth_m).cost - flat
    assert np.unique(dearer.round(9)).tolist() == [0, 1]
    # Lines 30 and 31 of 28, 29, 29, 30, 31, 31, 32 have pixels of both depths beside them.
    is_dearer = (dearer > 0.5).reshape(7, 7)
    assert is_dearer.any(axis=1 - axis).tolist() == [False] * 3 + [True] * 3 + [False]


def test_at_the_border_the_line_next_to_it_is_sampled():
    rows_m, columns_m = np.meshgrid(1 + np.arange(48) / 1e3, 1 + np.arange(64) / 1e3, indexing="ij")
    for depth_m, n, places in (
        (rows_m, 48, ((30.0, 0.0), (30.0, 47.0))),
        (columns_m, 64, ((0.0, 20.0), (63.0, 20.0))),
    ):
        first, last = (around(WRIST, place, depth_m).depth_m for place in places)
        assert np.nanmin(first) == pytest.approx(1.001) and np.nanmax(last) == pytest.approx(
            1 + (n - 2) / 1e3
        )


def test_two_pixels_are_looked_at_around_the_finest_keypoint():
    depth_m = np.full((48, 64), 2.0)
    depth_m[18:23, 28:33] = 1.0
    assert np.unique(around(FINGER, (30.0, 20.0), depth_m).depth_m).tolist() == [1]
    depth_m[18:23, 28] = 2.0
    assert np.unique(around(FINGER, (30.0, 20.0), depth_m).depth_m).tolist() == [1, 2]
