"""Robust lifting: joints instead of skin, surfaces near a keypoint, limbs of plausible length.

The paper's method (`hicp_lib.lifting.paper`) takes the depth of the surface that fills most of a keypoint's
neighbourhood. Its errors, as seen with exact ground truth, and the steps that correct them:

- It gives the skin, not the joint inside the limb. *below_surface*: a keypoint is moved behind the visible
  surface, along the line of sight, by its depth below the skin in the body model.
- It takes the background next to thin limbs, and flying pixels between two surfaces. *near_surfaces*: every
  surface around the keypoint is a candidate, whose cost grows with its distance from the keypoint in the
  image and at steps in depth; the depth is the mean over the part of the neighbourhood that agrees with the
  candidate of lowest cost.
- It takes the surface that occludes a joint, or the one next to a limb that the detector missed.
  *limb_lengths*: the depths of all keypoints are chosen jointly, with the lowest cost and plausible limb
  lengths. A joint may then also lie behind the visible surface, at a cost. A joint whose limb points at the
  camera is occluded by it, and lies deeper than its depth below the skin.
- It takes the front of a hand for the fingers behind it. *hand_shapes*: palm and bent fingers are fitted, and
  keypoints behind another part of the hand are drawn to their depth in the fitted shape.

Tried without benefit, and left out: the mode of depth around the keypoint instead of the best candidate, the
detector's scores as weights of limbs, the person's true size for limb lengths instead of the population's,
knuckles connected to each other instead of to the hand's root, a finer grid of depths, and more rotations of
the hand. Keypoints of the face need no limbs: they get the best of the surfaces near them.

A depth that agrees with no surface seen near the keypoint, or that no limb reaches, is *guessed*. The costs
of other depths, read as negative log-likelihoods, give each depth its standard deviation.

Measures of people come from the body model (`body_measures`, `hand_shapes`; development bodies only). The
costs (there, and in `depth_candidates` and `limb_lengths`) were checked again on the 24 development bodies,
16 frames each in the setups of both 3D pages, the D435's model, keypoints by MediaPipe and MoveNet Thunder
(`tools/choose_lifting.py`): each of 28 constants times 0.5, 0.7, 1.4 and 2, for the 95th percentile of errors
of wrists, elbows and fingers first and medians second. None of the 112 values was better by 3 % with an
interval, over people, that excludes none: the largest gain was 3.9 % (8.6 % to a loss of 0.7 %; twice the
slack of a hand's limbs), eight had clearly larger percentiles. So the costs were kept as they had been chosen
on other bodies of the model. The conversion of costs to likelihoods was chosen on the same people: of 113
guessed joints of the body .63 and .98 lie within one and two sigma, each person's with the value chosen on
the others (.50 and .91 with the hands' value). No other sensor was used. Thunder's shoulders are 1.8 cm too
wide there in the median, of which 1.3 cm are already in the image, so no cost of depth can correct it.
"""

from collections.abc import Sequence
from dataclasses import replace
from statistics import median

import numpy as np

from hicp_lib.core.camera import Camera
from hicp_lib.core.keypoints import BODY, FACE, INDEX, LEFT_HAND, N_KEYPOINTS, RIGHT_HAND
from hicp_lib.lifting.body_measures import load_measures
from hicp_lib.lifting.depth_candidates import Candidates, depth_candidates, depth_costs, refine_depths
from hicp_lib.lifting.hand_shapes import with_hand_shapes
from hicp_lib.lifting.limb_lengths import choose_along_limbs, limbs_outwards, out_of_reach
from hicp_lib.lifting.paper import GUESSED, LIFTED, MIN_DEPTH_M, NO_DEPTH, Lifted, lift

STEPS = ("below_surface", "near_surfaces", "limb_lengths", "hand_shapes")
"""The steps beyond the paper, each of which builds on the ones before."""

METHODS = {"robust": len(STEPS), "paper": 0}
"""Lifting methods, by how many of `STEPS` they take."""

