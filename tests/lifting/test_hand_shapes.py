"""Hands as a whole against hands of known shape and place."""

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import LEFT_HAND, RIGHT_HAND
from hicp_lib.lifting.hand_shapes import (
    FINGERS,
    PALM,
    _bend,
    _place_palm,
    _SeenHand,
    _turns,
    fit_hand,
    hidden_by_limbs,
    load_hand_shapes,
    with_hand_shapes,
)

GRID_M = np.arange(0.6, 1.4, 0.02)
MIDDLE_M = np.array([0.05, 0.1, 1.0])


def seen_from_the_thumb(is_right: bool) -> np.ndarray:
    """A hand in the camera frame, (21, 3), its little finger furthest from the camera."""
    hand_m = load_hand_shapes()[3].astype(float)
    across = hand_m[17] - hand_m[5]
    along = hand_m[9] - hand_m[0]
    z = across / np.linalg.norm(across)
    y = along - z * (along @ z)
    y /= np.linalg.norm(y)
    axes = np.array([np.cross(y, z), y, z])
    return hand_m @ axes.T * [1 if is_right else -1, 1, 1] + MIDDLE_M


def costs_of(seen_m: np.ndarray) -> np.ndarray:
    """Costs as `near_surfaces` has them: at what is seen none, behind it 6, in front of it 20."""
    apart = ((GRID_M - seen_m[:, None]) / 0.01) ** 2
    return np.minimum(apart, np.where(GRID_M > seen_m[:, None], 6.0, 20.0))


@pytest.mark.parametrize("is_right", [True, False])
def test_fingers_hidden_by_others_are_put_behind_them(is_right):
    points_m = seen_from_the_thumb(is_right)
    rays = points_m / points_m[:, 2:]
    seen_m = points_m[:, 2].copy()
    hidden = np.concatenate([[13, 17], *FINGERS[3:]])  # ring and little finger behind index and middle
    seen_m[hidden] = points_m[5, 2]
    depth_m, spread_m = fit_hand(costs_of(seen_m), GRID_M, rays, np.arange(21), is_right)
    before, after = (abs(z - points_m[:, 2])[hidden] for z in (seen_m, depth_m))
    assert after.mean() < 0.5 * before.mean()
    assert abs(depth_m - points_m[:, 2])[PALM[:3]].max() < 0.02
    assert (spread_m >= 0).all() and spread_m.max() < 0.1


def test_costs_change_only_for_hands_with_enough_of_the_palm():
    points_m = seen_from_the_thumb(False)
    few = np.array([0, 5, 9, 10])
    found = np.concatenate([[9], LEFT_HAND, RIGHT_HAND[few]])
    places_m = np.concatenate([points_m[:1], points_m, points_m[few]])
    costs = costs_of(places_m[:, 2])
    with_hands = with_hand_shapes(costs, GRID_M, places_m / places_m[:, 2:], found)
    changed = (with_hands != costs).any(axis=1)
    assert changed[1:22].any() and not changed[[0, *range(22, 26)]].any()
    assert (with_hands >= costs).all()


def test_only_what_the_hand_itself_hides_is_drawn_to_its_shape():
    points_m = seen_from_the_thumb(True)
    hidden = hidden_by_limbs(points_m[:, :2] / points_m[:, 2:], points_m[:, 2], np.arange(21))
    assert hidden[17] and not hidden[[5, 6]].any()  # the little finger's knuckle, the index finger
    turned_m = points_m * [1, 1, -1] + [0, 0, 2]
    assert not hidden_by_limbs(turned_m[:, :2], turned_m[:, 2], np.arange(21))[17]
    assert not hidden_by_limbs(points_m[:1, :2], points_m[:1, 2], np.array([0])).any()


def test_shapes_bend_at_the_fingers_and_not_in_the_palm():
    shapes_m = load_hand_shapes()
    assert abs(shapes_m[:, PALM] - shapes_m[0, PALM]).max() < 1e-3
    assert all(np.ptp(shapes_m[:, finger[-1]], axis=0).max() > 0.03 for finger in FINGERS)
    assert sorted(np.concatenate([PALM, *FINGERS])) == list(range(21))


