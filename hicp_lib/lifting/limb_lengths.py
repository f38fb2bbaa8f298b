"""Depths of all keypoints of a person chosen together, so that limbs have lengths that people have."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from hicp_lib.core.keypoints import LEFT_HAND
from hicp_lib.lifting.body_measures import LEVELS, BodyMeasures, found_parents

# A limb longer or shorter than people's by a share of its length and some more costs 1, and so on with the
# square up to a most. Limbs of the body seen too short are often the detector's fault; hands are rigid.
_MOST_LONG = 40.0
_ALIKE = 20  # limbs whose reach falls into the same so many steps are worked out together
_BODY = {"share": 0.02, "more_m": 0.005, "most_short": 4.0}
_HAND = {"share": 0.03, "more_m": 0.006, "most_short": 20.0}


@dataclass(frozen=True)
class Limbs:
    """Some limbs that are equally far from the root.

    Attributes
    ----------
    begin, end : array of int, shape (n,)
        Rows of the keypoints at their ends, `begin` nearer to the root.
    costs : array, shape (n, 2 r + 1, g)
        What their lengths cost: at each of r steps nearer to r steps further of the end, for each depth of
        the beginning. With more steps all of them are too long by the most that costs.
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
    end = np.flatnonzero(above >= 0)
    pairs = np.stack([above[end], end])
    limits = _limits(found[pairs], measures)
    farthest_m = limits[1] + np.sqrt(_MOST_LONG) * limits[2]
    reach = np.minimum((farthest_m.ravel() / step_m).astype(int) + 1, len(grid_m) - 1)
    alike = 100 * LEVELS[found[end]] + reach // _ALIKE
    order = alike.argsort(kind="stable")
    pairs, limits, reach = pairs[:, order], limits[:, order], reach[order]
    rays = rays[pairs].astype(np.float32)
    dots = np.stack([(a * b).sum(axis=1) for a, b in (rays[[0, 0]], rays[[1, 1]], rays)])[..., None, None]
    most = reach.max(initial=0)
    ends_m = (grid_m + step_m * np.arange(-most, most + 1)[:, None]).astype(np.float32)
    limbs = []
    first = np.flatnonzero(np.diff(alike[order], prepend=-1))
    for some in map(slice, first, [*first[1:], len(order)]):
        r = reach[some].max()
        costs = _length_costs(ends_m[most], ends_m[most - r : most + r + 1], dots[:, some], limits[:, some])
        limbs.append(Limbs(pairs[0, some], pairs[1, some], costs))
    return limbs


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
    >>> one_step_only = Limbs(np.array([0]), np.array([1]), np.full((1, 3, 3), [[9.0], [0.0], [9.0]]))
    >>> choose_along_limbs(costs, [one_step_only])[0]
    array([1, 1])
    """
    g = costs.shape[1]
    widest = max((some.costs.shape[1] for some in limbs), default=1)
    padded = np.pad(np.float32(costs), [(0, 0), (widest // 2, widest // 2)], constant_values=np.inf)
    costs = padded[:, widest // 2 :][:, :g]  # a view: what is added here is seen by those further in
    told = []
    for some in limbs[::-1]:
        width = some.costs.shape[1]
        ends = padded[some.end, (widest - width) // 2 :][:, : g + width - 1]
        near = (sliding_window_view(ends, g, axis=1) + some.costs).min(axis=1)
        told.append(np.minimum(near, costs[some.end].min(axis=1)[:, None] + _MOST_LONG))
        np.add.at(costs, some.begin, told[-1])
    chosen = costs.argmin(axis=1)  # which counts for those that hang on none
    for some, told_of in zip(limbs, told[::-1], strict=True):
        n, width, _ = some.costs.shape
        ends, begin = costs[some.end], chosen[some.begin]
        near = padded[some.end[:, None], begin[:, None] + np.arange(width) + (widest - width) // 2]
        near += some.costs[np.arange(n), :, begin]
        is_near = near.min(axis=1) <= ends.min(axis=1) + _MOST_LONG
        chosen[some.end] = np.where(is_near, begin + near.argmin(axis=1) - width // 2, ends.argmin(axis=1))
        rest = costs[some.begin] - told_of
        # Sums by step and depth of the beginning; by the end's, each row begins one to the left of the last.
        total = np.full((n, width, g + width - 1), np.inf, np.float32)
        np.add(some.costs, rest[:, None], out=total[:, :, width // 2 :][:, :, :g])
        total = total.reshape(n, -1)[:, width - 1 :][:, : width * (g + width - 2)]
        near = total.reshape(n, width, -1)[:, :, :g].min(axis=1)
        costs[some.end] = ends + np.minimum(near, rest.min(axis=1)[:, None] + _MOST_LONG)
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
        begin, last = chosen[some.begin], some.costs.shape[1] - 1
        step = chosen[some.end] - begin + last // 2
        cost = some.costs[np.arange(len(begin)), np.clip(step, 0, last), begin]
        is_out[some.end] = (step < 0) | (step > last) | (cost >= _MOST_LONG)
    return is_out


def _limits(pairs: np.ndarray, measures: BodyMeasures) -> np.ndarray:
    """Of n limbs, (4, n, 1, 1): least and most length, what more or less than that costs 1, and how many
    times that counts when it is too short (its root)."""
    is_hand = pairs[1] >= LEFT_HAND[0]
    share, more_m, most_short = (np.where(is_hand, _HAND[name], _BODY[name]) for name in _BODY)
    most_m = measures.farthest_m[*pairs]
    limits = measures.closest_m[*pairs], most_m, share * most_m + more_m, np.sqrt(most_short)
    return np.array(limits, np.float32)[..., None, None]


def _length_costs(begin_m: np.ndarray, end_m: np.ndarray, dots: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """What the distances between n pairs of keypoints cost, (n, h, g), float32.

    The depths of the beginnings are (g,), of the ends (h, g); `dots` (3, n, 1, 1) are products of the lines
    of sight with themselves and each other, `limits` as of `_limits`.
    """
    (aa, bb, ab), (least_m, most_m, sigma_m, most_short) = dots, limits
    values = bb * end_m  # from here on in place, as memory is what takes the time
    values -= 2 * ab * begin_m
    values *= end_m
    values += aa * begin_m**2
    length_m = np.sqrt(np.maximum(values, 0, out=values), out=values)
    nearest_m = np.maximum(length_m, least_m)
    values -= np.minimum(nearest_m, most_m, out=nearest_m)
    values /= sigma_m
    np.maximum(values, -most_short, out=values)
    np.minimum(values, np.float32(np.sqrt(_MOST_LONG)), out=values)
    values *= values
    return values
