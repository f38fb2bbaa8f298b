"""What lengths of limbs cost, and the choice between near and far ends."""

import itertools

import numpy as np
import pytest

from hicp_lib.core.keypoints import INDEX
from hicp_lib.lifting.body_measures import load_measures
from hicp_lib.lifting.limb_lengths import Limbs, choose_along_limbs, limbs_outwards, out_of_reach

STEP_M = 0.002


def limbs_of(begin: list[int], end: list[int], costs: np.ndarray, reach: int) -> Limbs:
    """From costs (n, g, g) by the depths of both ends."""
    n, g, _ = costs.shape
    by_step = np.full((2 * reach + 1, n, g), np.inf, np.float32)
    for step, depth in itertools.product(range(-reach, reach + 1), range(g)):
        if 0 <= depth + step < g:
            by_step[step + reach, :, depth] = costs[:, depth, depth + step]
    return Limbs(np.array(begin), np.array(end), by_step, np.full(n, np.inf))


@pytest.mark.parametrize(
    ("begin", "end", "share", "more_m", "most_short"),
    [
        ("left_elbow", "left_wrist", 0.02, 0.005, 4.0),
        ("left_index_2", "left_index_3", 0.03, 0.006, 20.0),
        ("left_wrist", "left_hand_root", 0.03, 0.006, 20.0),  # a limb is of what it ends in
    ],
)
def test_lengths_cost_the_square_beyond_what_people_have(begin, end, share, more_m, most_short):
    found, measures = np.array([INDEX[begin], INDEX[end]]), load_measures()
    grid_m, rays = np.arange(1.0, 2.2, STEP_M), np.tile([0.0, 0.0, 1.0], (2, 1))  # one behind the other
    (limbs,) = limbs_outwards(grid_m, rays, found, measures)
    assert (limbs.begin.tolist(), limbs.end.tolist()) == ([0], [1])
    least_m, most_m = measures.closest_m[*found], measures.farthest_m[*found]
    sigma_m = share * most_m + more_m
    middle = len(grid_m) // 2
    length_m = abs(grid_m - grid_m[middle])
    short = np.minimum((np.maximum(least_m - length_m, 0) / sigma_m) ** 2, most_short)
    long = np.minimum((np.maximum(length_m - most_m, 0) / sigma_m) ** 2, 40.0)
    reach = len(limbs.costs) // 2
    near = slice(middle - reach, middle + reach + 1)
    np.testing.assert_allclose(limbs.costs[:, 0, middle], (short + long)[near], rtol=5e-3, atol=5e-3)
    np.testing.assert_allclose(limbs.costs_by_end[:, 0, middle], (short + long)[near], rtol=0.02, atol=0.02)
    assert limbs.farthest_m == pytest.approx(most_m + np.sqrt(40) * sigma_m)
    assert reach * STEP_M == pytest.approx(limbs.farthest_m, abs=STEP_M)


@pytest.mark.parametrize(("near_cost", "chosen"), [(39.9, 5), (40.1, 0)])
def test_an_end_out_of_reach_costs_forty(near_cost, chosen):
    costs = np.full((2, 8), 1000.0)
    costs[0, 5] = 0.0
    costs[1, [0, 5]] = 0.0, near_cost
    limb = limbs_of([0], [1], np.minimum(100.0 * abs(np.arange(8) - np.c_[:8]), 40.0)[None], 1)
    assert choose_along_limbs(costs, [limb])[0].tolist() == [5, chosen]


@pytest.mark.parametrize("more_m", [-1e-6, 1e-6])
def test_an_end_is_out_of_reach_where_its_limb_would_cost_forty(more_m):
    found = np.array([INDEX["left_elbow"], INDEX["left_wrist"]])
    rays = np.array([[0.0, 0.0, 1.0], [0.1, 0.0, 1.0]])
    limbs = limbs_outwards(np.arange(1.0, 2.0, 0.02), rays, found, load_measures())
    points_m = np.array([[0.0, 0.0, 1.0], [0.0, limbs[0].farthest_m[0] + more_m, 1.0]])
    assert out_of_reach(points_m, limbs).tolist() == [False, more_m > 0]


def test_costs_go_by_the_depth_of_the_beginning_and_then_of_the_end():
    costs = np.full((2, 8), 100.0)
    costs[0, 4] = 0.0
    costs[1] = 0.0
    for end in (3, 4, 5):
        of_depths = np.full((1, 8, 8), 9.0)
        of_depths[0, 4, end] = 0.0
        limb = limbs_of([0], [1], of_depths, 7)
        assert choose_along_limbs(costs, [limb])[0].tolist() == [4, end]


def test_a_limb_may_reach_from_one_end_of_the_grid_to_the_other():
    found, rays = np.array([INDEX["left_elbow"], INDEX["left_wrist"]]), np.tile([0.0, 0.0, 1.0], (2, 1))
    (limbs,) = limbs_outwards(np.array([1.0, 1.1, 1.2]), rays, found, load_measures())
    costs = np.array([[0.0, 1e3, 1e3], [1e3, 1e3, 0.0]])
    assert choose_along_limbs(costs, [limbs])[0].tolist() == [0, 2]


def test_a_chain_is_chosen_outwards():
    """A chain of three; each end lies one step nearer than its beginning."""
    one_nearer = np.where(np.arange(9) == np.c_[:9] - 1, 0.0, 30.0)[None]
    limbs = [limbs_of([k], [k + 1], one_nearer, 8) for k in range(2)]
    costs = np.zeros((3, 9))
    costs[0] = 100.0
    costs[0, 8] = 0.0
    assert choose_along_limbs(costs, limbs)[0].tolist() == [8, 7, 6]


def test_an_end_out_of_reach_is_rather_at_the_edge_of_it():
    costs = np.zeros((2, 9))
    costs[0] = 1000.0
    costs[0, 5] = 0.0
    too_long = np.full((1, 9, 9), 40.0)
    limb = limbs_of([0], [1], too_long, 3)
    assert choose_along_limbs(costs, [limb])[0].tolist() == [5, 2]


def test_other_depths_cost_what_the_best_choice_with_them_does():
    """A shoulder with two arms, against all choices of depths."""
    rng, g = np.random.default_rng(0), 6
    costs = rng.uniform(0, 50, (5, g))
    between = [rng.uniform(0, 40, (2, g, g)) for _ in range(2)]
    ends = ([0, 0], [1, 3]), ([1, 3], [2, 4])
    limbs = [limbs_of(*of, costs, g - 1) for of, costs in zip(ends, between, strict=True)]
    least = np.full((5, g), np.inf)
    for depths in itertools.product(range(g), repeat=5):
        total = costs[range(5), depths].sum()
        for some, of_limbs in zip(limbs, between, strict=True):
            for begin, end, of_depths in zip(some.begin, some.end, of_limbs, strict=True):
                total += of_depths[depths[begin], depths[end]]
        least[range(5), depths] = np.minimum(least[range(5), depths], total)
    chosen, in_all = choose_along_limbs(costs, limbs)
    np.testing.assert_allclose(in_all, least, rtol=1e-5)
    assert chosen.tolist() == least.argmin(axis=1).tolist()
