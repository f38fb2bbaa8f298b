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

NAMES: tuple[str, ...] = tuple(_TABLES["names"])
COCO_NAMES = list(NAMES[:17])
HAND_NAMES = [name.removeprefix("left_") for name in NAMES[94:115]]
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

LIMBS: list[tuple[int, int]] = [(a, b) for a, b in _TABLES["limbs"]]
HAND_LIMBS = [(a - 94, b - 94) for a, b in LIMBS if a in LEFT_HAND]

# Per-keypoint constants sigma of OKS (k = 2 sigma). "halpe": the Halpe tool box; "wholebody":
# COCO-WholeBody's, with Halpe's own value for the three points that set lacks (17-19).
SIGMAS: dict[str, np.ndarray] = {name: np.array(of) for name, of in _TABLES["oks_sigmas"].items()}

# Maps onto Halpe-136: source index -> Halpe index, -1 where Halpe has no counterpart. "halpe68_noface" is
# Halpe without its face; AlphaPose has models for it. MediaPipe's foot index approximates the big toe; neck
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


_HALPE_MIRROR = np.array(_TABLES["in_a_mirror"])


def mirror(convention: str) -> np.ndarray:
    """For each keypoint, the one it becomes in a mirrored image: `values[..., mirror(c)]` swaps the sides.

    Conventions of a single hand map onto themselves: the mirror image of a left hand is a right hand.

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
