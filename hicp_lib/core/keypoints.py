"""Keypoint conventions, their groups, and their maps onto the one internal layout, Halpe-136.

Order (0-based): 0-16 COCO body, 17 head top, 18 neck, 19 mid-hip, 20-25 feet
(interleaved left/right), 26-93 face (300-W order), 94-114 left hand, 115-135 right hand.
Left is always the person's left. Sources: the Halpe-FullBody, COCO-WholeBody, OpenPose and
MediaPipe documentation; see the book's conventions page for the tables in prose.
"""

import numpy as np

N_KEYPOINTS = 136

COCO_NAMES = (
    "nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow right_elbow "
    "left_wrist right_wrist left_hip right_hip left_knee right_knee left_ankle right_ankle"
).split()
_HALPE_BODY_NAMES = (
    "head_top neck mid_hip left_big_toe right_big_toe left_small_toe right_small_toe left_heel right_heel"
).split()
HAND_NAMES = ["hand_root"] + [
    f"{finger}_{joint}" for finger in ("thumb", "index", "middle", "ring", "little") for joint in (1, 2, 3, 4)
]
NAMES: tuple[str, ...] = (
    *COCO_NAMES,
    *_HALPE_BODY_NAMES,
    *(f"face_{i}" for i in range(68)),
    *(f"left_{name}" for name in HAND_NAMES),
    *(f"right_{name}" for name in HAND_NAMES),
)
INDEX: dict[str, int] = {name: i for i, name in enumerate(NAMES)}

COCO_17 = np.arange(0, 17)
BODY = np.arange(0, 26)
FACE = np.arange(26, 94)
LEFT_HAND = np.arange(94, 115)
RIGHT_HAND = np.arange(115, 136)
HANDS = np.arange(94, 136)
# Nose, eyes, ears, head top and face: what "the head" means when it is removed. The neck stays.
HEAD = np.concatenate([np.arange(0, 5), [17], FACE])

# The groups results are reported for: the body as all detectors share it, and both hands.
GROUPS: dict[str, np.ndarray] = {"body": COCO_17, "hand": HANDS}

_BODY_LIMBS = [
    (15, 13), (13, 11), (16, 14), (14, 12), (11, 12), (5, 11), (6, 12), (5, 6), (5, 7), (7, 9),
    (6, 8), (8, 10), (0, 1), (0, 2), (1, 3), (2, 4),
    (15, 20), (15, 22), (15, 24), (16, 21), (16, 23), (16, 25),
]  # fmt: skip
HAND_LIMBS: list[tuple[int, int]] = [
    (0 if joint == 1 else 4 * f + joint - 1, 4 * f + joint) for f in range(5) for joint in (1, 2, 3, 4)
]
LIMBS: list[tuple[int, int]] = _BODY_LIMBS + [(w + a, w + b) for w in (94, 115) for a, b in HAND_LIMBS]

_BODY_SIGMAS = [
    0.026, 0.025, 0.025, 0.035, 0.035, 0.079, 0.079, 0.072, 0.072,
    0.062, 0.062, 0.107, 0.107, 0.087, 0.087, 0.089, 0.089,
]  # fmt: skip
_WHOLEBODY_HAND_SIGMAS = [
    0.029, 0.022, 0.035, 0.037, 0.047, 0.026, 0.025, 0.024, 0.035, 0.018, 0.024,
    0.022, 0.026, 0.017, 0.021, 0.021, 0.032, 0.020, 0.019, 0.022, 0.031,
]  # fmt: skip
_WHOLEBODY_FACE_SIGMAS = [
    0.042, 0.043, 0.044, 0.043, 0.040, 0.035, 0.031, 0.025, 0.020, 0.023, 0.029, 0.032, 0.037, 0.038, 0.043,
    0.041, 0.045, 0.013, 0.012, 0.011, 0.011, 0.012, 0.012, 0.011, 0.011, 0.013, 0.015, 0.009, 0.007, 0.007,
    0.007, 0.012, 0.009, 0.008, 0.016, 0.010, 0.017, 0.011, 0.009, 0.011, 0.009, 0.007, 0.013, 0.008, 0.011,
    0.012, 0.010, 0.034, 0.008, 0.008, 0.009, 0.008, 0.008, 0.007, 0.010, 0.008, 0.009, 0.009, 0.009, 0.007,
    0.007, 0.008, 0.011, 0.008, 0.008, 0.008, 0.010, 0.008,
]  # fmt: skip
# COCO-WholeBody's values for big toes, small toes and heels, in Halpe's interleaved order.
_WHOLEBODY_FOOT_SIGMAS = [0.068, 0.092, 0.066, 0.094, 0.066, 0.094]

# Per-keypoint constants sigma of OKS (k = 2 sigma). "halpe": the Halpe tool box; "wholebody":
# COCO-WholeBody's, with Halpe's own value for the three points that set lacks (17-19).
SIGMAS: dict[str, np.ndarray] = {
    "halpe": np.array(_BODY_SIGMAS + [0.080] * 3 + [0.089] * 6 + [0.015] * 110),
    "wholebody": np.array(
        _BODY_SIGMAS
        + [0.080] * 3
        + _WHOLEBODY_FOOT_SIGMAS
        + _WHOLEBODY_FACE_SIGMAS
        + 2 * _WHOLEBODY_HAND_SIGMAS
    ),
}

