"""Extended OKS: points outside the picture count, and giving one inside is wrong.

Plain OKS leaves out what is not labelled in the picture, so an invented head costs nothing. Extended OKS
(Ex-OKS: Purkrabek and Matas, "ProbPose", CVPR 2025, the section on evaluation) is the mean of the same terms
over all keypoints whose truth is known, in the picture or outside it, with a distance that asks for a
decision, too. A keypoint is declared *present* when its score is at least a cut, absent otherwise:

- truly inside, declared present: the distance between the two places, as in OKS;
- truly outside, declared absent: 0, which is right;
- truly outside, declared present: how far the place lies from the border of the activation window;
- truly inside, declared absent: how far the true place lies from it.

The activation window is what a top-down network sees: the person's box brought to 3:4 and grown 1.25 times
about its centre. As the authors' tool measures it, the distance to the border is that to the nearest upright
edge and to the nearest level edge, in one (Euclidean): towards a corner of the window. Inside the window and
away from its corners that is wrong by any threshold of AP; in a corner it is forgiven. A truth between the
picture and the window's border is outside, unless the annotations have `pad_to_contain`: then what the
window contains is inside.

The authors' tool, exococotools, also forgives every detection in a picture where nobody counts, and rounds
the window to single precision. COCO does neither, nor is it done here.
`hicp_lib.evaluation.ap.evaluate` takes it with the option `outside`; people of whom only points outside are
known then count as well.
"""

import numpy as np

from hicp_lib.core.keypoints import COCO_17
from hicp_lib.core.oks import oks_terms
from hicp_lib.formats.annotations import Annotations
from hicp_lib.formats.cropcoco import OUTSIDE, PAD_KEY, PADDING

PRESENCE_CUT = 0.5  # least score of a keypoint that is declared present, the authors' default
_ASPECT = 3 / 4  # width by height of a network's input


def activation_windows(boxes_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What a top-down network sees of people in boxes.

    Parameters
    ----------
    boxes_px : array, shape (..., 4)
        x, y, width, height.

    Returns
    -------
    low, high : array, shape (..., 2)
        Top-left and bottom-right corner.

    Examples
    --------
    >>> [corner.tolist() for corner in activation_windows(np.array([[100.0, 100.0, 60.0, 60.0]]))]
    [[[92.5, 80.0]], [[167.5, 180.0]]]
    """
    size = boxes_px[..., 2:]
    shape = np.maximum(size, size[..., ::-1] * [_ASPECT, 1 / _ASPECT]) * PADDING
    centre = boxes_px[..., :2] + size / 2
    return centre - shape / 2, centre + shape / 2


def known_flags(people: Annotations) -> np.ndarray:
    """What is known of keypoints, where `pad_to_contain` decides over what is outside.

    Parameters
    ----------
    people : Annotations
        With flags below 0 for points outside the picture.

    Returns
    -------
    array, shape (n, 136)
        Above 0 inside, below 0 outside, 0 not known.
    """
    flags = people.visibility.copy()
    for i, extra in enumerate(people.extras):
        if PAD_KEY in extra:
            known = flags[i, COCO_17]
            beyond = np.array(extra[PAD_KEY], dtype=float) > PADDING
            flags[i, COCO_17] = np.where(beyond & (known != 0), OUTSIDE, np.abs(known))
    return flags


def extended_oks(
    truth_px: np.ndarray,
    flags: np.ndarray,
    boxes_px: np.ndarray,
    areas_px2: np.ndarray,
    found_px: np.ndarray,
    present: np.ndarray,
    sigmas: np.ndarray,
) -> np.ndarray:
    """Extended OKS of annotated people and detections, broadcast as in `hicp_lib.core.oks.oks`.

    Parameters
    ----------
    truth_px : array, shape (..., k, 2)
        Of the annotated people; not read where they are outside.
    flags : array, shape (..., k)
        As of `known_flags`.
    boxes_px : array, shape (..., 4)
        x, y, width, height of the annotated people.
    areas_px2 : array, shape (...)
        The s² of each person.
    found_px : array, shape (..., k, 2)
        NaN where the detection gives no keypoint.
    present : array of bool, shape (..., k)
        Which of its keypoints the detection declares present; those that are given, at most.
    sigmas : array, shape (k,)
        Constants of the keypoints.

    Returns
    -------
    array, shape (...)
        In [0, 1]. For people of whom nothing is known, by how far the detection leaves their window.
    """
    low_px, high_px = (corner[..., None, :] for corner in activation_windows(boxes_px))
    outside, present = flags[..., None] < 0, present[..., None]
    offset_px = np.where(
        present,
        np.where(outside, np.minimum(found_px - low_px, high_px - found_px), found_px - truth_px),
        np.where(outside, 0.0, np.minimum(truth_px - low_px, high_px - truth_px)),
    )
    unknown = ~(flags != 0).any(axis=-1, keepdims=True)
    leaves_px = np.maximum(low_px - found_px, 0) + np.maximum(found_px - high_px, 0)
    offset_px = np.where(unknown[..., None], leaves_px, offset_px)
    counts = (flags != 0) | unknown
    terms = oks_terms(offset_px, areas_px2, sigmas)
    return np.where(counts, terms, 0.0).sum(axis=-1) / counts.sum(axis=-1)
