"""Hits: whether detected keypoints with known truth are correct.

A keypoint is a *hit* when its term of OKS is at least `HIT_TERM`, or another given value (see `oks`).
"""

from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import GROUPS, SIGMAS
from hicp_lib.core.oks import oks_terms
from hicp_lib.evaluation.ap.evaluate import check_detections
from hicp_lib.evaluation.cases import Found, Truth, per_case
from hicp_lib.evaluation.matching import match_best_first, pairwise_oks
from hicp_lib.formats.annotations import Annotations

HIT_TERM = 0.5
_ANY_OKS = float(np.nextafter(0.0, 1.0))  # the smallest number above 0


def all_hits(
    truth: Truth, found: Found, groups: Mapping[str, tuple[str, ...]], min_term: float = HIT_TERM
) -> pd.DataFrame:
    """`keypoint_hits` of every case.

    Parameters
    ----------
    truth : Truth
        By subset.
    found : Found
        By image id, of every subset and detector.
    groups : mapping of str to tuple of str
        The groups of keypoints of each detector to include.
    min_term : float, optional
        A hit's minimum term of OKS.

    Returns
    -------
    DataFrame
        Columns `subset, detector, group, source_image` and those of `keypoint_hits`.
    """
    return per_case(partial(keypoint_hits, min_term=min_term), truth, found, groups)


def keypoint_hits(
    annotations: Annotations,
    detections: Mapping[int, Detections],
    group: str = "body",
    min_term: float = HIT_TERM,
) -> pd.DataFrame:
    """Which detected keypoints are hits, for those with known truth.

    Detections, best first, are matched to the free annotated person with the highest OKS. Keypoints without a
    label have no known truth and are left out, and so are detections of people who are not evaluated (crowds,
    others, people without labels). All keypoints of an unmatched detection are wrong.

    Parameters
    ----------
    annotations : Annotations
        The truth.
    detections : mapping of int to Detections
        By image id.
    group : {"body", "hand"}
        Of keypoints.
    min_term : float, optional
        A hit's minimum term of OKS.

    Returns
    -------
    DataFrame
        Columns `image_id, keypoint` (Halpe index), `score, hit` (bool).

    Raises
    ------
    InputError
        As `hicp_lib.evaluation.ap.evaluate.evaluate`.
    """
    check_detections(detections, annotations)
    keypoints, sigmas = GROUPS[group], SIGMAS["halpe"][GROUPS[group]]
    rows: list[tuple] = []
    for image_id, found in detections.items():
        people = annotations.take(annotations.image_ids == image_id)
        for row, known, terms in _judged(people, found, keypoints, sigmas):
            at = keypoints[known]
            columns = (at.tolist(), found.scores[row, at].tolist(), (terms[known] >= min_term).tolist())
            rows += [(image_id, *values) for values in zip(*columns, strict=True)]
    types = {"image_id": int, "keypoint": int, "score": float, "hit": bool}
    return pd.DataFrame(rows, columns=list(types)).astype(types)


def _judged(
    people: Annotations, found: Detections, keypoints: np.ndarray, sigmas: np.ndarray
) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Detections that give a keypoint: row, which keypoints (k,) have a known truth, their terms of OKS."""
    points_px = found.keypoints_px[:, keypoints]
    given = np.isfinite(points_px).all(axis=-1)
    fit = np.where(given.any(axis=1), pairwise_oks(people, found, keypoints, sigmas), 0.0)
    matched = match_best_first(fit, found.person_scores, _ANY_OKS)
    person_of = {row: person for person, row in matched.items()}
    counts = ~people.is_crowd & ~people.is_other
    for row in np.argsort(-found.person_scores, kind="stable"):
        person = person_of.get(int(row))
        if person is None:
            known, terms = given[row], np.zeros(len(keypoints))
        else:
            truth_px, area_px2 = people.keypoints_px[person, keypoints], people.areas_px2[person]
            known = given[row] & (people.visibility[person, keypoints] > 0) & counts[person]
            terms = oks_terms(points_px[row] - truth_px, area_px2, sigmas)
        yield int(row), known, terms