_REACH_M, _GRID_M = 0.90, 0.02  # grid of depths around the person's centre
_END_ON = 0.5  # fraction of the depth below the skin that is added if the limb points at the camera
_SEEN_SIGMA_M = 0.012  # of seen depths, in addition to what their costs give
_IN_BODY, _IN_FACE = (np.isin(np.arange(N_KEYPOINTS), part) for part in (BODY, FACE))
_COST_SEEN, _COST_GUESSED = 0.5, np.where(_IN_BODY, 5.0, 3.0)  # a depth costing so much more is 1/e as likely
_HANDS = {"left": LEFT_HAND, "right": RIGHT_HAND}
_WRISTS = [INDEX[f"{side}_wrist"] for side in _HANDS]
# Elbows with their wrists, wrists with their middle knuckles.
_AHEAD = np.array(
    [[INDEX[f"{side}_elbow"] for side in _HANDS] + _WRISTS, _WRISTS + [hand[9] for hand in _HANDS.values()]]
)


def lift_robust(
    keypoints_px: np.ndarray, depth_m: np.ndarray, intrinsics: Camera, n_steps: int = len(STEPS)
) -> Lifted:
    """Lift the keypoints of all people in an image by the method of this module.

    Keypoints are lifted when there is depth within 30 mm (body and feet) or 10 mm (face and hands) of them.

    Parameters
    ----------
    keypoints_px : array, shape (n_people, 136, 2)
        (u, v), pixel centres at integers; NaN: not detected.
    depth_m : array, shape (height, width)
        Depth along the camera's z axis; 0, NaN or infinite: no depth.
    intrinsics : Camera
        Of that image.
    n_steps : int, optional
        How many of `STEPS` to take, to measure the effect of each; 0 for the paper's method.

    Returns
    -------
    Lifted

    Raises
    ------
    ValueError
        If the shapes are not these.

    Examples
    --------
    The joint lies below the skin that the camera sees, here at 2 m:

    >>> keypoints_px = np.full((1, 136, 2), np.nan)
    >>> keypoints_px[0, 9] = 32, 24  # the left wrist
    >>> lifted = lift_robust(keypoints_px, np.full((48, 64), 2.0), Camera(64, 48, 100.0, 100.0, 32.0, 24.0))
    >>> bool(2.0 < lifted.points_m[0, 9, 2] < 2.05)
    True
    """
    depth_m = np.asarray(depth_m, np.result_type(depth_m, np.float32))
    paper = lift(keypoints_px, depth_m, intrinsics)
    if n_steps < 2:
        away_m = np.linalg.norm(paper.points_m, axis=2)
        below_m = n_steps * load_measures().below_skin_m
        return replace(paper, points_m=paper.points_m * (1 + below_m / away_m)[..., None])
    points_m, sigma_m = (np.full(array.shape, np.nan) for array in (paper.points_m, paper.sigma_m))
    reason = np.where(paper.reason == LIFTED, NO_DEPTH, paper.reason)
    for person, pixels_px in enumerate(np.asarray(keypoints_px, float)):
        found = np.flatnonzero((paper.reason[person] == LIFTED) | (paper.reason[person] == NO_DEPTH))
        first_m = paper.points_m[person, found, 2]
        if np.isfinite(first_m).any():
            grid_m, candidates = _depths(found, first_m, pixels_px[found], depth_m, intrinsics)
            is_near = np.isfinite(candidates.depth_m).any(axis=1)
            found, candidates = found[is_near], candidates.take(is_near)
            points, is_seen, sigma = _choose(found, grid_m, candidates, STEPS[:n_steps])
            points_m[person, found], sigma_m[person, found] = points, sigma
            reason[person, found] = np.where(is_seen, LIFTED, GUESSED)
    return Lifted(points_m, reason, sigma_m)


