"""Hands as a whole: where fingers are that others hide, from the shapes a hand can take.

In the image a finger behind the hand is often found where it is, but what is seen there is the hand in
front of it. The palm is rigid and fingers bend in known ways: of many turns and sizes of the palm those are
kept that fit its keypoints in the image and what is seen there, and on each of them every finger takes the
bends that fit best. The mean of the good ones, weighted by how well they fit, is where the joints are.

The shapes are the body model's with fingers bent at random (`tools/measure_hands.py`). Rendered people have
hands of this model too, in other sizes; hands of real people differ more from it.
"""

from __future__ import annotations

import zipfile
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from hicp_lib.errors import InputError
from hicp_lib.keypoints import LEFT_HAND, RIGHT_HAND

SHAPES_FILE = Path(__file__).parents[2] / "data" / "hand_shapes.npz"
PALM = np.array([0, 5, 9, 13, 17])
"""Keypoints of a hand that do not move against each other: its root and the knuckles."""
FINGERS = (np.arange(1, 5), *(np.arange(knuckle + 1, knuckle + 4) for knuckle in PALM[1:]))
"""The keypoints of each finger that do, thumb first."""

_LEAST_OF_PALM = 4  # fewer of it found do not tell how it is turned
_SIZES, _SIZE_SIGMA = (0.88, 0.96, 1.04, 1.12), 0.1
_N_TURNS = 600  # about 25 degrees apart
_N_FITTING, _N_PLACES = 200, 40  # palms kept by their place in the image, and of these with depths
_REACH_M, _STEP_M = 0.15, 0.01  # depths tried around the palm as it is seen
_PALM_SIGMA_M, _FINGER_SIGMA_M = 0.008, 0.010  # misfit across the line of sight that costs 1
_MOST = 9.0  # of the cost of a keypoint's misfit, and of its depth
_LIKELY = 2.0  # a fit that costs so much more weighs 1/e of the best
_DEPTH_SIGMA_M, _MOST_DEPTH = 0.010, 20.0  # cost of depths other than the fit's


@cache
def load_hand_shapes(path: Path = SHAPES_FILE) -> np.ndarray:
    """Right hands, shape (n, 21, 3), metres, about the middle of the palm, palms turned alike.

    Raises
    ------
    InputError
        If the file is missing or not such a file.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            return (stored["shapes_tenth_mm"].reshape(-1, 21, 3) / 10_000).astype(np.float32)
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not shapes of hands ({error}); run tools/measure_hands.py") from None


def favour_hand_shapes(
    costs: np.ndarray, grid_m: np.ndarray, rays: np.ndarray, found: np.ndarray
) -> np.ndarray:
    """Costs (m, g) of depths, those of fingers with what depths other than the hand's shape gives cost more.

    Parameters
    ----------
    costs : array, shape (m, g), of each keypoint at each depth
    grid_m : array, shape (g,), evenly spaced
    rays : array, shape (m, 3), lines of sight, z = 1
    found : array, shape (m,), the keypoints, Halpe order, increasing
    """
    costs = costs.copy()
    for hand, is_right in ((LEFT_HAND, False), (RIGHT_HAND, True)):
        rows = np.flatnonzero(np.isin(found, hand))
        which = found[rows] - hand[0]
        if np.isin(PALM, which).sum() >= _LEAST_OF_PALM:
            mean_m, spread_m = fit_hand(costs[rows], grid_m, rays[rows], which, is_right)
            sigma_m = np.hypot(_DEPTH_SIGMA_M, spread_m)[:, None]
            costs[rows] += np.minimum(((grid_m - mean_m[:, None]) / sigma_m) ** 2, _MOST_DEPTH)
    return costs


def fit_hand(
    costs: np.ndarray, grid_m: np.ndarray, rays: np.ndarray, which: np.ndarray, is_right: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Depths of a hand's keypoints and how far the good fits disagree, (k,) each.

    Parameters
    ----------
    costs, grid_m, rays : as of `favour_hand_shapes`, for k keypoints of one hand
    which : array, shape (k,), their numbers in the hand, increasing
    """
    is_palm = np.isin(which, PALM)
    seen_m = np.median(grid_m[costs[is_palm].argmin(axis=1)])
    places_m = (rays[:, :2] * seen_m).astype(np.float32)
    costs = np.minimum(costs, _MOST).astype(np.float32)
    turns, z_m, shift_m, total = _place_palm(costs[is_palm], grid_m, places_m[is_palm], seen_m,
                                             which[is_palm], is_right)  # fmt: skip
    mean_m, square_m2 = np.empty((2, len(total), len(which)))
    palm = load_hand_shapes()[0, which[is_palm]]
    mean_m[:, is_palm] = turns[:, 2] @ palm.T + z_m[:, None]
    square_m2[:, is_palm] = mean_m[:, is_palm] ** 2
    for finger in FINGERS:
        mine = np.isin(which, finger)
        if mine.any():
            shapes = load_hand_shapes()[:, which[mine]]
            depth_m, cost = _bend(shapes, turns, z_m, shift_m, costs[mine], grid_m, places_m[mine], seen_m)
            weights = np.exp((cost.min(axis=1, keepdims=True) - cost) / _LIKELY)
            weights /= weights.sum(axis=1, keepdims=True)
            mean_m[:, mine] = np.einsum("ps,psk->pk", weights, depth_m)
            square_m2[:, mine] = np.einsum("ps,psk->pk", weights, depth_m**2)
            total = total + cost.min(axis=1)
    weights = np.exp((total.min() - total) / _LIKELY)
    weights /= weights.sum()
    depth_m = weights @ mean_m
    return depth_m, np.sqrt(np.maximum(weights @ square_m2 - depth_m**2, 0))


