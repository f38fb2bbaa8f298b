"""Depths of all keypoints of a person chosen together, so that limbs have lengths that people have."""

from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np
from numpy.lib.stride_tricks import as_strided, sliding_window_view

from hicp_lib.core.keypoints import LEFT_HAND
from hicp_lib.lifting.body_measures import LEVELS, BodyMeasures, found_parents

# A limb longer or shorter than people's by a share of its length and some more costs 1, and so on with the
# square up to a most. Limbs of the body seen too short are often the detector's fault; hands are rigid.
_MOST_LONG = 40.0
_BODY = {"share": 0.02, "more_m": 0.005, "most_short": 4.0}
_HAND = {"share": 0.03, "more_m": 0.006, "most_short": 20.0}


@dataclass(frozen=True)
class Limbs:
    """Some limbs that are equally far from the root.

    Attributes
    ----------
    begin, end : array of int, shape (n,)
        Rows of the keypoints at their ends, `begin` nearer to the root.
    costs : array, shape (n, g, 2 r + 1)
        What their lengths cost: for each depth of the beginning, at each of r steps nearer to r steps further
        of the end. With more steps all of them are too long by the most that costs.
    """

    begin: np.ndarray
    end: np.ndarray
    costs: np.ndarray


def limbs_outwards(
    grid_m: np.ndarray, rays: np.ndarray, found: np.ndarray, measures: BodyMeasures
) -> list[Limbs]:
    """All limbs of a person, from the root of the tree outwards.

    Limbs of hands are short and need few steps, so they are apart from those of the body.

    Parameters
    ----------
    grid_m : array, shape (g,)
        Depths, evenly spaced.
    rays : array, shape (m, 3)
        Lines of sight, z = 1.
    found : array of int, shape (m,)
        The keypoints, Halpe order, increasing.
    measures : BodyMeasures

    Returns
    -------
    list of Limbs
        From the root outwards.
    """
    above, step_m = found_parents(found), grid_m[1] - grid_m[0]
    limbs = []
    for of_hand in (False, True):
        end = np.flatnonzero((above >= 0) & ((found >= LEFT_HAND[0]) == of_hand))
        if len(end) == 0:
            continue
        pairs = np.stack([above[end], end])
        limits = _Limits(found[pairs], measures)
        reach = min(int(limits.farthest_m.max() / step_m) + 1, len(grid_m) - 1)
        ends_m = grid_m[:, None] + step_m * np.arange(-reach, reach + 1)
        costs = _length_costs(grid_m[:, None], ends_m, rays[pairs], limits)
        levels = LEVELS[found[end]]
        for level in np.unique(levels):
            alike = levels == level
            limbs.append((level, Limbs(above[end[alike]], end[alike], costs[alike])))
    return [of_level for _, of_level in sorted(limbs, key=itemgetter(0))]


