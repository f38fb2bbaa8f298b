"""Depths of occluded fingers, from the shapes that a hand can take.

A finger behind the hand is often detected at the correct pixel, but the depth there is that of the hand in
front of it. The palm is rigid, and fingers bend in known ways. Of many rotations and sizes of the palm, those
are kept that fit its keypoints in the image and the depth there; for each of them, every finger takes the
bends that fit best. The weighted mean of the good fits gives the joints' depths. It is used for joints that
have another part of the hand in front of them; the others stay where they are seen.

The shapes are those of the body model, with randomly bent fingers (`tools/measure_hands.py`). Rendered people
have hands of this model too, in other sizes; hands of real people differ more from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR, read_arrays
from hicp_lib.core.keypoints import HAND_LIMBS, LEFT_HAND, RIGHT_HAND
from hicp_lib.core.memo import memoised
from hicp_lib.core.rotations import matrices_from_quaternions

SHAPES_FILE = DATA_DIR / "hand_shapes.npz"
PALM = np.array([0, 5, 9, 13, 17])
"""Keypoints of a hand that are rigidly connected: its root and the knuckles."""
FINGERS = (np.arange(1, 5), *(np.arange(knuckle + 1, knuckle + 4) for knuckle in PALM[1:]))
"""The moving keypoints of each finger, thumb first."""
_FINGER_OF = np.where(np.isin(np.arange(21), PALM), -1, (np.arange(21) - 1) // 4)

_LEAST_OF_PALM = 4  # fewer points do not determine its orientation
_SIZES, _SIZE_SIGMA = (0.88, 0.96, 1.04, 1.12), 0.1
_N_TURNS = 600  # about 25 degrees apart
_N_FITTING, _N_PLACES = 200, 40  # palms kept by their image positions, and of these with depths
_REACH_M, _STEP_M = 0.15, 0.01  # depths tried around the apparent palm
_PALM_SIGMA_M, _FINGER_SIGMA_M = 0.012, 0.010  # misfit across the line of sight that costs 1
_MOST = 9.0  # maximum cost of a keypoint's misfit, and of its depth
_LIKELY = 2.0  # a fit with a cost higher by this has 1/e of the best one's weight
_DEPTH_SIGMA_M, _MOST_DEPTH = 0.006, 20.0  # cost of depths other than the fit's, for hidden keypoints
_BESIDE_M, _BEHIND_M = 0.015, 0.010  # a keypoint this near a limb, and this far behind, is hidden


@memoised()
def load_hand_shapes(path: Path = SHAPES_FILE) -> np.ndarray:
    """Right hands centred at the palm, with equally oriented palms.

    Parameters
    ----------
    path : Path, optional

    Returns
    -------
    array, shape (n, 21, 3), dtype float32
        Metres.

    Raises
    ------
    InputError
        If the file is missing or not such a file.

    Examples
    --------
    >>> load_hand_shapes().shape[1:]
    (21, 3)
    """
    shapes = {"shapes_tenth_mm": (-1, 21, 3)}
    (tenth_mm,) = read_arrays(path, shapes, "shapes of hands", "tools/measure_hands.py")
    return (tenth_mm / 10_000).astype(np.float32)


def with_hand_shapes(
    costs: np.ndarray, grid_m: np.ndarray, rays: np.ndarray, found: np.ndarray
) -> np.ndarray:
    """Costs of depths, raised for hidden keypoints of a hand at depths that disagree with its shape.

    Parameters
    ----------
    costs : array, shape (m, g)
        Of each keypoint at each depth.
    grid_m : array, shape (g,)
        Depths, evenly spaced.
    rays : array, shape (m, 3)
        Lines of sight, z = 1.
    found : array of int, shape (m,)
        The keypoints, Halpe order, increasing.

    Returns
    -------
    array, shape (m, g)
    """
    costs = costs.copy()
    for hand, is_right in ((LEFT_HAND, False), (RIGHT_HAND, True)):
        rows = np.flatnonzero((found >= hand[0]) & (found <= hand[-1]))
        which = found[rows] - hand[0]
        if np.count_nonzero(_FINGER_OF[which] < 0) >= _LEAST_OF_PALM:
            mean_m, spread_m = fit_hand(costs[rows], grid_m, rays[rows], which, is_right)
            apart = (grid_m - mean_m[:, None]) / np.hypot(_DEPTH_SIGMA_M, spread_m)[:, None]
            is_hidden = hidden_by_limbs(rays[rows, :2], mean_m, which)
            costs[rows[is_hidden]] += np.minimum(apart[is_hidden] ** 2, _MOST_DEPTH)
    return costs


def fit_hand(
    costs: np.ndarray, grid_m: np.ndarray, rays: np.ndarray, which: np.ndarray, is_right: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Depths of a hand's keypoints, and the spread of the good fits.

    Parameters
    ----------
    costs : array, shape (k, g)
    grid_m : array, shape (g,)
    rays : array, shape (k, 3)
        These three as of `with_hand_shapes`, for k keypoints of one hand.
    which : array of int, shape (k,)
        Their numbers in the hand, increasing.
    is_right : bool
        Whether it is the right hand.

    Returns
    -------
    depth_m, spread_m : array, shape (k,)
        Mean of the good fits, and standard deviation among them.
    """
    is_palm = _FINGER_OF[which] < 0
    middle_m = median(grid_m[costs[is_palm].argmin(axis=1)].tolist())
    places_m, costs = rays[:, :2].T * middle_m, np.minimum(costs, _MOST)
    known = (array.astype(np.float32) for array in (places_m, grid_m - middle_m, costs))
    seen = _SeenHand(which, middle_m, *known)
    total, palms_m, *palms = _place_palm(seen.take(is_palm), is_right)
    mean_m, square_m2 = np.empty((2, len(which), len(total)))
    mean_m[is_palm], square_m2[is_palm] = palms_m, palms_m**2
    if not is_palm.all():
        cost, mean_m[~is_palm], square_m2[~is_palm] = _bend(seen.take(~is_palm), *palms)
        total = total + cost
    weights = np.exp((total.min() - total) / _LIKELY)
    weights /= weights.sum()
    behind_m = mean_m @ weights
    return middle_m + behind_m, np.sqrt(np.maximum(square_m2 @ weights - behind_m**2, 0))