def _depths(
    found: np.ndarray, first_m: np.ndarray, pixels_px: np.ndarray, depth_m: np.ndarray, intrinsics: Camera
) -> tuple[np.ndarray, Candidates]:
    """Possible depths of one person (g,), and the surfaces around the detected keypoints (m,).

    `first_m` (m,) are the paper's depths, `pixels_px` has the shape (m, 2).
    """
    middle_m = _middle_m(found, first_m)
    nearest_m, farthest_m = max(middle_m - _REACH_M, MIN_DEPTH_M), middle_m + _REACH_M
    # The surface may be the wall: the neighbourhood is never smaller than at the person's distance.
    near_m = np.clip(np.fmin(first_m, middle_m), nearest_m, None)
    candidates = depth_candidates(found, pixels_px, near_m, depth_m, intrinsics, load_measures().below_skin_m)
    return np.arange(nearest_m, farthest_m, _GRID_M), candidates


def _choose(
    found: np.ndarray, grid_m: np.ndarray, candidates: Candidates, steps: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """After the first two of `STEPS` or more: points (m, 3), whether depths are seen, and sigmas (m,)."""
    costs = depth_costs(candidates, grid_m)
    if "hand_shapes" in steps:
        costs = with_hand_shapes(costs, grid_m, candidates.rays, found)
    chosen = costs.argmin(axis=1)
    if "limb_lengths" in steps:
        on = np.flatnonzero(~_IN_FACE[found])  # keypoints connected by limbs
        limbs = limbs_outwards(grid_m, candidates.rays[on], found[on], load_measures())
        chosen[on], costs[on] = choose_along_limbs(costs[on], limbs)
    depth_m, is_seen = refine_depths(candidates, grid_m[chosen], _GRID_M)
    points_m = candidates.rays * depth_m[:, None]
    if "limb_lengths" in steps:
        is_seen[on] &= ~out_of_reach(candidates.rays[on] * grid_m[chosen[on], None], limbs)
        points_m *= 1 + _deeper_end_on(points_m, found)[:, None]
    unlikely = np.where(is_seen, _COST_SEEN, _COST_GUESSED[found])
    return points_m, is_seen, _sigmas_m(costs, grid_m, depth_m, unlikely)


def _deeper_end_on(points_m: np.ndarray, found: np.ndarray) -> np.ndarray:
    """The fraction by which joints (m,) are farther away when their limb points at the camera."""
    is_found = np.zeros(N_KEYPOINTS, bool)
    is_found[found] = True
    rows, ahead = np.searchsorted(found, _AHEAD[:, is_found[_AHEAD].all(axis=0)])
    joints_m, limbs_m = points_m[rows], points_m[rows] - points_m[ahead]
    away_m, length_m = (np.linalg.norm(vectors, axis=1) for vectors in (joints_m, limbs_m))
    cosine = np.maximum((limbs_m * joints_m).sum(axis=1) / (length_m * away_m), 0)
    share = np.zeros(len(found))
    share[rows] = _END_ON * cosine**4 * load_measures().below_skin_m[found[rows]] / away_m
    return share


def _sigmas_m(costs: np.ndarray, grid_m: np.ndarray, depth_m: np.ndarray, unlikely: np.ndarray) -> np.ndarray:
    """Standard deviation of depths (m,): a cost (m, g) higher by `unlikely` (m,) means 1/e as likely."""
    weights = np.exp((costs.min(axis=1, keepdims=True) - costs) / unlikely[:, None])
    away_m2 = (grid_m - depth_m[:, None]) ** 2
    return np.sqrt(_SEEN_SIGMA_M**2 + (weights * away_m2).sum(axis=1) / weights.sum(axis=1))


def _middle_m(found: np.ndarray, first_m: np.ndarray) -> float:
    """Approximate distance of the person: the median depth of the body, or of all keypoints without one."""
    known = np.isfinite(first_m)
    of_body = known & _IN_BODY[found]
    return median(first_m[of_body if of_body.any() else known].tolist())
