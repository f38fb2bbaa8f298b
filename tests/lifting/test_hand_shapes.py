"""Hands as a whole against hands of known shape and place."""

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import LEFT_HAND, RIGHT_HAND
from hicp_lib.lifting.hand_shapes import (
    FINGERS,
    PALM,
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
