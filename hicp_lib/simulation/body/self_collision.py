"""Self-collision: distances of a posed person's arms from trunk, head, thighs and each other.

A cheap test on the bones only, to reject self-colliding poses: the
trunk is a stack of elliptic slices, the head an ellipsoid, limbs are rows of spheres.
"""

from dataclasses import dataclass

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR, read_arrays
from hicp_lib.core.memo import memoised
from hicp_lib.simulation.body.identities import PEOPLE
from hicp_lib.simulation.body.model import Body, Pose, Shape, pose_bones, shape_number

Spheres = tuple[np.ndarray, np.ndarray]  # centres (n, 3) and radii (n,)

LIMBS = PEOPLE["limb_spheres"]
"""Limbs as spheres, those of the arm first: region, first and last bone head, fractions of the way between.

Most of the upper arm may touch the trunk; slightly beyond the last knuckle is a fingertip.
"""
_SIZES = {"bones": (-1, 13), "centres_m": (-1, 13, 3), "half_axes_m": (-1, 13, 3), "radii_m": (-1, 4)}


@dataclass(frozen=True)
class CollisionModel:
    """Sizes of one shape: its trunk's slices from below, then its head; from the pelvis, body axes.

    Attributes
    ----------
    shape : int or str
        As in `pose_body`.
    bones : array of int, shape (n_parts,)
        Which bone each part moves with.
    bone_heads_m : array, shape (n_parts, 3)
        Where that bone begins at rest.
    centres_m : array, shape (n_parts, 3)
        At rest.
    half_axes_m : array, shape (n_parts, 3)
        A slice's last one is half its height.
    radii_m : dict of str to float
        Of limbs, by region.
    """

    shape: Shape
    bones: np.ndarray
    bone_heads_m: np.ndarray
    centres_m: np.ndarray
    half_axes_m: np.ndarray
    radii_m: dict[str, float]

    def trunk_at(self, height: float) -> tuple[np.ndarray, np.ndarray]:
        """Centre and half axes (3,) of the trunk's slice at a height from 0 (crotch) to 1 (neck), at rest."""
        part = int(np.clip(height, 0, 1) * (len(self.bones) - 2) + 0.5)
        return self.centres_m[part], self.half_axes_m[part]


@memoised(64)
def collision_model(body: Body, shape: Shape) -> CollisionModel:
    """Sizes of a shape, which is given as in `pose_body`.

    Raises
    ------
    InputError
        If the file of measurements is missing or malformed.
    """
    number = shape_number(body, shape)
    tables = read_arrays(DATA_DIR / "body_sizes.npz", _SIZES, "sizes of bodies", "tools/measure_sizes.py")
    bones, centres, half_axes, radii = (table[number] for table in tables)
    heads = body.heads_m[number] - body.heads_m[number, 0]
    regions = [region for region, *_ in LIMBS]
    radii_m = dict(zip(regions, radii.tolist(), strict=True))
    return CollisionModel(shape, bones, heads[bones], centres, half_axes, radii_m)


def self_collision_distance_m(body: Body, model: CollisionModel, pose: Pose) -> float:
    """Smallest gap between an arm and trunk, head, thighs or the other arm; negative inside.

    Gaps to trunk and head are approximate; only their sign near zero is to be relied on.

    Parameters
    ----------
    body : Body
    model : CollisionModel
        Of the shape that is posed.
    pose : mapping of str to array
        See `pose_body`.

    Returns
    -------
    float
        Metres.

    Examples
    --------
    >>> from hicp_lib.simulation.body.joints import pose_from_joints
    >>> from hicp_lib.simulation.body.model import load_body
    >>> body = load_body()
    >>> into_the_trunk = pose_from_joints({"left_shoulder_abduction": -0.4})
    >>> self_collision_distance_m(body, collision_model(body, 0), into_the_trunk) < 0
    True
    """
    rotations, heads = pose_bones(body, model.shape, pose)
    left, right = (_spheres(body, model, heads, LIMBS[:3], side) for side in "LR")
    arms = np.concatenate([left[0], right[0]]), np.concatenate([left[1], right[1]])
    gaps = [_gap_to_trunk(model, rotations, heads, *arms).min(), _gap(left, right)]
    gaps += [_gap(arms, _spheres(body, model, heads, LIMBS[3:], side)) for side in "LR"]
    return float(min(gaps))


def _gap_to_trunk(shape: CollisionModel, rotations, heads, points, radii) -> np.ndarray:
    """Gap (n_points,) to the nearest slice of the trunk, and to the head."""
    R = rotations[shape.bones]
    centres = heads[shape.bones] + np.einsum("pij,pj->pi", R, shape.centres_m - shape.bone_heads_m)
    local = np.einsum("pij,npi->npj", R, points[:, None] - centres)
    across = np.minimum(shape.half_axes_m[:, 0], shape.half_axes_m[:, 1])
    scaled = np.abs(local) / shape.half_axes_m
    # A slice is an endless cylinder cut at its height, the head is round.
    flat = np.linalg.norm(scaled[..., :2], axis=2)
    flat[:, -1] = np.linalg.norm(scaled[:, -1], axis=1)
    gap = (flat - 1) * across - radii[:, None]
    gap[:, :-1][scaled[:, :-1, 2] > 1] = np.inf
    return gap.min(axis=1)


def _gap(a: Spheres, b: Spheres) -> float:
    distance = np.linalg.norm(a[0][:, None] - b[0][None], axis=2)
    return float((distance - a[1][:, None] - b[1]).min())


def _spheres(body: Body, shape: CollisionModel, heads, limbs, side: str) -> Spheres:
    points, radii = [], []
    for region, first, last, fractions in limbs:
        a, b = (heads[body.bone_numbers[f"{bone}.{side}"]] for bone in (first, last))
        points += [a + t * (b - a) for t in fractions]
        radii += [shape.radii_m[region]] * len(fractions)
    return np.array(points), np.array(radii)