def choose_along_limbs(costs: np.ndarray, limbs: Sequence[Limbs]) -> tuple[np.ndarray, np.ndarray]:
    """The depths that cost least in all, and what any other depth of a keypoint costs at least.

    The sum over keypoints and limbs is minimised exactly along the tree of limbs, from their ends to the
    root and back (dynamic programming, as in Felzenszwalb and Huttenlocher, "Pictorial Structures for
    Object Recognition", IJCV 2005, there in the image plane), limbs equally far from the root at once.

    Parameters
    ----------
    costs : array, shape (m, g)
        Of each keypoint at each depth of the limbs' grid.
    limbs : sequence of Limbs
        From the root outwards, as `limbs_outwards` gives them.

    Returns
    -------
    chosen : array of int, shape (m,)
        Index into the grid.
    in_all : array, shape (m, g)
        The least sum with that keypoint at that depth (min-marginals).

    Examples
    --------
    >>> costs = np.array([[0.0, 1.0, 5.0], [4.0, 0.0, 4.0]])
    >>> choose_along_limbs(costs, [])[0]
    array([0, 1])
    >>> one_step_only = Limbs(np.array([0]), np.array([1]), np.full((1, 3, 3), [9.0, 0.0, 9.0]))
    >>> choose_along_limbs(costs, [one_step_only])[0]
    array([1, 1])
    """
    g = costs.shape[1]
    widest = max((some.costs.shape[2] for some in limbs), default=1)
    padded = np.pad(np.float32(costs), [(0, 0), (widest // 2, widest // 2)], constant_values=np.inf)
    costs = padded[:, widest // 2 :][:, :g]  # a view: what is added here is seen by those further in
    answers = []
    for some in limbs[::-1]:
        width = some.costs.shape[2]
        within = padded[:, (widest - width) // 2 :][:, : g + width - 1]
        total = sliding_window_view(within, width, axis=1)[some.end] + some.costs
        near, far = total.argmin(axis=2), costs[some.end].argmin(axis=1)[:, None]
        near_cost, far_cost = total.min(axis=2), costs[some.end].min(axis=1)[:, None] + _MOST_LONG
        told = np.minimum(near_cost, far_cost)
        answers.append((np.where(near_cost <= far_cost, near + np.arange(g) - width // 2, far), told))
        np.add.at(costs, some.begin, told)
    chosen = costs.argmin(axis=1)  # which counts for those that hang on none
    for some, (answer, told) in zip(limbs, answers[::-1], strict=True):
        chosen[some.end] = np.take_along_axis(answer, chosen[some.begin, None], axis=1)[:, 0]
        rest = costs[some.begin] - told
        n, _, width = some.costs.shape
        # Sums by depth of the beginning and of the end: each row starts one to the right of the last.
        total = np.full((n, g, g + width - 1), np.inf, np.float32)
        along = total.strides[0], total.strides[1] + total.strides[2], total.strides[2]
        as_strided(total, some.costs.shape, along)[:] = rest[:, :, None] + some.costs
        near_cost = total.min(axis=1)[:, width // 2 :][:, :g]
        costs[some.end] += np.minimum(near_cost, rest.min(axis=1)[:, None] + _MOST_LONG)
    return chosen, costs


def out_of_reach(chosen: np.ndarray, limbs: Sequence[Limbs]) -> np.ndarray:
    """Which ends of limbs are so far from their beginnings that nobody's limb reaches.

    Parameters
    ----------
    chosen : array of int, shape (m,)
        Index into the limbs' grid.
    limbs : sequence of Limbs

    Returns
    -------
    array of bool, shape (m,)
    """
    is_out = np.zeros(len(chosen), bool)
    for some in limbs:
        begin, last = chosen[some.begin], some.costs.shape[2] - 1
        step = chosen[some.end] - begin + last // 2
        cost = some.costs[np.arange(len(begin)), begin, np.clip(step, 0, last)]
        is_out[some.end] = (step < 0) | (step > last) | (cost >= _MOST_LONG)
    return is_out


class _Limits:
    """Of n limbs, arrays (n, 1, 1): least and most length, what more or less than that costs 1, and how many
    times that counts when it is too short."""

    def __init__(self, pairs: np.ndarray, measures: BodyMeasures):
        is_hand = pairs[1] >= LEFT_HAND[0]
        share, more_m, most_short = (np.where(is_hand, _HAND[name], _BODY[name]) for name in _BODY)
        most_m = measures.farthest_m[*pairs]
        limits_m = measures.closest_m[*pairs], most_m, share * most_m + more_m
        limits = np.array([*limits_m, np.sqrt(most_short)], np.float32)[..., None, None]
        self.least_m, self.most_m, self.sigma_m, self.most_short = limits

    @property
    def farthest_m(self) -> np.ndarray:
        """Where a limb is too long by the most that costs."""
        return self.most_m + np.sqrt(_MOST_LONG) * self.sigma_m


def _length_costs(first_m: np.ndarray, second_m: np.ndarray, rays: np.ndarray, limits: _Limits) -> np.ndarray:
    """What the distances between n pairs of keypoints cost, (n, g, h), float32.

    The depths of the first are (g, 1), of the second (g, h); `rays` (2, n, 3) are those of both.
    """
    first_m, second_m, rays = (array.astype(np.float32) for array in (first_m, second_m, rays))
    aa, bb, ab = ((a * b).sum(axis=1)[:, None, None] for a, b in (rays[[0, 0]], rays[[1, 1]], rays))
    values = bb * second_m  # from here on in place, as memory is what takes the time
    values -= 2 * ab * first_m
    values *= second_m
    values += aa * first_m**2
    length_m = np.sqrt(np.maximum(values, 0, out=values), out=values)
    nearest_m = np.maximum(length_m, limits.least_m)
    values -= np.minimum(nearest_m, limits.most_m, out=nearest_m)
    values /= limits.sigma_m
    np.maximum(values, -limits.most_short, out=values)
    np.minimum(values, np.float32(np.sqrt(_MOST_LONG)), out=values)
    values *= values
    return values
