"""The rules of arbitration, each by itself."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.detectors.combined.arbitration import Hands, assign, merge_duplicates

SHAPE = np.random.default_rng(0).uniform(-20, 20, (21, 2))
SHAPE[0] = 0
SIZE = np.linalg.norm(SHAPE, axis=1).max()


def hands(*offsets, sides=None, scores=None) -> Hands:
    n = len(offsets)
    return Hands(
        SHAPE + np.array(offsets, float).reshape(n, 1, 2),
        np.repeat(np.array(scores or [0.9] * n, float)[:, None], 21, axis=1),
        np.array(sides or [0] * n),
    )


def test_sightings_of_one_hand_become_their_median():
    merged = merge_duplicates(hands((0, 0), (1, 0), (8, 6), scores=[0.5, 0.6, 0.9]), 0.5)
    assert len(merged) == 1
    np.testing.assert_allclose(merged.keypoints_px[0], SHAPE + (1, 0))
    assert merged.scores[0].tolist() == [0.6] * 21


@pytest.mark.parametrize("share, n", [(0.49, 1), (0.51, 2)])
def test_hands_are_one_within_half_their_size(share, n):
    assert len(merge_duplicates(hands((0, 0), (share * SIZE, 0)), 0.5)) == n


def test_the_smaller_hand_sets_the_distance():
    two = hands((0, 0), (0.4 * SIZE, 0))
    two.keypoints_px[1] = two.keypoints_px[1, :1] + (two.keypoints_px[1] - two.keypoints_px[1, :1]) / 2
    assert len(merge_duplicates(two, 0.5)) == 2


def test_the_side_is_the_majoritys():
    assert merge_duplicates(hands((0, 0), (1, 0), (2, 0), sides=[1, 0, 1]), 0.5).sides.tolist() == [1]
    assert merge_duplicates(hands((0, 0), (1, 0), (2, 0), sides=[0, 0, 1]), 0.5).sides.tolist() == [0]


def test_points_some_sighting_lacks_come_from_the_first():
    two = hands((0, 0), (2, 0))
    two.keypoints_px[1, 5] = np.nan
    merged = merge_duplicates(two, 0.5)
    np.testing.assert_allclose(merged.keypoints_px[0, 5], SHAPE[5])
    np.testing.assert_allclose(merged.keypoints_px[0, 6], SHAPE[6] + (1, 0))


def test_the_sum_of_distances_decides_not_the_nearest_first():
    away = np.array([[[1.0, 2.0], [1.1, np.inf]]])
    assert assign(away).tolist() == [[1, 0]]


@given(st.integers(0, 3), st.integers(0, 5), st.integers(0, 1000))
@settings(deadline=None)
def test_no_arm_takes_a_hand_it_refuses_and_no_hand_goes_to_two(n_bodies, n_hands, seed):
    rng = np.random.default_rng(seed)
    away = np.where(rng.random((n_bodies, 2, n_hands)) < 0.5, rng.random((n_bodies, 2, n_hands)), np.inf)
    chosen = assign(away)
    taken = chosen[chosen >= 0]
    assert len(set(taken.tolist())) == len(taken)
    for body, side in np.argwhere(chosen >= 0):
        assert np.isfinite(away[body, side, chosen[body, side]])
    # What is left has no arm that would take it and is free.
    rest = np.setdiff1d(np.arange(n_hands), taken)
    assert not np.isfinite(away[chosen < 0][:, rest]).any()