def test_another_file_is_named(tmp_path):
    path = tmp_path / "shapes.npz"
    np.savez(path, other=np.zeros(3))
    with pytest.raises(InputError, match="shapes.npz: not shapes of hands"):
        load_hand_shapes(path)


@pytest.mark.parametrize(
    ("beside_m", "behind_m", "is_hidden"),
    [(0.0149, 0.0101, True), (0.0151, 0.0101, False), (0.0149, 0.0099, False)],
)
def test_a_keypoint_is_hidden_close_behind_a_limb(beside_m, behind_m, is_hidden):
    """Behind the middle of the index finger's first limb, which runs along x at a metre."""
    places_m = np.array([[0.0, 0.0, 1.0], [0.04, 0.0, 1.0], [0.02, beside_m, 1.0 + behind_m]])
    slopes = places_m[:, :2]  # as measured at the median depth
    hidden = hidden_by_limbs(slopes, places_m[:, 2], np.array([5, 6, 20]))
    assert hidden.tolist() == [False, False, is_hidden]


def test_what_is_hidden_costs_by_how_far_it_is_from_the_hands_shape():
    points_m = seen_from_the_thumb(True)
    rays, costs = points_m / points_m[:, 2:], costs_of(points_m[:, 2])
    mean_m, spread_m = fit_hand(costs, GRID_M, rays, np.arange(21), True)
    hidden = hidden_by_limbs(rays[:, :2], mean_m, np.arange(21))
    more = with_hand_shapes(costs, GRID_M, rays, RIGHT_HAND) - costs
    square = (GRID_M - mean_m[:, None]) ** 2 / (0.006**2 + spread_m[:, None] ** 2)
    np.testing.assert_allclose(more[hidden], np.minimum(square, 20)[hidden], atol=1e-9)
    assert hidden.any() and not more[~hidden].any()


@pytest.mark.parametrize("is_right", [True, False])
def test_palms_are_tried_in_four_sizes_and_all_turns(is_right):
    turns, prior, points_m = _turns(is_right)
    determinants = np.linalg.det(turns.astype(float))
    assert (np.sign(determinants) == (1 if is_right else -1)).all()
    sizes = abs(determinants) ** (1 / 3)
    np.testing.assert_allclose(sizes.reshape(4, 600), np.tile([[0.88], [0.96], [1.04], [1.12]], 600), 1e-5)
    np.testing.assert_allclose(prior.reshape(4, 600)[:, 0], [0.72, 0.08, 0.08, 0.72], rtol=1e-5)
    np.testing.assert_allclose(points_m[:, :, 7].T, load_hand_shapes()[0, PALM] @ turns[7].T, atol=1e-6)
    rotations = turns[:600].astype(float) / 0.88
    angles_deg = np.rad2deg(np.arccos((np.einsum("aij,bij->ab", rotations, rotations) - 1).clip(-2, 2) / 2))
    nearest_deg = np.sort(angles_deg, axis=1)[:, 1]
    assert 18 < nearest_deg.min() and nearest_deg.max() < 32  # about 25 everywhere: evenly spread


def seen_hand(which: np.ndarray) -> _SeenHand:
    """Keypoints of a right hand where they appear, at depths that cost nothing."""
    points_m = seen_from_the_thumb(True)[which]
    costs = np.zeros((len(which), len(GRID_M)))
    known = 1.0, (points_m[:, :2] / points_m[:, 2:]).T, GRID_M - 1.0, costs
    return _SeenHand(which, *(np.float32(array) for array in known))


def misfits_m2(places_m: np.ndarray, points_m: np.ndarray) -> np.ndarray:
    """Of points (..., 3) about a middle a metre away, once the mean shift is taken off."""
    apart_m = places_m.T - points_m[..., :2] / (1 + points_m[..., 2:])
    return ((apart_m - apart_m[..., :5, :].mean(axis=-2, keepdims=True)) ** 2).sum(axis=-1)


