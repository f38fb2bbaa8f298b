"""Keypoint conventions, their groups, and their maps onto the one internal layout, Halpe-136.

Order (0-based): 0-16 COCO body, 17 head top, 18 neck, 19 mid-hip, 20-25 feet
(interleaved left/right), 26-93 face (300-W order), 94-114 left hand, 115-135 right hand.
Left is always the person's left. Sources: the Halpe-FullBody, COCO-WholeBody, OpenPose and
MediaPipe documentation; see the book's conventions page for the tables in prose. The numbers are in
`data/keypoints.json`.
"""

import json

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR

N_KEYPOINTS = 136
_TABLES = json.loads((DATA_DIR / "keypoints.json").read_text())

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

HAND_LIMBS: list[tuple[int, int]] = [
    (0 if joint == 1 else 4 * f + joint - 1, 4 * f + joint) for f in range(5) for joint in (1, 2, 3, 4)
]
LIMBS: list[tuple[int, int]] = [
    *map(tuple, _TABLES["body_limbs"]), *((w + a, w + b) for w in (94, 115) for a, b in HAND_LIMBS)
]  # fmt: skip

# Per-keypoint constants sigma of OKS (k = 2 sigma). "halpe": the Halpe tool box; "wholebody":
# COCO-WholeBody's, with Halpe's own value for the three points that set lacks (17-19).
SIGMAS: dict[str, np.ndarray] = {name: np.array(of) for name, of in _TABLES["oks_sigmas"].items()}

# Maps onto Halpe-136: source index -> Halpe index, -1 where Halpe has no counterpart. "halpe68_noface" is
# Halpe without its face, as AlphaPose has models for. MediaPipe's foot index approximates the big toe; neck
# and mid-hip would only be mid-points there.
TO_HALPE: dict[str, np.ndarray] = {
    name: np.array(indices) for name, indices in _TABLES["source_index_to_halpe"].items()
}


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


def _halpe_mirror() -> np.ndarray:
    swap = {"left": "right", "right": "left"}
    parts = [name.partition("_") for name in NAMES]
    indices = [INDEX[swap.get(side, side) + bar + rest] for side, bar, rest in parts]
    # Within the 300-W face, points first...last mirror onto total - i (contour, brows, nose, eyes, lips).
    for first, last, total in _TABLES["face_mirror"]:
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
