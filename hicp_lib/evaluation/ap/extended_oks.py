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
away from its border that is wrong by any threshold of AP; at the border it is forgiven. A truth between the
picture and the window's border is outside, unless the annotations have `pad_to_contain`: then what the
window contains is inside.

People, ranks, thresholds and averages are COCO's, as in `evaluate`; people of whom only points outside are
known count as well.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import COCO_17, GROUPS, SIGMAS
from hicp_lib.core.oks import oks_terms
from hicp_lib.evaluation.ap import cocoeval
from hicp_lib.evaluation.ap.bootstrap import Clusters, bootstrap_intervals
from hicp_lib.evaluation.ap.evaluate import Evaluation, evaluate
from hicp_lib.formats.annotations import Annotations
from hicp_lib.formats.cropcoco import PAD_KEY, PADDING

PRESENCE_CUT = 0.5  # least score of a keypoint that is declared present, the authors' default
_ASPECT = 3 / 4  # width by height of a network's input


def activation_windows(boxes_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What a top-down network sees of people in boxes.

    Parameters
    ----------
    boxes_px : array, shape (n, 4)
        x, y, width, height.

    Returns
    -------
    low, high : array, shape (n, 2)
        Top-left and bottom-right corner.

    Examples
    --------
    >>> [corner.tolist() for corner in activation_windows(np.array([[100.0, 100.0, 60.0, 60.0]]))]
    [[[92.5, 80.0]], [[167.5, 180.0]]]
    """
    size = boxes_px[:, 2:]
    shape = np.maximum(size, size[:, ::-1] * [_ASPECT, 1 / _ASPECT]) * PADDING
    centre = boxes_px[:, :2] + size / 2
    return centre - shape / 2, centre + shape / 2


def known_flags(people: Annotations) -> tuple[np.ndarray, np.ndarray]:
    """Which keypoints are known to be inside, and which to be outside.

    Parameters
    ----------
    people : Annotations
        With flags below 0 for points outside the picture.

    Returns
    -------
    inside, outside : array of bool, shape (n, 136)
    """
    inside, outside = people.visibility > 0, people.visibility < 0
    for i, extra in enumerate(people.extras):
        if PAD_KEY in extra:
            known = people.visibility[i, COCO_17] != 0
            beyond = np.array(extra[PAD_KEY], dtype=float) > PADDING
            inside[i, COCO_17], outside[i, COCO_17] = known & ~beyond, known & beyond
    return inside, outside


def extended_oks(
    people: Annotations, found: Detections, group: str = "body", cut: float = PRESENCE_CUT
) -> np.ndarray:
    """Extended OKS of all people of an image and all detections in it.

    Parameters
    ----------
    people : Annotations
        Of one image, with flags below 0 for points outside the picture.
    found : Detections
        In the same image; a keypoint that is not given is declared absent.
    group : {"body", "hand"}
        Of keypoints.
    cut : float, optional
        Least score of a keypoint that is declared present.

    Returns
    -------
    array, shape (n_people, n_detections)
        In [0, 1]. For people of whom nothing is known, by how far the detection leaves their window.
    """
    keypoints = GROUPS[group]
    inside, outside = (flags[:, None, keypoints] for flags in known_flags(people))
    truth_px, found_px = people.keypoints_px[:, None, keypoints], found.keypoints_px[None, :, keypoints]
    present = (found.scores[None, :, keypoints] >= cut) & np.isfinite(found_px).all(axis=-1)
    low, high = (corner[:, None, None] for corner in activation_windows(people.boxes_px))
    outside_px, present_px = outside[..., None], present[..., None]
    offset_px = np.where(
        present_px,
        np.where(outside_px, np.minimum(found_px - low, high - found_px), found_px - truth_px),
        np.where(outside_px, 0.0, np.minimum(truth_px - low, high - truth_px)),
    )
    counts = inside | outside
    unknown = ~counts.any(axis=-1, keepdims=True)
    leaves_px = np.maximum(low - found_px, 0) + np.maximum(found_px - high, 0)
    offset_px = np.where(unknown[..., None], leaves_px, offset_px)
    terms = oks_terms(np.zeros(2), offset_px, people.areas_px2[:, None], SIGMAS["halpe"][keypoints])
    counts = counts | unknown
    return np.where(counts, terms, 0.0).sum(axis=-1) / counts.sum(axis=-1)


def evaluate_extended(
    annotations: Annotations,
    detections: Mapping[int, Detections],
    group: str = "body",
    cut: float = PRESENCE_CUT,
) -> Evaluation:
    """Average precision and recall by extended OKS, on every annotated image.

    Parameters
    ----------
    annotations : Annotations
        The truth, with flags below 0 for points outside the picture.
    detections : mapping of int to Detections
        By image id.
    group : {"body", "hand"}
        Of keypoints.
    cut : float, optional
        Least score of a keypoint that is declared present.

    Returns
    -------
    Evaluation

    Raises
    ------
    InputError
        As `hicp_lib.evaluation.ap.evaluate.evaluate`.
    """
    plain = evaluate(annotations, detections, group)
    inside, outside = (flags[:, GROUPS[group]].any(axis=1) for flags in known_flags(annotations))
    counted = (inside | outside) & ~annotations.is_crowd
    rows_of = pd.Series(range(len(annotations))).groupby(annotations.image_ids).indices
    image_ids, n_people = np.array(sorted(annotations.images), dtype=np.int64), []
    image_rows, scores, right, wrong = [], [], [], []
    for image_row, image_id in enumerate(image_ids.tolist()):
        rows = rows_of.get(image_id, np.zeros(0, int))
        found = _best(detections.get(image_id, Detections.none()), GROUPS[group])
        people, counts = annotations.take(rows), counted[rows]
        matched = _match(extended_oks(people, found, group, cut), counts, people.is_crowd)
        n_people.append(counts.sum())
        image_rows.append(np.full(len(found), image_row))
        scores.append(found.person_scores)
        right.append((matched >= 0) & np.append(counts, False)[matched])
        wrong.append(matched < 0)
    order = np.argsort(-np.concatenate(scores), kind="stable")
    is_true, is_false = (np.concatenate(parts, axis=1)[:, order] for parts in (right, wrong))
    matches = cocoeval.Matches(
        image_ids, np.array(n_people), np.concatenate(image_rows)[order], is_true, is_false
    )
    precision, recall = cocoeval.precision_recall(matches)
    figures: dict[str, Any] = dict(cocoeval.metrics(precision, recall))
    n = int(counted.sum())
    return replace(
        plain, **figures, precision=precision, recall=recall, matches=matches, n_people=n,
        n_ignored=len(annotations) - n,
    )  # fmt: skip


def extended_rows(
    annotations: Annotations,
    detections: Mapping[int, Detections],
    group: str,
    seed: int,
    clusters: Clusters | None = None,
) -> dict[str, dict[str, float]]:
    """Figures by extended OKS with their 95 % intervals, where the annotations know of points outside.

    Parameters
    ----------
    annotations : Annotations
        The truth.
    detections : mapping of int to Detections
        By image id.
    group : {"body", "hand"}
        Of keypoints.
    seed : int
        Of the bootstrap.
    clusters : Clusters, optional
        As of `bootstrap.bootstrap_intervals`.

    Returns
    -------
    dict of str to dict of str to float
        "extended AP", ... to `value, low, high`; empty where no point is known to be outside.
    """
    if not known_flags(annotations)[1][:, GROUPS[group]].any():
        return {}
    evaluation = evaluate_extended(annotations, detections, group)
    table = bootstrap_intervals(evaluation, seed=seed, clusters=clusters)
    rows = table.set_index("extended " + table["metric"])[["value", "low", "high"]]
    return {str(name): row for name, row in rows.to_dict("index").items()}


def _best(found: Detections, keypoints: np.ndarray) -> Detections:
    """Those that give a keypoint of the group, the surest first, as many as take part."""
    given = np.isfinite(found.keypoints_px[:, keypoints]).all(axis=-1).any(axis=-1)
    order = np.argsort(-found.person_scores, kind="stable")
    rows = order[given[order]][: cocoeval.MAX_DETECTIONS]
    return Detections(found.keypoints_px[rows], found.scores[rows], found.person_scores[rows])


def _match(fit: np.ndarray, counts: np.ndarray, is_crowd: np.ndarray) -> np.ndarray:
    """COCO's matching in one image: row of each detection's person, -1 for none; (10, n_detections).

    The surest detection chooses first: whom it fits best of those who count and are free, of equal ones the
    last; only where there is nobody, of those who do not count.
    """
    matched = np.full((len(cocoeval.OKS_THRESHOLDS), fit.shape[1]), -1)
    for row, threshold in zip(matched, cocoeval.OKS_THRESHOLDS, strict=True):
        free = np.ones(len(fit), dtype=bool)
        for column in range(fit.shape[1]):
            fits = free & (fit[:, column] >= threshold)
            fits &= counts if (fits & counts).any() else True
            if fits.any():
                last = np.where(fits, fit[:, column], -1.0)[::-1].argmax()
                row[column] = len(fit) - 1 - last
                free[row[column]] = is_crowd[row[column]]
    return matched