def test_palms_cost_their_size_and_their_misfit():
    seen = seen_hand(PALM)
    cost, behind_m, turns, _, places, z_m = _place_palm(seen, True)
    turns = turns[places]
    assert len(cost) == 40
    assert np.unique(z_m.round(4)) == pytest.approx(np.arange(-15, 16) / 100)  # all as good
    points_m = np.einsum("kj,pij->pki", load_hand_shapes()[0, PALM], turns)
    sizes = np.linalg.det(turns.astype(float)) ** (1 / 3)
    misfit = np.minimum(misfits_m2(seen.places_m, points_m) / 0.012**2, 9).sum(axis=1)
    np.testing.assert_allclose(cost, 0.5 * ((sizes - 1) / 0.1) ** 2 + misfit, rtol=2e-3, atol=1e-3)
    np.testing.assert_allclose(behind_m, points_m[..., 2].T + z_m, atol=1e-6)


def test_fingers_cost_their_best_shapes_and_lie_in_the_mean_of_the_likely_ones():
    _, _, *palms = _place_palm(seen_hand(PALM), True)
    turns, shift_m, places, z_m = palms
    turns, shift_m = turns[places], shift_m[:, places]
    index_finger, seen = FINGERS[1], seen_hand(FINGERS[1])
    cost, mean_m, square_m2 = _bend(seen, *palms)
    shapes_m = np.einsum("skj,ij->ski", load_hand_shapes()[:, index_finger], turns[0])
    apart_m = seen.places_m.T - shapes_m[..., :2] / (1 + shapes_m[..., 2:]) - shift_m[:, 0]
    of_shape = np.minimum((apart_m**2).sum(axis=2) / 0.010**2, 9).sum(axis=1)
    assert cost[0] == pytest.approx(of_shape.min(), rel=1e-3, abs=1e-3)
    weights = np.exp(-(of_shape - of_shape.min()) / 2)
    depths_m = shapes_m[..., 2] + z_m[0]
    np.testing.assert_allclose(mean_m[:, 0], weights @ depths_m / weights.sum(), atol=1e-4)
    np.testing.assert_allclose(square_m2[:, 0], weights @ depths_m**2 / weights.sum(), atol=1e-5)


def test_every_finger_bends_by_itself():
    _, _, *palms = _place_palm(seen_hand(PALM), True)
    alone = [_bend(seen_hand(finger), *palms) for finger in FINGERS]
    together = _bend(seen_hand(np.concatenate(FINGERS)), *palms)
    np.testing.assert_allclose(together[0], sum(cost for cost, _, _ in alone), rtol=1e-4)
    np.testing.assert_allclose(together[1], np.concatenate([mean_m for _, mean_m, _ in alone]), atol=1e-6)


@pytest.mark.parametrize(("n_of_palm", "tells"), [(3, False), (4, True)])
def test_four_keypoints_of_the_palm_tell_how_it_is_turned(n_of_palm, tells):
    which = np.sort(np.concatenate([PALM[-n_of_palm:], np.concatenate(FINGERS)]))
    points_m = seen_from_the_thumb(True)[which]
    costs = costs_of(points_m[:, 2])
    more = with_hand_shapes(costs, GRID_M, points_m / points_m[:, 2:], RIGHT_HAND[which]) - costs
    assert more.any() == tells


@pytest.mark.parametrize(
    ("along_m", "is_hidden"), [(-0.016, False), (-0.014, True), (0.054, True), (0.056, False)]
)
def test_a_limb_hides_no_further_than_its_ends_and_their_surroundings(along_m, is_hidden):
    places_m = np.array([[0.0, 0.0, 1.0], [0.04, 0.0, 1.0], [along_m, 0.0, 1.02]])
    assert hidden_by_limbs(places_m[:, :2], places_m[:, 2], np.array([5, 6, 20]))[2] == is_hidden
