"""Object keypoint similarity (OKS), vectorised, by the formula of COCO's evaluation tool.

Keypoint i at distance d from the truth counts exp(-d² / (2 s² k_i²)) with k_i = 2 sigma_i and s² the
person's area (COCO keypoint evaluation, cocodataset.org/#keypoints-eval); OKS is the mean over the
labelled keypoints. A keypoint that is not given (NaN) counts 0.
"""

import numpy as np

_EPS = np.spacing(1)


def oks_terms(offsets_px: np.ndarray, areas_px2: np.ndarray, sigmas: np.ndarray) -> np.ndarray:
    """The contribution of each keypoint to OKS.

    Parameters
    ----------
    offsets_px : array, shape (..., k, 2)
        From the true to the detected position.
    areas_px2 : array, shape (...)
        The s² of each person.
    sigmas : array, shape (k,)
        Constants of the keypoints.

    Returns
    -------
    array, shape (..., k)
        In [0, 1]; 0 where the offset is NaN.

    Examples
    --------
    >>> oks_terms(np.array([[0.0, 0.0], [10.0, 0.0]]), np.array(100.0), np.array([0.1, 0.5])).round(3)
    array([1.   , 0.607])
    """
    squared_px2 = offsets_px[..., 0] ** 2 + offsets_px[..., 1] ** 2
    exponent = squared_px2 / (2 * sigmas) ** 2 / (np.asarray(areas_px2)[..., None] + _EPS) / 2
    return np.exp(-np.where(np.isnan(exponent), np.inf, exponent))


def oks(
    truth_px: np.ndarray,
    labelled: np.ndarray,
    boxes_px: np.ndarray,
    areas_px2: np.ndarray,
    found_px: np.ndarray,
    sigmas: np.ndarray,
) -> np.ndarray:
    """OKS of annotated people and detections, broadcast: `x[:, None]` against `y[None]` gives all pairs.

    A person without a labelled keypoint gets, as in COCO's tool, the mean over all keypoints with
    distances taken to the box grown to [x - w, x + 2w] x [y - h, y + 2h], 0 inside.

    Parameters
    ----------
    truth_px : array, shape (..., k, 2)
        Of the annotated people.
    labelled : array of bool, shape (..., k)
        Which keypoints count.
    boxes_px : array, shape (..., 4)
        x, y, width, height of the annotated people.
    areas_px2 : array, shape (...)
        The s² of each person.
    found_px : array, shape (..., k, 2)
        NaN where the detection gives no keypoint.
    sigmas : array, shape (k,)
        Constants of the keypoints.

    Returns
    -------
    array, shape (...)
        In [0, 1].
    """
    offsets_px, unlabelled = found_px - truth_px, ~np.any(labelled, axis=-1, keepdims=True)
    if unlabelled.any():
        corner, size = boxes_px[..., None, :2], boxes_px[..., None, 2:]
        outside_px = np.maximum(corner - size - found_px, 0) + np.maximum(found_px - (corner + 2 * size), 0)
        offsets_px = np.where(unlabelled[..., None], outside_px, offsets_px)
    counts = labelled | unlabelled
    return np.where(counts, oks_terms(offsets_px, areas_px2, sigmas), 0.0).sum(axis=-1) / counts.sum(axis=-1)
