"""Where to cut off the head, from the positions of head and body (Docekal et al. 2022, section III-A).

The rest was chosen here:

- The head's position is the mean of its labelled keypoints (nose, eyes, ears, head top, face),
  the body's that of the other labelled body keypoints (hands do not count: 21 points on a
  raised hand would outweigh the trunk).
- The head's side is the direction (above, below, left, right) in which it is displaced most from the body.
  The cut is the first pixel border towards the body with every head keypoint, and the end of the face if the
  chin is not labelled (`face_end`), on the other side.
"""

from dataclasses import dataclass

import numpy as np

from hicp_lib.core.images import Box, inside
from hicp_lib.core.keypoints import BODY, FACE, HEAD, INDEX

TRUNK = np.setdiff1d(BODY, HEAD)
_MID_HEAD = np.arange(0, 5)  # nose, eyes, ears
_TOP, _CHIN = INDEX["head_top"], INDEX["face_8"]
_WAYS = {"neck": [INDEX["neck"]], "shoulders": [INDEX["left_shoulder"], INDEX["right_shoulder"]]}
# How the end of a face was determined, by decreasing reliability; with the last rule a part of the face may
# remain.
CUT_RULES = ("chin labelled", "head top", *_WAYS, "head labels only")

SIDES = ("left", "top", "right", "bottom")


@dataclass(frozen=True)
class HeadCut:
    """Positions of head and body in a crop, and the part that remains without the head.

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
    side: str
    kept_px: Box
    rule: str


def headless_cut(keypoints_px: np.ndarray, visibility: np.ndarray, crop_px: Box) -> HeadCut | None:
    """Find the cut that removes a person's head.

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
        None when no head keypoint or no other body keypoint is labelled. `kept_px` may be empty when the head
        reaches the far side of the crop.
    """
    labelled = (visibility > 0) & inside(keypoints_px, crop_px)
    head, body = (keypoints_px[part[labelled[part]]] for part in (HEAD, TRUNK))
    if not len(head) or not len(body):
        return None
    head_px, body_px = head.mean(axis=0), body.mean(axis=0)
    away = head_px - body_px
    axis = 0 if abs(away[0]) > abs(away[1]) else 1
    rule, end = face_end(keypoints_px[:, axis], labelled, visibility > 0, bool(away[axis] > 0))
    reach = np.append(head[:, axis], end)
    kept, further = [int(edge) for edge in crop_px], bool(away[axis] > 0)
    k = axis + 2 * further
    kept[k] = int(np.floor(reach.min() + 0.5)) if further else int(np.floor(reach.max() + 0.5)) + 1
    return HeadCut(head_px, body_px, SIDES[k], (kept[0], kept[1], kept[2], kept[3]), rule)


def face_end(
    along: np.ndarray, labelled: np.ndarray, known: np.ndarray, backwards: bool
) -> tuple[str, list[float]]:
    """The end of a face towards the body, estimated where the chin is not labelled.

    With the head's top, and nose, eyes or ears: these lie half-way between top and chin. Otherwise a fraction
    of the way to the neck, or to the middle of the shoulders, measured on development identities.

    Parameters
    ----------
    along : array, shape (136,)
        Keypoints on the axis along which the head is cut off, in Halpe's order, in pixels.
    labelled, known : array of bool, shape (136,)
        Labelled keypoints in the crop; and anywhere.
    backwards : bool
        Whether the body lies towards smaller values.

    Returns
    -------
    rule : str
        Of `CUT_RULES`.
    end : list of float
        The place along the axis, or none.
    """
    if known[_CHIN]:
        return CUT_RULES[0], [along[_CHIN]]
    middle = [along[part[labelled[part]]].mean() for part in (_MID_HEAD, FACE) if labelled[part].any()][:1]
    if labelled[_TOP] and middle:
        return CUT_RULES[1], [2 * middle[0] - along[_TOP]]
    # In 599 rendered images of development identities, 97.5 % of the faces end before this.
    start, share = (middle[0], 0.75) if middle else (along[_TOP], 0.90)
    for rule, part in _WAYS.items():
        way = np.mean(along[part][known[part]]) - start if known[part].any() else 0.0
        if way and (way < 0) == backwards:
            return rule, [start + share * way]
    return CUT_RULES[-1], []
