"""Extended OKS: keypoints outside the picture count, and placing one inside is an error.

Plain OKS ignores keypoints that are not labelled in the picture, so a hallucinated head costs nothing.
Extended OKS (Ex-OKS: Purkrabek and Matas, "ProbPose", CVPR 2025, the section on evaluation) is the mean of
the same terms over all keypoints whose truth is known, inside or outside the picture, with a distance that
includes a decision. A keypoint is declared *present* when its score is at least a threshold, absent
otherwise:

- inside, declared present: the distance between the two positions, as in OKS;
- outside, declared absent: 0, which is correct;
- outside, declared present: the distance of the given position from the border of the activation window;
- inside, declared absent: the distance of the true position from that border.

The activation window is what a top-down network sees: the person's box extended to 3:4 and enlarged 1.25
times about its centre. As in the authors' tool, the distance to the border combines (Euclidean) those to the
nearest vertical and to the nearest horizontal edge, so it points to a corner of the window. Away from the
corners, such an error fails every threshold of AP; near a corner it is tolerated. A keypoint between the
picture and the window's border is outside, unless the annotations have `pad_to_contain`: then keypoints in
the window are inside.

The authors' tool, exococotools, also ignores every detection in an image without evaluated people, and rounds
the window to single precision. COCO does neither, and neither do we. `hicp_lib.evaluation.ap.evaluate` uses
it with the option `outside`; people of whom only keypoints outside are known then count as well.
"""

import numpy as np

from hicp_lib.core.keypoints import COCO_17
from hicp_lib.core.oks import oks_terms
from hicp_lib.formats.annotations import Annotations
from hicp_lib.formats.cropcoco import OUTSIDE, PAD_KEY, PADDING

PRESENCE_CUT = 0.5  # minimum score of a keypoint that is declared present, the authors' default
_ASPECT = 3 / 4  # width by height of a network's input


def activation_windows(boxes_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The windows around boxes that a top-down network sees.

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
    """Flags of keypoints, with `pad_to_contain` deciding what is outside.

    Parameters
    ----------
    people : Annotations
        With flags below 0 for points outside the picture.

    Returns
    -------
    array, shape (n, 136)
        Above 0 inside, below 0 outside, 0 unknown.
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
        Of the annotated people; not used where they are outside.
    flags : array, shape (..., k)
        As of `known_flags`.
    boxes_px : array, shape (..., 4)
        x, y, width, height of the annotated people.
    areas_px2 : array, shape (...)
        The s² of each person.
    found_px : array, shape (..., k, 2)
        NaN where the detection gives no keypoint.
    present : array of bool, shape (..., k)
        Which of its keypoints the detection declares present; missing ones never are.
    sigmas : array, shape (k,)
        Constants of the keypoints.

    Returns
    -------
    array, shape (...)
        In [0, 1]. For people without known keypoints, by how far the detection leaves their window.
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
