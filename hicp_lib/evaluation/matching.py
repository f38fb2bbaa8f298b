"""Match detections to people by object keypoint similarity (OKS)."""

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.oks import oks
from hicp_lib.formats.annotations import Annotations

MATCH_OKS = 0.1  # minimum similarity to match a detection to a person (Ronchi and Perona 2017)


def pairwise_oks(
    people: Annotations, found: Detections, keypoints: np.ndarray, sigmas: np.ndarray
) -> np.ndarray:
    """OKS of all people of an image and all detections in it.

    Parameters
    ----------
    people : Annotations
        Of one image.
    found : Detections
        In the same image.
    keypoints : array of int, shape (k,)
        Halpe indices of the group.
    sigmas : array, shape (k,)
        Their constants.

    Returns
    -------
    array, shape (n_people, n_detections)
        In [0, 1].
    """
    return oks(
        people.keypoints_px[:, None, keypoints], people.visibility[:, None, keypoints] > 0,
        people.boxes_px[:, None], people.areas_px2[:, None], found.keypoints_px[None, :, keypoints], sigmas,
    )  # fmt: skip


def match_best_first(fit: np.ndarray, scores: np.ndarray, least: float = MATCH_OKS) -> dict[int, int]:
    """Match detections, best first, to the free person with the highest similarity.

    Parameters
    ----------
    fit : array, shape (n_people, n_detections)
        Similarity of each pair.
    scores : array, shape (n_detections,)
        Scores by which detections are ranked; equal ones keep their order.
    least : float, optional
        Minimum similarity.

    Returns
    -------
    dict of int to int
        Row of the person to row of the detection.

    Examples
    --------
    >>> match_best_first(np.array([[0.9, 0.8], [0.3, 0.7]]), np.array([0.5, 0.6]))
    {0: 1, 1: 0}
    """
    fit = fit.copy()
    matched: dict[int, int] = {}
    for row in np.argsort(-scores, kind="stable").tolist() if len(fit) else ():
        person = int(fit[:, row].argmax())
        if fit[person, row] >= least:
            matched[person] = row
            fit[person] = 0.0
    return matched


def matched_people(
    people: Annotations, found: Detections, keypoints: np.ndarray, sigmas: np.ndarray
) -> dict[int, int]:
    """The matched detection of each person, with an OKS of at least `MATCH_OKS`.

    People without a labelled keypoint are left out: any detection near them would match.

    Parameters
    ----------
    people : Annotations
        Of one image.
    found : Detections
        In the same image.
    keypoints : array of int, shape (k,)
        Halpe indices of the group.
    sigmas : array, shape (k,)
        Their constants.

    Returns
    -------
    dict of int to int
        Row of the person to row of the detection.
    """
    fit = pairwise_oks(people, found, keypoints, sigmas)
    fit[~(people.visibility[:, keypoints] > 0).any(axis=1)] = 0.0
    return match_best_first(fit, found.person_scores)
