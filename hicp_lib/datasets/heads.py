"""Where the head is cut off: after Docekal et al. 2022, section III-A, by the positions of head and body.

The rest is chosen here:

- The head's position is the mean of its labelled keypoints (nose, eyes, ears, head top, face),
  the body's that of the other labelled body keypoints (hands do not count: 21 points on a
  raised hand would outweigh the trunk).
- The head lies on that side of the body (above, below, left, right) in which it is displaced
  most. The cut is the first pixel border towards the body that leaves every head keypoint on
  the other side, and the end of the face, where the chin is not labelled (`face_end`).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from hicp_lib.core.images import Box, inside
from hicp_lib.core.keypoints import BODY, FACE, HEAD, INDEX

TRUNK = np.setdiff1d(BODY, HEAD)
_MID_HEAD = np.arange(0, 5)  # nose, eyes, ears
_TOP, _CHIN, _NECK = INDEX["head_top"], INDEX["face_8"], INDEX["neck"]
_SHOULDERS = np.array([INDEX["left_shoulder"], INDEX["right_shoulder"]])
# Where a face ends on the way to neck or shoulders, from nose, eyes and ears and from the head top: of 599
# pictures of the development bodies, in poses as they are rendered, 97.5 % of the faces end before.
_FACE_ENDS = {"middle": 0.75, "top": 0.90}
# How the end of a face was known, by falling trust; with the last a part of the face may stay in the picture.
CUT_RULES = ("chin labelled", "head top", "neck", "shoulders", "head labels only")

Side = Literal["left", "top", "right", "bottom"]


@dataclass(frozen=True)
class HeadCut:
    """Where head and body are in a crop, and what remains without the head.

    Attributes
    ----------
    head_px, body_px : array, shape (2,)
        The two centres.
    side : {"left", "top", "right", "bottom"}
        The side of the crop that is removed.
    kept_px : tuple of int
        Left, top, right, bottom of what remains, right and bottom exclusive.
    rule : str
        Of `CUT_RULES`.
    """

    head_px: np.ndarray
    body_px: np.ndarray
    side: Side
    kept_px: Box
    rule: str


def headless_cut(keypoints_px: np.ndarray, visibility: np.ndarray, crop_px: Box) -> HeadCut | None:
    """Find the cut that takes the head off a person.

    Parameters
    ----------
    keypoints_px : array, shape (136, 2)
        In Halpe's order.
    visibility : array, shape (136,)
        Only keypoints above 0 and inside the crop count.
    crop_px : tuple of int
        Left, top, right, bottom of the crop, in the keypoints' frame.

    Returns
    -------
    HeadCut or None
        None when no head keypoint or no other body keypoint is labelled. Nothing may remain (an empty
        `kept_px`) when the head reaches the far side of the crop.
    """
    labelled = (visibility > 0) & inside(keypoints_px, crop_px)
    head, body = (keypoints_px[part[labelled[part]]] for part in (HEAD, TRUNK))
    if not len(head) or not len(body):
        return None
    head_px, body_px = head.mean(axis=0), body.mean(axis=0)
    away = head_px - body_px
    axis = 0 if abs(away[0]) > abs(away[1]) else 1
    rule, end = face_end(keypoints_px, labelled, visibility > 0, axis, bool(away[axis] > 0))
    reach = np.append(head[:, axis], end)
    left, top, right, bottom = (int(edge) for edge in crop_px)
    before, after = int(np.floor(reach.min() + 0.5)), int(np.floor(reach.max() + 0.5)) + 1
    cuts: dict[tuple[int, bool], tuple[Side, Box]] = {  # by axis, and whether the head is further along it
        (0, False): ("left", (after, top, right, bottom)),
        (0, True): ("right", (left, top, before, bottom)),
        (1, False): ("top", (left, after, right, bottom)),
        (1, True): ("bottom", (left, top, right, before)),
    }
    return HeadCut(head_px, body_px, *cuts[axis, bool(away[axis] > 0)], rule)


def face_end(
    keypoints_px: np.ndarray, labelled: np.ndarray, known: np.ndarray, axis: int, backwards: bool
) -> tuple[str, list[float]]:
    """Where a face ends towards the body, as far as it is not labelled.

    With the head top, nose, eyes or ears: these lie half-way between top and chin. Otherwise a share of the
    way to the neck, or between the shoulders, as measured on the development bodies.

    Parameters
    ----------
    keypoints_px : array, shape (136, 2)
        In Halpe's order.
    labelled, known : array of bool, shape (136,)
        Labelled keypoints in the crop; and anywhere.
    axis : int
        Along which the head is cut off: 0 is u, 1 is v.
    backwards : bool
        Whether the body lies towards smaller values.

    Returns
    -------
    rule : str
        Of `CUT_RULES`.
    end : list of float
        The place along the axis, or none.
    """
    along = keypoints_px[:, axis]
    if known[_CHIN]:
        return CUT_RULES[0], [along[_CHIN]]
    middle = [along[part[labelled[part]]].mean() for part in (_MID_HEAD, FACE) if labelled[part].any()][:1]
    if labelled[_TOP] and middle:
        return CUT_RULES[1], [2 * middle[0] - along[_TOP]]
    start, share = (middle[0], _FACE_ENDS["middle"]) if middle else (along[_TOP], _FACE_ENDS["top"])
    for rule, part in zip(CUT_RULES[2:], (np.array([_NECK]), _SHOULDERS), strict=False):
        way = along[part[known[part]]].mean() - start if known[part].any() else 0.0
        if (way < 0) if backwards else (way > 0):
            return rule, [start + share * way]
    return CUT_RULES[-1], []
