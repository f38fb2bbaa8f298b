"""Keypoints outside the picture, from annotations in CropCOCO's layout.

CropCOCO (Purkrabek and Matas, ProbPose, CVPR 2025) is COCO's layout with one flag more: v = 3 marks a
keypoint that the person has, but outside the picture. Its position is given if known and is 0, 0 otherwise. A
person may have `pad_to_contain`, a number per keypoint: the factor by which the box, extended to the aspect
ratio of a network's input, must be enlarged about its centre to contain the keypoint (-1 for one without a
label). Up to `PADDING` the network sees it, and its position counts (`hicp_lib.evaluation.ap.extended_oks`).
"""

from typing import Any

import numpy as np

from hicp_lib.core.images import inside
from hicp_lib.core.keypoints import COCO_17, NAMES
from hicp_lib.formats.json_validation import Rows, is_number

FLAG_OUTSIDE = 3.0
OUTSIDE = -1.0  # in `Annotations.visibility`: not labelled in the picture, but known to lie outside it
PAD_KEY = "pad_to_contain"
PADDING = 1.25  # factor by which a top-down network's window exceeds the box
_SLACK_PX = 1.0  # by which a position may be rounded into the picture


def outside_from_flags(rows: Rows, triples: np.ndarray, sizes_px: np.ndarray) -> np.ndarray:
    """Which keypoints lie outside the picture, by their flags.

    Parameters
    ----------
    rows : Rows
        The people.
    triples : array, shape (n, 136, 3)
        Their keypoints as x, y, v.
    sizes_px : array of int, shape (n, 2)
        Width and height of their images.

    Returns
    -------
    array of bool, shape (n, 136)

    Raises
    ------
    InputError
        If a keypoint is flagged as outside but lies in the picture, or its position is needed but not given,
        or `pad_to_contain` is not a number for each of the 17 keypoints.
    """
    outside = triples[..., 2] == FLAG_OUTSIDE
    pads = rows.column(PAD_KEY, _is_pads, f"a list of {len(COCO_17)} numbers, one per keypoint", default=None)
    for i, k in np.argwhere(outside).tolist():
        width, height = (sizes_px[i] - 2 * _SLACK_PX).tolist()
        placed = triples[i, k, :2].any()
        if placed and inside(triples[i, k, :2] - _SLACK_PX, (0, 0, width, height)):
            place = "{:g}, {:g}".format(*triples[i, k, :2])
            raise rows.error(i, f"{NAMES[k]} has v = 3 (outside the picture) at {place}, which is inside it")
        if not placed and pads[i] is not None and k < len(pads[i]) and pads[i][k] <= PADDING:
            raise rows.error(
                i, f"{NAMES[k]} has no place, but {PAD_KEY} {pads[i][k]:g} <= {PADDING} asks for one"
            )
    return outside


def _is_pads(pads: Any) -> bool:
    return pads is None or isinstance(pads, list) and len(pads) == len(COCO_17) and all(map(is_number, pads))
