"""Surfaces seen around keypoints as candidates for their depth, and the cost of each depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hicp_lib.core.camera import Camera, deproject
from hicp_lib.core.keypoints import BODY, INDEX, N_KEYPOINTS
from hicp_lib.lifting.paper import has_depth

_IS_BODY = np.isin(np.arange(N_KEYPOINTS), BODY)
# Chosen on development people, as the costs in `limb_lengths` and `hand_shapes`: see `robust`.
RADIUS_M = np.where(_IS_BODY, 0.022, 0.013)  # radius around a keypoint in which surfaces are sampled
_SIGMA_M = np.where(_IS_BODY, 0.010, 0.008)  # a difference in depth that costs 1
_SIGMA_M[[INDEX["left_wrist"], INDEX["right_wrist"]]] = 0.015
_SAMPLES = 7  # per side of the neighbourhood
_STEPS = np.array(np.meshgrid(*[np.linspace(-1, 1, _SAMPLES)] * 2)).reshape(2, -1)
_STEEP_M = 0.03  # a larger difference between the pixels on both sides is a step in depth
_ON_STEP = 1.0  # cost of a surface there
_HIDDEN = np.where(_IS_BODY, 5.0, 2.0)  # cost of a depth behind the nearest surface
_IN_FRONT = 20.0  # and in front of it


@dataclass(frozen=True)
class Candidates:
    """Candidate depths of m keypoints of a person, from the surfaces seen around them.

    Attributes
    ----------
    rays : array, shape (m, 3)
        Lines of sight in the camera frame, z = 1.
    depth_m : array, shape (m, k)
        The keypoint's depth below each sampled surface; NaN where there was none.
    cost : array, shape (m, k)
        0 at the keypoint, 1 at the neighbourhood's edge, more at steps in depth.
    keypoints : array of int, shape (m,)
        Which they are, Halpe order.
    """

    rays: np.ndarray
    depth_m: np.ndarray
    cost: np.ndarray
    keypoints: np.ndarray

    @property
    def sigma_m(self) -> np.ndarray:
        """Differences of depth that cost 1, shape (m,)."""
        return _SIGMA_M[self.keypoints]

    def take(self, rows: np.ndarray) -> Candidates:
        """The candidates of some keypoints.

        Parameters
        ----------
        rows : array of int or array of bool

        Returns
        -------
        Candidates
        """
        return Candidates(self.rays[rows], self.depth_m[rows], self.cost[rows], self.keypoints[rows])


def depth_candidates(
    keypoints: np.ndarray,
    pixels_px: np.ndarray,
    near_m: np.ndarray,
    depth_m: np.ndarray,
    intrinsics: Camera,
    below_m: np.ndarray,
) -> Candidates:
    """Candidates of keypoints in the image: the surfaces seen around them.

    Parameters
    ----------
    keypoints : array of int, shape (m,)
        Which they are, Halpe order.
    pixels_px : array, shape (m, 2)
        (u, v).
    near_m : array, shape (m,)
        Approximate distance; determines the neighbourhood's size in pixels.
    depth_m : array, shape (height, width)
        Depth along the camera's z axis; 0, NaN or infinite: none.
    intrinsics : Camera
    below_m : array, shape (136,)
        Depths of keypoints below the surface.

    Returns
    -------
    Candidates

    Examples
    --------
    >>> camera = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
    >>> wrist, wall_m, below_m = np.array([9]), np.full((48, 64), 2.0), np.full(136, 0.03)
    >>> pixels_px, near_m = np.array([[31.5, 23.5]]), np.array([2.0])
    >>> found = depth_candidates(wrist, pixels_px, near_m, wall_m, camera, below_m)
    >>> np.unique(found.depth_m), found.rays
    (array([2.03]), array([[0., 0., 1.]]))
    """
    radius_px = np.maximum(intrinsics.fx_px * RADIUS_M[keypoints] / near_m, 2)
    middles_px = pixels_px.T[:, :, None]
    places = np.rint(middles_px + radius_px[:, None] * _STEPS[:, None]).astype(int)
    surface_m, is_steep = _sample(depth_m, *places)
    away = ((places - middles_px) ** 2).sum(axis=0)
    rays = deproject(intrinsics, pixels_px, np.ones(len(pixels_px)))
    deeper_m = below_m[keypoints] / np.linalg.norm(rays, axis=1)
    return Candidates(
        rays=rays,
        depth_m=surface_m + deeper_m[:, None],
        cost=away / radius_px[:, None] ** 2 + _ON_STEP * is_steep,
        keypoints=keypoints,
    )


def depth_costs(candidates: Candidates, grid_m: np.ndarray) -> np.ndarray:
    """The cost of each depth for each keypoint: the minimum over its explanations.

    The keypoint is at a sampled surface, or hidden behind one; in front of all of them it would be seen.

    Parameters
    ----------
    candidates : Candidates
        Of m keypoints, each with at least one depth.
    grid_m : array, shape (g,)
        Depths, evenly spaced.

    Returns
    -------
    array, shape (m, g)
    """
    nearest_m = np.nanmin(candidates.depth_m, axis=1)
    beyond_m = np.concatenate([[np.inf], grid_m, [np.inf]])  # values off the grid go to its ends
    costs = np.where(beyond_m > nearest_m[:, None], _HIDDEN[candidates.keypoints, None], _IN_FRONT)
    keypoint, sample = np.nonzero(np.isfinite(candidates.depth_m))
    depth_m, cost = candidates.depth_m[keypoint, sample], candidates.cost[keypoint, sample]
    # A surface explains only nearby depths at a cost below `_IN_FRONT`.
    step_m = grid_m[1] - grid_m[0]
    reach = int(np.sqrt(_IN_FRONT) * candidates.sigma_m.max(initial=0) / step_m + 0.5)
    nearest = np.rint((depth_m - grid_m[0]) / step_m).astype(int) + 1
    place = np.minimum(np.maximum(nearest + np.arange(-reach, reach + 1)[:, None], 0), len(beyond_m) - 1)
    apart = (beyond_m[place] - depth_m) / candidates.sigma_m[keypoint]
    flat = keypoint * len(beyond_m) + place
    np.minimum.at(costs.reshape(-1), flat.ravel(), (apart * apart + cost).ravel())  # fast in one dimension
    return costs[:, 1:-1]


def refine_depths(
    candidates: Candidates, chosen_m: np.ndarray, grid_step_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Refine depths chosen on a grid: the weighted mean of the candidates that agree.

    Without any, the keypoint is not seen, and the grid's depth remains.

    Parameters
    ----------
    candidates : Candidates
        Of m keypoints.
    chosen_m : array, shape (m,)
    grid_step_m : float

    Returns
    -------
    depth_m : array, shape (m,)
    is_seen : array of bool, shape (m,)
        Whether any agrees.
    """
    within_m = np.maximum(2 * candidates.sigma_m, grid_step_m)[:, None]
    agree = abs(candidates.depth_m - chosen_m[:, None]) < within_m
    weights = np.where(agree, np.exp(-2 * candidates.cost), 0)
    total = weights.sum(axis=1)
    depth_m = np.where(agree, candidates.depth_m, 0)
    mean_m = (weights * depth_m).sum(axis=1) / np.where(total > 0, total, 1)
    return np.where(total > 0, mean_m, chosen_m), total > 0


def _sample(depth_m: np.ndarray, columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Depth at pixels, NaN where missing, and whether there is a step or hole next to them."""
    height, width = depth_m.shape
    # One pixel inside the border, so that there are pixels on all sides.
    near_rows = np.minimum(np.maximum(rows, 1), height - 2)
    near_columns = np.minimum(np.maximum(columns, 1), width - 2)
    is_inside = (abs(near_rows - rows) < 2) & (abs(near_columns - columns) < 2)
    depth_m, places = depth_m.ravel(), near_rows * width + near_columns
    surface_m = depth_m.take(places)
    with np.errstate(invalid="ignore"):
        across, down = (abs(depth_m.take(places + n) - depth_m.take(places - n)) for n in (1, width))
        is_flat = (across < _STEEP_M) & (down < _STEEP_M)
    return np.where(is_inside & has_depth(surface_m), surface_m, np.nan), ~is_flat
