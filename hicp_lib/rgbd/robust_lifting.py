"""Lifting beyond the paper: joints instead of skin, what is seen near a keypoint, limbs of human length.

The paper's method (`lifting`) reads the depth of whatever fills most of a keypoint's neighbourhood.
What exact truth shows to go wrong with it, and the steps here that mend it:

- It gives the skin, not the joint in the middle of the limb. *below_surface*: a keypoint is put as far
  behind what is seen, along the line of sight, as it lies below the skin of the body model.
- It takes background beside thin limbs, and flying pixels between two surfaces. *near_surfaces*: every
  surface around the keypoint is a candidate, which costs more the further from the keypoint it is seen, and
  on depth steps; the depth is the mean over the part of the neighbourhood that agrees with the cheapest.
- It takes what hides a joint, and what is beside a limb that the detector missed. *limb_lengths*: depths
  of all keypoints are chosen together, so that they cost least while limbs have lengths that people have.
  Then a joint may also lie behind what is seen, at a cost.
- It takes the front of a hand for the fingers behind it. *hand_shapes*: the depths of a hand's keypoints are
  drawn to those of the hand that fits best, palm and bent fingers, behind what is seen where it must be.

Tried as well and left out, as they brought nothing: the mode of depth around the keypoint instead of the
cheapest candidate, scores of the detector as weights of limbs, the person's true size for the limbs'
lengths instead of everybody's, knuckles that hang on each other instead of on the hand's root, a finer grid
of depths, and a lower cost of being hidden. Keypoints of the face need no limbs: they are taken at the
cheapest of the surfaces near them.

Measures of people come from the body model (`body_measures`, `hand_shapes`). The costs (there, and in
`near_surfaces` and `limb_lengths`) were chosen by hand on rendered people who are in no recording of the
study.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from hicp_lib.keypoints import BODY, FACE, N_KEYPOINTS
from hicp_lib.rgbd.body_measures import BodyMeasures, load_measures
from hicp_lib.rgbd.camera import Intrinsics
from hicp_lib.rgbd.hand_shapes import favour_hand_shapes
from hicp_lib.rgbd.lifting import LIFTED, MIN_DEPTH_M, NO_DEPTH, Lifted, lift
from hicp_lib.rgbd.limb_lengths import choose_along_limbs
from hicp_lib.rgbd.near_surfaces import costs_of_depths, look_around, settle

STEPS = ("below_surface", "near_surfaces", "limb_lengths", "hand_shapes")
"""What goes beyond the paper; limb lengths choose among near surfaces, hand shapes are chosen with them."""

_REACH_M, _GRID_M = 0.90, 0.02  # grid of depths around the person's middle


def lift_robust(
    keypoints_px: np.ndarray, depth_m: np.ndarray, intrinsics: Intrinsics, steps: Collection[str] = STEPS
) -> Lifted:
    """Lift the keypoints of everyone in an image; this module's head says how.

    Parameters and errors as in `lifting.lift`; `steps`, some of `STEPS`, is for finding out what each
    brings. With near surfaces, keypoints are lifted when there is depth within 30 mm (body and feet) or
    10 mm (face and hands) of them.
    """
    if unknown := set(steps) - set(STEPS):
        raise ValueError(f"no step {', '.join(sorted(unknown))}; there are {', '.join(STEPS)}")
    for step, needed in (("limb_lengths", "near_surfaces"), ("hand_shapes", "limb_lengths")):
        if step in steps and needed not in steps:
            raise ValueError(f"{step} needs {needed}")
    measures = load_measures()
    below_m = measures.below_skin_m if "below_surface" in steps else np.zeros(N_KEYPOINTS)
    depth_m = np.asarray(depth_m, np.result_type(depth_m, np.float32))
    paper = lift(keypoints_px, depth_m, intrinsics)
    if "near_surfaces" not in steps:
        away_m = np.linalg.norm(paper.points_m, axis=2)
        return Lifted(paper.points_m * (1 + below_m / away_m)[..., None], paper.reason)
    points_m, reason = paper.points_m.copy(), paper.reason.copy()
    limbs = measures if "limb_lengths" in steps else None
    for person, pixels_px in enumerate(np.asarray(keypoints_px, float)):
        found = np.flatnonzero(np.isin(reason[person], (LIFTED, NO_DEPTH)))
        first_m = paper.points_m[person, found, 2]
        if np.isfinite(first_m).any():
            image = pixels_px[found], depth_m, intrinsics
            points_m[person, found] = _lift_person(
                found, first_m, *image, below_m, limbs, "hand_shapes" in steps
            )
    reason[np.isfinite(points_m[..., 2])] = LIFTED
    reason[(reason == LIFTED) & np.isnan(points_m[..., 2])] = NO_DEPTH
    return Lifted(points_m, reason)


METHODS = {"paper": lift, "robust": lift_robust}


def _lift_person(
    found: np.ndarray,
    first_m: np.ndarray,
    pixels_px: np.ndarray,
    depth_m: np.ndarray,
    intrinsics: Intrinsics,
    below_m: np.ndarray,
    limbs: BodyMeasures | None,
    with_hands: bool,
) -> np.ndarray:
    """Found keypoints of one person, (m, 3); `first_m` (m,) are the paper's depths, `below_m` of all 136."""
    middle_m = _middle_m(found, first_m)
    nearest_m, farthest_m = max(middle_m - _REACH_M, MIN_DEPTH_M), middle_m + _REACH_M
    # What is seen may be the wall: the neighbourhood is never smaller than at the person's middle.
    near_m = np.clip(np.fmin(first_m, middle_m), nearest_m, None)
    candidates = look_around(found, pixels_px, near_m, depth_m, intrinsics, below_m)
    seen = np.flatnonzero(np.isfinite(candidates.depth_m).any(axis=1))
    candidates = candidates.take(seen)
    grid_m = np.arange(nearest_m, farthest_m, _GRID_M)
    costs = costs_of_depths(candidates, grid_m)
    if with_hands:
        costs = favour_hand_shapes(costs, grid_m, candidates.rays, found[seen])
    chosen = costs.argmin(axis=1)
    if limbs is not None:
        on = np.flatnonzero(~np.isin(found[seen], FACE))
        chosen[on] = choose_along_limbs(costs[on], grid_m, candidates.rays[on], found[seen[on]], limbs)
    points_m = np.full((len(found), 3), np.nan)
    points_m[seen] = candidates.rays * settle(candidates, grid_m[chosen], _GRID_M)[:, None]
    return points_m


def _middle_m(found: np.ndarray, first_m: np.ndarray) -> float:
    """About how far away the person is: the median depth of the body, of everything without one."""
    body_m = first_m[np.isin(found, BODY)]
    return float(np.nanmedian(body_m if np.isfinite(body_m).any() else first_m))
