"""Keypoints that are right: found ones whose truth is known, and whether they hit it.

A keypoint is a *hit* when its term of OKS is at least `HIT_TERM`, if nothing else is said (see `oks`).
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import GROUPS, SIGMAS
from hicp_lib.core.oks import oks, oks_terms
from hicp_lib.evaluation.ap.evaluate import check_detections
from hicp_lib.formats.annotations import Annotations

HIT_TERM = 0.5


def all_hits(
    truth: Mapping[str, Annotations],
    found: Mapping[tuple[str, str], Mapping[int, Detections]],
    groups: Mapping[str, tuple[str, ...]],
    sources: Mapping[str, Mapping[int, Hashable]],
    min_term: float = HIT_TERM,
) -> pd.DataFrame:
    """`keypoint_hits` of every case: columns `subset, detector, group, source_image` and its own.

    Parameters
    ----------
    truth : subset -> annotations
    found : (subset, detector) -> detections by image id
    groups : detector -> its groups of keypoints
    sources : subset -> image id -> source image
    min_term : a hit's least term of OKS
    """
    tables = []
    for subset, detector in found:
        for group in groups[detector]:
            table = keypoint_hits(truth[subset], found[subset, detector], group, min_term=min_term)
            labels = {"subset": subset, "detector": detector, "group": group}
            source = table["image_id"].map(sources[subset])
            tables.append(
                table.assign(**labels, source_image=source)[[*labels, "source_image", *table.columns]]
            )
    return pd.concat(tables, ignore_index=True)


def keypoint_hits(
    annotations: Annotations,
    detections: Mapping[int, Detections],
    group: str = "body",
    sigmas: str = "halpe",
    min_term: float = HIT_TERM,
) -> pd.DataFrame:
    """Which found keypoints are hits, for those whose truth is known.

    Detections, best first, take the free annotated person they fit best by OKS. Keypoints without a label
    there have no truth and are left out, and so are detections of people who do not count (crowds,
    others, nobody labelled). A detection that fits nobody at all is wrong with every keypoint.

    Returns
    -------
    DataFrame, columns `image_id, keypoint` (Halpe index), `score, hit` (bool)

    Raises
    ------
    InputError
        As `hicp_lib.evaluation.ap.evaluate.evaluate`.
    """
    check_detections(dict(detections), annotations)
    keypoints = GROUPS[group]
    constants = SIGMAS[sigmas][keypoints]
    columns: dict[str, list] = {"image_id": [], "keypoint": [], "score": [], "hit": []}
    for image_id, found in detections.items():
        people = annotations.take(annotations.image_ids == image_id)
        for row, person in _pairs(people, found, keypoints, constants):
            points_px = found.keypoints_px[row, keypoints]
            known, terms = _terms(people, person, points_px, keypoints, constants)
            columns["image_id"] += [image_id] * int(known.sum())
            columns["keypoint"] += keypoints[known].tolist()
            columns["score"] += found.scores[row, keypoints[known]].tolist()
            columns["hit"] += (terms[known] >= min_term).tolist()
    return pd.DataFrame(columns).astype({"image_id": int, "keypoint": int, "score": float, "hit": bool})


def _pairs(
    people: Annotations, found: Detections, keypoints: np.ndarray, sigmas: np.ndarray
) -> Iterator[tuple[int, int | None]]:
    """Rows of detections with the row of their person; None for those that fit nobody."""
    points = found.keypoints_px[:, keypoints]
    labelled = people.visibility[:, keypoints] > 0
    fit = oks(
        people.keypoints_px[:, None, keypoints], labelled[:, None], people.boxes_px[:, None],
        people.areas_px2[:, None], points[None], sigmas,
    )  # fmt: skip
    free = np.ones(len(people), dtype=bool)
    given = np.isfinite(points).all(axis=-1).any(axis=-1)
    for row in np.argsort(-found.person_scores, kind="stable"):
        if given[row]:
            fits = np.where(free, fit[:, row], 0.0)
            person = int(fits.argmax()) if fits.max(initial=0.0) > 0 else None
            if person is not None:
                free[person] = False
            yield int(row), person


def _terms(
    people: Annotations, person: int | None, points: np.ndarray, keypoints: np.ndarray, sigmas: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Which keypoints (k,) of a detection have a known truth, and their terms of OKS."""
    given = np.isfinite(points).all(axis=-1)
    if person is None:
        return given, np.zeros(len(points))
    labelled = (people.visibility[person, keypoints] > 0) & (not _is_ignored(people, person))
    terms = oks_terms(people.keypoints_px[person, keypoints], points, people.areas_px2[person], sigmas)
    return given & labelled, terms


def _is_ignored(people: Annotations, person: int) -> bool:
    return bool(people.is_crowd[person] or people.extras[person].get("other"))
