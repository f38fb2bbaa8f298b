"""Choose the depths of all keypoints of a person jointly, so that limbs have plausible lengths."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hicp_lib.core.keypoints import LEFT_HAND
from hicp_lib.lifting.body_measures import LEVELS, BodyMeasures, found_parents

# A limb that is longer or shorter than people's by a fraction of its length plus a constant costs 1; the cost
# grows with the square up to a maximum. Limbs of the body that appear too short are often the detector's
# error; hands are rigid.
_MOST_LONG = 40.0
_ALIKE = 20  # limbs whose reach falls into the same interval of steps are computed together
_BODY, _HAND = np.array([0.02, 0.005, 4.0]), np.array([0.03, 0.006, 20.0])  # share, more_m, most_short


@dataclass(frozen=True)
class Limbs:
    """Limbs at the same depth of the tree.

    Attributes
    ----------
    begin, end : array of int, shape (n,)
        Rows of the keypoints at their ends, `begin` nearer to the root.
    costs : array, shape (n, g, g)
        Costs of their lengths, by the depth of the beginning and then of the end.
    reach : int
        Steps of depth beyond which all of them have the maximum cost.
    """

    begin: np.ndarray
    end: np.ndarray
    costs: np.ndarray
    reach: int


def limbs_outwards(
    grid_m: np.ndarray, rays: np.ndarray, found: np.ndarray, measures: BodyMeasures
) -> list[Limbs]:
    """All limbs of a person, from the root of the tree outwards.

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
    above, step_m, limbs = found_parents(found), grid_m[1] - grid_m[0], []
    end = np.flatnonzero(above >= 0)
    pairs = np.stack([above[end], end])
    limits = _limits(found[pairs], measures)
    farthest_m = limits[1] + np.sqrt(_MOST_LONG) * limits[2]
    reach = np.minimum((farthest_m.ravel() / step_m).astype(int) + 1, len(grid_m) - 1)
    alike = 100 * LEVELS[found[end]] + reach // _ALIKE
    for kind in np.unique(alike):
        some = alike == kind
        costs = _length_costs(grid_m, rays[pairs[:, some]], limits[:, some])
        limbs.append(Limbs(pairs[0, some], pairs[1, some], costs, int(reach[some].max())))
    return limbs


def choose_along_limbs(costs: np.ndarray, limbs: Sequence[Limbs]) -> tuple[np.ndarray, np.ndarray]:
    """The depths with the lowest total cost, and the lowest total cost with any other depth of a keypoint.

    The sum over keypoints and limbs is minimised exactly along the tree of limbs, from their ends to the
    root and back (dynamic programming, as in Felzenszwalb and Huttenlocher, "Pictorial Structures for
    Object Recognition", IJCV 2005, there in the image plane), limbs equally far from the root at once.

    Parameters
    ----------
    costs : array, shape (m, g)
        Of each keypoint at each depth of the limbs' grid.
    limbs : sequence of Limbs
        From the root outwards, as from `limbs_outwards`.

    Returns
    -------
    chosen : array of int, shape (m,)
        Index into the grid.
    in_all : array, shape (m, g)
        The lowest sum with that keypoint at that depth (min-marginals).

    Examples
    --------
    >>> costs = np.array([[0.0, 1.0, 5.0], [4.0, 0.0, 4.0]])
    >>> choose_along_limbs(costs, [])[0]
    array([0, 1])
    >>> one_depth_only = Limbs(np.array([0]), np.array([1]), 9 - 9 * np.eye(3)[None], 1)
    >>> choose_along_limbs(costs, [one_depth_only])[0]
    array([1, 1])
    """
    costs, told = costs.astype(np.float32), []
    for some in limbs[::-1]:
        told.append((some.costs + costs[some.end][:, None]).min(axis=2))
        np.add.at(costs, some.begin, told[-1])
    chosen = costs.argmin(axis=1)  # used for those without a parent
    for some, told_of in zip(limbs, told[::-1], strict=True):
        ends, begin = costs[some.end], chosen[some.begin]
        total = some.costs[np.arange(len(begin)), begin] + ends
        # Among equally good depths, prefer one that a limb nearly reaches.
        total[abs(np.arange(costs.shape[1]) - begin[:, None]) > some.reach] = np.inf
        is_near = total.min(axis=1) <= ends.min(axis=1) + _MOST_LONG
        chosen[some.end] = np.where(is_near, total.argmin(axis=1), ends.argmin(axis=1))
        rest = costs[some.begin] - told_of
        costs[some.end] += (some.costs + rest[..., None]).min(axis=1)
    return chosen, costs


def out_of_reach(chosen: np.ndarray, limbs: Sequence[Limbs]) -> np.ndarray:
    """Which ends of limbs are farther from their beginnings than any limb is long.

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
        costs = some.costs[np.arange(len(some.end)), chosen[some.begin], chosen[some.end]]
        is_out[some.end] = costs >= _MOST_LONG
    return is_out


def _limits(pairs: np.ndarray, measures: BodyMeasures) -> np.ndarray:
    """Of n limbs, (4, n, 1, 1): minimum and maximum length, excess costing 1, root of the weight if short."""
    most_m = measures.farthest_m[*pairs]
    share, more_m, most_short = np.where(pairs[1] >= LEFT_HAND[0], _HAND[:, None], _BODY[:, None])
    limits = measures.closest_m[*pairs], most_m, share * most_m + more_m, np.sqrt(most_short)
    return np.array(limits, np.float32)[..., None, None]


def _length_costs(grid_m: np.ndarray, rays: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Costs of the distances between n pairs of keypoints, (n, g, g), float32.

    `rays` (2, n, 3) are the lines of sight, `limits` as of `_limits`.
    """
    grid_m, (begin, end) = grid_m.astype(np.float32), rays.astype(np.float32)
    aa, bb, ab = ((a * b).sum(axis=1)[:, None, None] for a, b in ((begin, begin), (end, end), (begin, end)))
    begin_m, (least_m, most_m, sigma_m, most_short) = grid_m[:, None], limits
    values = bb * grid_m - 2 * ab * begin_m  # from here on in place, as memory access dominates the time
    values *= grid_m
    values += aa * begin_m**2
    length_m = np.sqrt(np.maximum(values, 0, out=values), out=values)
    values -= np.clip(length_m, least_m, most_m)
    values /= sigma_m
    np.clip(values, -most_short, np.float32(np.sqrt(_MOST_LONG)), out=values)
    values *= values
    return values
