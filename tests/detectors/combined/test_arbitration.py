"""The rules of arbitration, each by itself."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.core.keypoints import LEFT_HAND, RIGHT_HAND
from hicp_lib.detectors.combined.arbitration import (
    ArbitrationRule,
    Hands,
    assign,
    distances,
    merge_duplicates,
    nearest_first,
    without_body,
)
from hicp_lib.detectors.combined.hand_squares import Arms

SHAPE = np.random.default_rng(0).uniform(-20, 20, (21, 2))
SHAPE[0] = 0
SIZE = np.linalg.norm(SHAPE, axis=1).max()
AS_SAID = ArbitrationRule(same_hand=0.5, alone=0, scatter=0)  # scores are the hand model's


def hands(*offsets, sides=None, scores=None) -> Hands:
    n = len(offsets)
    return Hands(
        SHAPE + np.array(offsets, float).reshape(n, 1, 2),
        np.repeat(np.array(scores or [0.9] * n, float)[:, None], 21, axis=1),
        np.array(sides or [0] * n),
    )


def test_sightings_of_one_hand_become_their_median():
    merged = merge_duplicates(hands((0, 0), (1, 0), (8, 6), scores=[0.5, 0.6, 0.9]), AS_SAID)
    assert len(merged) == 1
    np.testing.assert_allclose(merged.keypoints_px[0], SHAPE + (1, 0))
    assert merged.scores[0].tolist() == [0.6] * 21


def test_a_hand_is_as_sure_as_its_sightings_are_many_and_agree():
    seen = hands((0, 0), (0, 0), (0, 0), (0, 0))
    seen.keypoints_px[3, 7] += (0, 0.4 * SIZE)
    scores = merge_duplicates(seen, ArbitrationRule(alone=0.8, scatter=2.0)).scores[0]
    np.testing.assert_allclose(np.delete(scores, 7), 0.9 * (1 - 0.8 / 4))
    assert scores[7] == pytest.approx(0.9 * (1 - 0.8 / 4) * np.exp(-2.0 * 0.4 / 4))
    alone = merge_duplicates(seen.take(np.array([0])), ArbitrationRule(alone=0.8)).scores[0]
    np.testing.assert_allclose(alone, 0.9 * 0.2)


@pytest.mark.parametrize("share, n", [(0.49, 1), (0.51, 2)])
def test_hands_are_one_within_half_their_size(share, n):
    assert len(merge_duplicates(hands((0, 0), (share * SIZE, 0)), AS_SAID)) == n


def test_the_smaller_hand_sets_the_distance():
    two = hands((0, 0), (0.4 * SIZE, 0))
    two.keypoints_px[1] = two.keypoints_px[1, :1] + (two.keypoints_px[1] - two.keypoints_px[1, :1]) / 2
    assert len(merge_duplicates(two, AS_SAID)) == 2


def test_the_side_is_the_majoritys():
    assert merge_duplicates(hands((0, 0), (1, 0), (2, 0), sides=[1, 0, 1]), AS_SAID).sides.tolist() == [1]
    assert merge_duplicates(hands((0, 0), (1, 0), (2, 0), sides=[0, 0, 1]), AS_SAID).sides.tolist() == [0]


def test_points_some_sighting_lacks_come_from_the_first():
    two = hands((0, 0), (2, 0))
    two.keypoints_px[1, 5] = np.nan
    merged = merge_duplicates(two, AS_SAID)
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


def an_arm(wrist_px) -> Arms:
    """A left arm along x, its forearm 100 pixels long; the right one is not given."""

    def side(x):
        return np.array([[[x, 0.0], [np.nan, np.nan]]])

    return Arms(side(wrist_px), side(100.0), side(0.0), np.array([[100.0, np.nan]]))


@pytest.mark.parametrize("wrist_px, end_px, reach", [(200.0, 200.0, 1.0), (np.nan, 100.0, 1.5)])
def test_a_hand_is_refused_from_the_reach_on(wrist_px, end_px, reach):
    arm = an_arm(wrist_px)
    if np.isnan(wrist_px):
        arm = Arms(np.full((1, 2, 2), np.nan), arm.elbows_px, arm.shoulders_px, arm.scales_px)
    at = hands((end_px + 99.9 * reach, 0), (end_px + 100 * reach, 0), (end_px - 50, 0))
    away = distances(arm, at, ArbitrationRule())
    np.testing.assert_allclose(away[0, 0], [0.999 * reach, np.inf, 0.5])
    assert np.isinf(away[0, 1]).all()


def test_without_wrist_and_elbow_the_shoulder_tells():
    none = np.full((1, 2, 2), np.nan)
    arm = Arms(none, none, an_arm(200.0).shoulders_px, an_arm(200.0).scales_px)
    away = distances(arm, hands((249.9, 0), (250, 0)), ArbitrationRule())
    np.testing.assert_allclose(away[0, 0], [2.499, np.inf])


def test_the_surest_hand_chooses_its_wrist_first():
    wrists_px = np.array([[[0.0, 0], [100.0, 0]]])
    three = hands((10, 0), (20, 0), (500, 0), scores=[0.3, 0.9, 0.1])
    assert nearest_first(wrists_px, three, np.full((1, 2), -1)).tolist() == [[1, 0]]
    assert nearest_first(wrists_px, three, np.array([[2, -1]])).tolist() == [[2, 1]]


def test_nobody_has_two_left_hands():
    people = without_body(hands((0, 0), (50, 0), (90, 0), sides=[0, 0, 0], scores=[0.5, 0.9, 0.7]))
    # The surest two are left hands of two people; the least sure becomes the first one's right hand.
    np.testing.assert_allclose(people.keypoints_px[:, LEFT_HAND[0], 0], [50, 90])
    np.testing.assert_allclose(people.keypoints_px[:, RIGHT_HAND[0], 0], [0, np.nan])
    np.testing.assert_allclose(people.person_scores, [(0.9 + 0.5) / 2, 0.7])
