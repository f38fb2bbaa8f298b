"""What lengths of limbs cost, and the choice between near and far ends."""

import numpy as np
import pytest

from hicp_lib.core.keypoints import INDEX
from hicp_lib.lifting.body_measures import load_measures
from hicp_lib.lifting.limb_lengths import Limbs, choose_along_limbs, limbs_outwards

STEP_M = 0.002


@pytest.mark.parametrize(
    ("begin", "end", "share", "more_m", "most_short"),
    [
        ("left_elbow", "left_wrist", 0.05, 0.010, 4.0),
        ("left_index_2", "left_index_3", 0.03, 0.003, 20.0),
        ("left_wrist", "left_hand_root", 0.03, 0.003, 20.0),  # a limb is of what it ends in
    ],
)
def test_lengths_cost_the_square_beyond_what_people_have(begin, end, share, more_m, most_short):
    found, measures = np.array([INDEX[begin], INDEX[end]]), load_measures()
    grid_m, rays = np.arange(1.0, 2.2, STEP_M), np.tile([0.0, 0.0, 1.0], (2, 1))  # one behind the other
    (limbs,) = limbs_outwards(grid_m, rays, found, measures)
    assert (limbs.begin.tolist(), limbs.end.tolist()) == ([0], [1])
    least_m, most_m = measures.closest_m[*found], measures.farthest_m[*found]
    sigma_m = share * most_m + more_m
    reach = limbs.costs.shape[2] // 2
    assert reach * STEP_M == pytest.approx(most_m + np.sqrt(40) * sigma_m, abs=STEP_M)
    length_m = STEP_M * abs(np.arange(-reach, reach + 1))
    short = np.minimum((np.maximum(least_m - length_m, 0) / sigma_m) ** 2, most_short)
    long = np.minimum((np.maximum(length_m - most_m, 0) / sigma_m) ** 2, 40)
    np.testing.assert_allclose(limbs.costs[0, len(grid_m) // 2], short + long, rtol=5e-3, atol=5e-3)


@pytest.mark.parametrize(("near_cost", "chosen"), [(39.9, 5), (40.1, 0)])
def test_an_end_out_of_reach_costs_forty(near_cost, chosen):
    costs = np.full((2, 8), 1000.0)
    costs[0, 5] = 0.0
    costs[1, [0, 5]] = 0.0, near_cost
    limb = Limbs(np.array([0]), np.array([1]), np.zeros((1, 8, 3)))
    assert choose_along_limbs(costs, [limb]).tolist() == [5, chosen]


def test_the_steps_to_an_end_are_counted_from_the_beginning():
    costs = np.full((2, 8), 100.0)
    costs[0, 4] = 0.0
    costs[1] = 0.0
    for step, place in ((-1, 3), (0, 4), (1, 5)):
        of_steps = np.where(np.arange(-1, 2) == step, 0.0, 9.0)
        limb = Limbs(np.array([0]), np.array([1]), np.tile(of_steps, (1, 8, 1)))
        assert choose_along_limbs(costs, [limb]).tolist() == [4, place]