def hidden_by_limbs(slopes: np.ndarray, depth_m: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Which keypoints of a hand lie behind one of its limbs that they do not belong to.

    Parameters
    ----------
    slopes : array, shape (k, 2)
        x / z and y / z.
    depth_m : array, shape (k,)
    which : array of int, shape (k,)
        Their numbers in the hand.

    Returns
    -------
    array of bool, shape (k,)
    """
    row = np.full(21, -1)
    row[which] = np.arange(len(which))
    limbs = row[np.array(HAND_LIMBS)]
    begin, end = limbs[(limbs >= 0).all(axis=1)].T
    places_m = slopes * median(depth_m.tolist())
    along_m = places_m[end] - places_m[begin]
    from_begin_m = places_m[:, None] - places_m[begin]
    share = np.clip((from_begin_m * along_m).sum(axis=2) / np.maximum((along_m**2).sum(axis=1), 1e-12), 0, 1)
    beside_m = np.linalg.norm(from_begin_m - share[..., None] * along_m, axis=2)
    behind_m = depth_m[:, None] - depth_m[begin] - share * (depth_m[end] - depth_m[begin])
    is_end = (np.arange(len(which))[:, None] == begin) | (np.arange(len(which))[:, None] == end)
    return ((beside_m < _BESIDE_M) & (behind_m > _BEHIND_M) & ~is_end).any(axis=1)


@dataclass(frozen=True)
class _SeenHand:
    """Observations of k keypoints of a hand, float32.

    Attributes
    ----------
    which : array of int, shape (k,)
        Their numbers in the hand.
    middle_m : float
        Apparent distance of the palm's centre.
    places_m : array, shape (2, k)
        Their positions across the line of sight, at that depth.
    grid_m : array, shape (g,)
        Depths behind it.
    costs : array, shape (k, g)
        The costs of these depths.
    """

    which: np.ndarray
    middle_m: float
    places_m: np.ndarray
    grid_m: np.ndarray
    costs: np.ndarray

    def take(self, some: np.ndarray) -> _SeenHand:
        return replace(self, which=self.which[some], places_m=self.places_m[:, some], costs=self.costs[some])

    def apart_m(self, points_m: np.ndarray, targets_m: np.ndarray) -> np.ndarray:
        """Offsets (2, ...) of projected points (3, ...) from their targets (2, ...)."""
        apart_m = points_m[:2] * (self.middle_m / (points_m[2] + self.middle_m))
        return np.subtract(targets_m, apart_m, out=apart_m)

    def look_up(self, behind_m: np.ndarray) -> np.ndarray:
        """Costs of depths (k, ..., ...) behind the centre."""
        per_m, last = 1 / (self.grid_m[1] - self.grid_m[0]), len(self.grid_m) - 1
        place = behind_m - self.grid_m[0]  # in place from here on, as memory access dominates the time
        place *= per_m
        np.clip(np.rint(place, out=place), 0, last, out=place)
        place += np.arange(len(self.costs), dtype=np.float32)[:, None, None] * (last + 1)
        return self.costs.take(place.astype(np.intp))


@memoised()
def _turns(is_right: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rotations of the palm times its size, the cost of the size, and the resulting keypoints.

    Shapes (n, 3, 3), (n,) and (3, 5, n); left hands are mirrored. Evenly distributed over all rotations:
    super-Fibonacci spirals (Alexa, "Super-Fibonacci Spirals", CVPR 2022).
    """
    share = (np.arange(_N_TURNS) + 0.5) / _N_TURNS
    a = 2 * np.pi * _N_TURNS * share / np.sqrt(2)
    b = 2 * np.pi * _N_TURNS * share / 1.533751168755204288118041
    near, far = np.sqrt(share), np.sqrt(1 - share)
    quaternions = np.column_stack([near * np.sin(a), near * np.cos(a), far * np.sin(b), far * np.cos(b)])
    turns = matrices_from_quaternions(quaternions) * np.array([1 if is_right else -1, 1, 1])[:, None]
    sizes = np.repeat(_SIZES, _N_TURNS)
    scaled = (sizes[:, None, None] * np.tile(turns, (len(_SIZES), 1, 1))).astype(np.float32)
    palms_m = _turned(load_hand_shapes()[0, PALM], scaled)
    return scaled, (0.5 * ((sizes - 1) / _SIZE_SIGMA) ** 2).astype(np.float32), palms_m


def _place_palm(seen: _SeenHand, is_right: bool) -> tuple[np.ndarray, ...]:
    """The palms that fit: their costs, (p,), and the depths of their keypoints (as in `_bend`), (k, p).

    Then what `_bend` takes: of the q different ones their rotations times the size, (q, 3, 3), and the
    offsets of their centres from the apparent centre across the line of sight, (2, q); and of all palms which
    of these each is, (p,), and its centre's offset in depth, (p,).
    """
    turns, total, points_m = _turns(is_right)
    points_m = points_m.take(np.searchsorted(PALM, seen.which), axis=1)
    apart_m = seen.apart_m(points_m, seen.places_m[:, :, None])
    shift_m = apart_m.mean(axis=1)
    apart_m -= shift_m[:, None]
    total = total + _misfits(apart_m, _PALM_SIGMA_M).sum(axis=0)
    fitting = np.argpartition(total, _N_FITTING)[:_N_FITTING]
    z_m = np.arange(-_REACH_M, _REACH_M + _STEP_M / 2, _STEP_M, dtype=np.float32)
    behind_m = points_m[2].take(fitting, axis=1)[:, None] + z_m[:, None]
    total = total[fitting] + seen.look_up(behind_m).sum(axis=0)
    best = np.argpartition(total, _N_PLACES, axis=None)[:_N_PLACES]
    place, palm = np.unravel_index(best, total.shape)
    z_m, palm = z_m[place], fitting[palm]
    some = np.flatnonzero(np.bincount(palm))
    behind_m = points_m[2][:, palm] + z_m
    return total.ravel()[best], behind_m, turns[some], shift_m[:, some], np.searchsorted(some, palm), z_m


def _bend(
    seen: _SeenHand, turns: np.ndarray, shift_m: np.ndarray, places: np.ndarray, z_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fingers on each palm, as of `_place_palm`: their costs in the best shapes, (p,), and depths, (k, p).

    Depths are relative to the apparent centre: the weighted mean over shapes, and the mean of the square.
    """
    shapes_m = load_hand_shapes()[:, seen.which].T
    turned_m = turns.swapaxes(0, 1).reshape(-1, 3) @ shapes_m.reshape(3, -1)
    turned_m = turned_m.reshape(3, -1, *shapes_m.shape[1:]).swapaxes(1, 2)  # (3, k, q, shapes)
    targets_m = seen.places_m[..., None] - shift_m[:, None]
    misfits = _misfits(seen.apart_m(turned_m, targets_m[..., None]), _FINGER_SIGMA_M)
    behind_m = turned_m[2].take(places, axis=1) + z_m[:, None]
    finger = _FINGER_OF[seen.which]
    belongs = (finger == np.arange(len(FINGERS))[:, None]).astype(np.float32)
    of_palms, of_depths = (
        (belongs @ costs.reshape(len(finger), -1)).reshape(len(FINGERS), -1, costs.shape[2])
        for costs in (misfits, seen.look_up(behind_m))
    )
    costs = of_palms.take(places, axis=1) + of_depths
    least = costs.min(axis=2, keepdims=True)
    weights = np.exp((least - costs) / _LIKELY)
    weights /= weights.sum(axis=2, keepdims=True)
    weights = weights[finger]
    mean_m, square_m2 = (np.einsum("kps,kps->kp", weights, values) for values in (behind_m, behind_m**2))
    return least.sum(axis=(0, 2)), mean_m, square_m2


def _misfits(apart_m: np.ndarray, sigma_m: float) -> np.ndarray:
    """The costs of offsets (2, ...), which are overwritten."""
    apart_m *= apart_m
    misfit = apart_m[0]
    misfit += apart_m[1]
    misfit *= 1 / sigma_m**2
    return np.minimum(misfit, _MOST, out=misfit)


def _turned(points_m: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Points (k, 3) under every rotation (p, 3, 3), shape (3, k, p)."""
    return points_m @ turns.transpose(1, 2, 0)
