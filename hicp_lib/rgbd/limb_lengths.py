"""Depths of all keypoints of a person chosen together, so that limbs have lengths that people have."""

from __future__ import annotations

import numpy as np

from hicp_lib.keypoints import LEFT_HAND
from hicp_lib.rgbd.body_measures import LEVELS, BodyMeasures, hang_together

# A limb longer or shorter than people's by a share of its length and some more costs 1, and so on with the
# square up to a most. Limbs of the body seen too short are often the detector's fault; hands are rigid.
_BODY = {"share": 0.05, "more_m": 0.010, "most_long": 40.0, "most_short": 4.0}
_HAND = {"share": 0.03, "more_m": 0.003, "most_long": 40.0, "most_short": 20.0}


def choose_along_limbs(
    costs: np.ndarray, grid_m: np.ndarray, rays: np.ndarray, found: np.ndarray, measures: BodyMeasures
) -> np.ndarray:
    """The depths that cost least in all.

    The sum over keypoints and limbs is minimised exactly along the tree of limbs, from their ends to the
    root and back (dynamic programming, as in Felzenszwalb and Huttenlocher, "Pictorial Structures for
    Object Recognition", IJCV 2005, there in the image plane).

    Parameters
    ----------
    costs : array, shape (m, g), of each keypoint at each depth
    grid_m : array, shape (g,)
    rays : array, shape (m, 3), lines of sight, z = 1
    found : array, shape (m,), the keypoints, Halpe order, increasing

    Returns
    -------
    array, shape (m,): index into `grid_m`
    """
    above = hang_together(found)
    outwards = np.argsort(LEVELS[found], kind="stable")
    costs = costs.copy()
    answer = np.zeros((len(found), len(grid_m)), int)
    for k in outwards[::-1]:
        if above[k] >= 0:
            pair = above[k], k
            total = _length_costs(grid_m, rays[list(pair)], found[list(pair)], measures) + costs[k]
            answer[k] = total.argmin(axis=1)
            costs[above[k]] += total.min(axis=1)
    chosen = np.zeros(len(found), int)
    for k in outwards:
        chosen[k] = answer[k, chosen[above[k]]] if above[k] >= 0 else costs[k].argmin()
    return chosen


def _length_costs(grid_m, rays, pair, measures: BodyMeasures) -> np.ndarray:
    """What the distance between two keypoints costs for each depth of the first and the second, (g, g)."""
    (aa, ab), (_, bb) = rays @ rays.T
    squared = aa * grid_m[:, None] ** 2 + bb * grid_m**2 - 2 * ab * grid_m[:, None] * grid_m
    length_m = np.sqrt(np.maximum(squared, 0))
    least_m, most_m = measures.closest_m[tuple(pair)], measures.farthest_m[tuple(pair)]
    limits = _HAND if pair[1] >= LEFT_HAND[0] else _BODY
    sigma_m = limits["share"] * most_m + limits["more_m"]
    too_long = np.maximum(length_m - most_m, 0) / sigma_m
    too_short = np.maximum(least_m - length_m, 0) / sigma_m
    return np.minimum(too_long**2, limits["most_long"]) + np.minimum(too_short**2, limits["most_short"])