@cache
def _turns(is_right: bool) -> tuple[np.ndarray, np.ndarray]:
    """Turns of the palm times its size, (n, 3, 3), and what the size costs, (n,); left hands mirrored.

    Even over all turns: super-Fibonacci spirals (Alexa, "Super-Fibonacci Spirals", CVPR 2022).
    """
    share = (np.arange(_N_TURNS) + 0.5) / _N_TURNS
    a = 2 * np.pi * _N_TURNS * share / np.sqrt(2)
    b = 2 * np.pi * _N_TURNS * share / 1.533751168755204288118041
    near, far = np.sqrt(share), np.sqrt(1 - share)
    quaternions = np.column_stack([near * np.sin(a), near * np.cos(a), far * np.sin(b), far * np.cos(b)])
    turns = Rotation.from_quat(quaternions).as_matrix() * np.array([1 if is_right else -1, 1, 1])[:, None]
    sizes = np.repeat(_SIZES, _N_TURNS)
    scaled = sizes[:, None, None] * np.tile(turns, (len(_SIZES), 1, 1))
    return scaled.astype(np.float32), 0.5 * ((sizes - 1) / _SIZE_SIGMA) ** 2


def _place_palm(costs, grid_m, places_m, seen_m, which, is_right):
    """Palms that fit: turns (p, 3, 3), depths of the middle (p,), shifts across (p, 2), costs (p,)."""
    turns, total = _turns(is_right)
    points_m = load_hand_shapes()[0, which] @ np.swapaxes(turns, 1, 2)
    apart_m = places_m - _across(points_m, seen_m)
    shift_m = apart_m.mean(axis=1)
    misfit = ((apart_m - shift_m[:, None]) ** 2).sum(axis=2) / _PALM_SIGMA_M**2
    total = total + np.minimum(misfit, _MOST).sum(axis=1)
    fitting = np.argpartition(total, _N_FITTING)[:_N_FITTING]
    z_m = seen_m + np.arange(-_REACH_M, _REACH_M + _STEP_M / 2, _STEP_M)
    depth_m = points_m[fitting, None, :, 2] + z_m[:, None]
    total = total[fitting, None] + _look_up(costs, grid_m, depth_m)
    best = np.argpartition(total, _N_PLACES, axis=None)[:_N_PLACES]
    palm, place = np.unravel_index(best, total.shape)
    return turns[fitting[palm]], z_m[place], shift_m[fitting[palm]], total.ravel()[best]


def _bend(shapes, turns, z_m, shift_m, costs, grid_m, places_m, seen_m):
    """Depths (p, s, k) of a finger in s shapes on each of p palms, and what each shape costs, (p, s)."""
    points_m = shapes @ np.swapaxes(turns, 1, 2)[:, None]
    apart_m = places_m - _across(points_m, seen_m) - shift_m[:, None, None]
    misfit = (apart_m**2).sum(axis=3) / _FINGER_SIGMA_M**2
    depth_m = points_m[..., 2] + z_m[:, None, None].astype(np.float32)
    return depth_m, np.minimum(misfit, _MOST).sum(axis=2) + _look_up(costs, grid_m, depth_m)


def _across(points_m: np.ndarray, seen_m: float) -> np.ndarray:
    """Where points about the palm's middle are seen, (..., 2), measured at the palm's depth."""
    return points_m[..., :2] / (1 + points_m[..., 2:] / np.float32(seen_m))


def _look_up(costs: np.ndarray, grid_m: np.ndarray, depth_m: np.ndarray) -> np.ndarray:
    """Costs of k keypoints at depths (..., k) of the grid, summed over them."""
    index = np.rint((depth_m - grid_m[0]) / (grid_m[1] - grid_m[0])).astype(np.intp)
    index = np.clip(index, 0, len(grid_m) - 1) + np.arange(len(costs)) * len(grid_m)
    return costs.ravel().take(index).sum(axis=-1)