# Maps onto Halpe-136: source index -> Halpe index, -1 where Halpe has no counterpart.
TO_HALPE: dict[str, np.ndarray] = {
    name: np.array(indices)
    for name, indices in {
        "halpe136": range(136),
        "halpe26": range(26),
        # Halpe without its face, as AlphaPose has models for.
        "halpe68_noface": [*range(26), *range(94, 136)],
        "coco17": range(17),
        "crowdpose14": range(5, 19),
        "wholebody133": [*range(17), 20, 22, 24, 21, 23, 25, *range(26, 136)],
        "openpose_coco18": [0, 18, 6, 8, 10, 5, 7, 9, 12, 14, 16, 11, 13, 15, 2, 1, 4, 3],
        "openpose_body25": [
            0, 18, 6, 8, 10, 5, 7, 9, 19, 12, 14, 16, 11, 13, 15, 2, 1, 4, 3, 20, 22, 24, 21, 23, 25,
        ],  # fmt: skip
        "openpose_face70": [*range(26, 94), -1, -1],
        # MediaPipe's foot index approximates the big toe; neck and mid-hip would only be mid-points.
        "mediapipe_pose33": [
            0, -1, 1, -1, -1, 2, -1, 3, 4, -1, -1, 5, 6, 7, 8, 9, 10, -1, -1, -1, -1, -1, -1,
            11, 12, 13, 14, 15, 16, 24, 25, 20, 21,
        ],  # fmt: skip
        "left_hand21": LEFT_HAND,
        "right_hand21": RIGHT_HAND,
    }.items()
}  # fmt: skip


def to_halpe(values: np.ndarray, convention: str, axis: int, fill: float = np.nan) -> np.ndarray:
    """Rearrange keypoints of another convention into Halpe-136.

    Parameters
    ----------
    values : array
        Anything per keypoint (coordinates, scores) with the keypoints along `axis`.
    convention : str
        A key of `TO_HALPE`.
    axis : int
        The keypoint axis, e.g. -2 for (n, n_source, 2) coordinates, -1 for (n, n_source) scores.
    fill : float, optional
        Value of Halpe keypoints without counterpart.

    Returns
    -------
    array
        136 long along `axis`.

    Examples
    --------
    >>> scores = to_halpe(np.arange(1.0, 18.0), "coco17", axis=-1, fill=0.0)
    >>> scores.shape, scores[INDEX["right_ankle"]], scores[INDEX["neck"]]
    ((136,), np.float64(17.0), np.float64(0.0))
    """
    indices = TO_HALPE[convention]
    source = np.moveaxis(np.asarray(values, dtype=float), axis, -1)
    if source.shape[-1] != len(indices):
        raise ValueError(f"{convention} has {len(indices)} keypoints, axis {axis} of {values.shape} does not")
    result = np.full((*source.shape[:-1], N_KEYPOINTS), fill)
    result[..., indices[indices >= 0]] = source[..., indices >= 0]
    return np.moveaxis(result, -1, axis)


# Left and right within the 300-W face: points first...last mirror onto total - i
# (contour, brows, nose, eyes, outer and inner lips).
_FACE_MIRROR = [
    (0, 16, 16), (17, 26, 43), (31, 35, 66), (36, 39, 81), (42, 45, 81), (40, 41, 87), (46, 47, 87),
    (48, 54, 102), (55, 59, 114), (60, 64, 124), (65, 67, 132),
]  # fmt: skip


def _halpe_mirror() -> np.ndarray:
    swap = {"left": "right", "right": "left"}
    parts = [name.partition("_") for name in NAMES]
    indices = [INDEX[swap.get(side, side) + bar + rest] for side, bar, rest in parts]
    for first, last, total in _FACE_MIRROR:
        for i in range(first, last + 1):
            indices[FACE[i]] = int(FACE[total - i])
    return np.array(indices)


_HALPE_MIRROR = _halpe_mirror()


def mirror(convention: str) -> np.ndarray:
    """For each keypoint, the one it becomes in a mirrored image: `values[..., mirror(c)]` swaps the sides.

    Hands on their own map onto themselves: the mirror image of a left hand is a right hand's.

    Parameters
    ----------
    convention : str
        A key of `TO_HALPE` whose keypoints all have a Halpe counterpart.

    Returns
    -------
    array of int, shape (n_source,)
        Indices.

    Examples
    --------
    >>> mirror("coco17")[:5]
    array([0, 2, 1, 4, 3])
    """
    indices = TO_HALPE[convention]
    place = {int(halpe): i for i, halpe in enumerate(indices)}
    return np.array([place.get(int(_HALPE_MIRROR[halpe]), i) for i, halpe in enumerate(indices)])
