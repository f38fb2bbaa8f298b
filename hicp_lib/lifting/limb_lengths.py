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
_BODY, _HAND = np.array([0.02, 0.005, 4.0]), np.array([0.03, 0.006, 20.0])  # share, more_m, most_short


@dataclass(frozen=True)
class Limbs:
    """Limbs at the same depth of the tree.

    Attributes
    ----------
    begin, end : array of int, shape (n,)
        Rows of the keypoints at their ends, `begin` nearer to the root.
    costs : array, shape (2 r + 1, n, g), dtype float32
        Costs of their lengths, by how many steps of depth the end lies behind the beginning, from -r on, and
        by the depth of the beginning. With more than r steps between them, all have the maximum cost.
    farthest_m : array, shape (n,)
        The length from which a limb has the maximum cost.
    """

    begin: np.ndarray
    end: np.ndarray
    costs: np.ndarray
    farthest_m: np.ndarray

    @property
    def costs_by_end(self) -> np.ndarray:
        """The same costs by how many steps the beginning lies behind the end, and by the depth of the end.

        Where the beginning would lie off the grid, any cost stands.
        """
        costs, (stride, *others) = self.costs, self.costs.strides
        first = stride * (len(costs) - 1) - costs.itemsize * (len(costs) // 2)
        return np.ndarray(costs.shape, costs.dtype, costs, first, (costs.itemsize - stride, *others))


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
    limits, level = _limits(found[pairs], measures), LEVELS[found[end]]
    farthest_m = limits[1] + np.sqrt(_MOST_LONG) * limits[2]
    reach = np.minimum((farthest_m / step_m).astype(int) + 1, len(grid_m) - 1)
    forms = _length_forms(grid_m, rays[pairs], limits)
    for number in np.flatnonzero(np.bincount(level)):
        some = level == number
        farthest = reach[some].max()
        costs = _length_costs(forms[:, some], step_m * np.arange(-farthest, farthest + 1))
        limbs.append(Limbs(pairs[0, some], pairs[1, some], costs, farthest_m[some]))
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
    >>> by_steps = np.array([9.0, 0.0, 9.0])[:, None, None].repeat(3, axis=2)
    >>> one_depth_only = Limbs(np.array([0]), np.array([1]), by_steps, np.array([0.3]))
    >>> choose_along_limbs(costs, [one_depth_only])[0]
    array([1, 1])
    """
    costs, told = costs.astype(np.float32), []
    for some in limbs[::-1]:
        told.append(_least_sums(some.costs, costs[some.end]))
        np.add.at(costs, some.begin, told[-1])
    chosen = costs.argmin(axis=1)  # used for those without a parent
    for some, told_of in zip(limbs, told[::-1], strict=True):
        chosen[some.end] = _choose_ends(some, chosen[some.begin], costs[some.end])
        costs[some.end] += _least_sums(some.costs_by_end, costs[some.begin] - told_of)
    return chosen, costs


def out_of_reach(points_m: np.ndarray, limbs: Sequence[Limbs]) -> np.ndarray:
    """Which ends of limbs are farther from their beginnings than any limb is long.

    Parameters
    ----------
    points_m : array, shape (m, 3)
    limbs : sequence of Limbs

    Returns
    -------
    array of bool, shape (m,)
    """
    is_out = np.zeros(len(points_m), bool)
    for some in limbs:
        along_m = points_m[some.end] - points_m[some.begin]
        is_out[some.end] = (along_m**2).sum(axis=1) >= some.farthest_m**2
    return is_out


def _least_sums(costs: np.ndarray, others: np.ndarray) -> np.ndarray:
    """By the depth of one end of limbs, the lowest sum of a limb's cost and the other end's, (n, g).

    `costs` as of `Limbs`, `others` (n, g) are those of the other ends.
    """
    sums = (costs + _shifted(others, len(costs) // 2)).min(axis=0)
    return np.minimum(sums, others.min(axis=1, keepdims=True) + _MOST_LONG)


def _shifted(costs: np.ndarray, reach: int) -> np.ndarray:
    """Costs (n, g) at depths so many steps nearer to so many farther, (2 reach + 1, n, g).

    Off the grid they are infinite.
    """
    n, n_depths = costs.shape
    padded = np.full((n, n_depths + 2 * reach), np.inf, np.float32)
    padded[:, reach : reach + n_depths] = costs
    by_step = padded.itemsize, *padded.strides
    return np.ndarray((2 * reach + 1, n, n_depths), padded.dtype, padded, strides=by_step)


def _choose_ends(limbs: Limbs, begins: np.ndarray, costs: np.ndarray) -> np.ndarray:
    """The best depths of the ends (n,), given those of the beginnings (n,) and the ends' costs (n, g)."""
    every, reach = np.arange(len(begins)), len(limbs.costs) // 2
    total = limbs.costs[:, every, begins] + _shifted(costs, reach)[:, every, begins]
    # Among equally good depths, prefer one that a limb nearly reaches.
    is_near = total.min(axis=0) <= costs.min(axis=1) + _MOST_LONG
    return np.where(is_near, begins + total.argmin(axis=0) - reach, costs.argmin(axis=1))


def _limits(pairs: np.ndarray, measures: BodyMeasures) -> np.ndarray:
    """Of n limbs, (4, n): least and greatest length, excess that costs 1, root of the most cost if short."""
    most_m = measures.farthest_m[*pairs]
    share, more_m, most_short = np.where(pairs[1] >= LEFT_HAND[0], _HAND[:, None], _BODY[:, None])
    return np.array([measures.closest_m[*pairs], most_m, share * most_m + more_m, np.sqrt(most_short)])


def _length_forms(grid_m: np.ndarray, rays: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """What `_length_costs` needs of n limbs that begin at each depth, (7, n, g), float32, lengths in sigmas.

    The length's square is a polynomial of how far the end lies behind the beginning: its three factors. Then
    the squares of the lengths from which the cost is greatest, and the lengths between which there is none.
    `rays` (2, n, 3) are the lines of sight, `limits` as of `_limits`.
    """
    ends, across = rays[1], rays[1] - rays[0]
    least_m, most_m, sigma_m, most_short = limits[:, :, None]
    least, most = least_m / sigma_m, most_m / sigma_m
    squares, mixed, constants = (
        (a * b).sum(axis=1)[:, None] / sigma_m**2 for a, b in ((ends, ends), (ends, across), (across, across))
    )
    shortest, longest = np.maximum(least - most_short, 0), most + np.sqrt(_MOST_LONG)
    rows = squares, 2 * mixed * grid_m, constants * grid_m**2, shortest**2, longest**2, least, most
    forms = np.empty((len(rows), len(ends), len(grid_m)), np.float32)
    for form, row in zip(forms, rows, strict=True):
        form[:] = row
    return forms


def _length_costs(forms: np.ndarray, behind_m: np.ndarray) -> np.ndarray:
    """Costs as of `Limbs`, from `_length_forms` (7, n, g) and how far ends lie behind beginnings (w,)."""
    squares, mixed, constants, shortest, longest, least, most = forms
    behind_m = behind_m.astype(np.float32)[:, None, None]
    values = squares * behind_m  # from here on in place, as memory access dominates the time
    values += mixed
    values *= behind_m
    values += constants
    np.minimum(np.maximum(values, shortest, out=values), longest, out=values)
    np.sqrt(values, out=values)
    free = np.maximum(values, least)
    values -= np.minimum(free, most, out=free)
    values *= values
    return values
