"""Kinds of localisation error, after Ronchi and Perona ("Benchmarking and error diagnosis in multi-instance
pose estimation", ICCV 2017).

The similarity of a keypoint to a place is its term of OKS. A keypoint of a detection matched to a person is

- *good* when its similarity to the truth is at least .85,
- *jitter* when it is at least .5,
- an *inversion* when, otherwise, it is similar (at least .5) to the same person's keypoint of the other side,
- a *swap* when it is similar to that keypoint, or the other side's, of somebody else in the image,
- a *miss* when it is similar to none of these.

Where an inversion and a swap are both possible the more similar one counts. The paper judges keypoints of
detections; here every labelled keypoint of a person who counts has a row, so two more kinds tell of those
there is nothing to judge: *not given* by a detection that matches the person, and *not found* when no
detection does (an OKS of .1 is asked for, as in the paper).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import GROUPS, SIGMAS, mirror
from hicp_lib.core.oks import oks, oks_terms
from hicp_lib.datasets.visibility import MIN_PEOPLE
from hicp_lib.evaluation.ap.evaluate import check_detections
from hicp_lib.evaluation.ap.metric_table import groups_of
from hicp_lib.formats.annotations import Annotations, source_images

KINDS = ("good", "jitter", "inversion", "swap", "miss", "not given", "not found")
HITS = ("good", "jitter")
GOOD_TERM, NEAR_TERM, MATCH_OKS = 0.85, 0.5, 0.1
_OTHER_SIDE = mirror("halpe136")


def all_errors(
    truth: Mapping[str, Annotations], found: Mapping[tuple[str, str], Mapping[int, Detections]]
) -> pd.DataFrame:
    """`keypoint_errors` of every case: columns `subset, detector, group, source_image` and its own."""
    tables = []
    for subset, detector in found:
        sources = source_images(truth[subset])
        for group in groups_of(found, detector):
            table = keypoint_errors(truth[subset], found[subset, detector], group)
            labels = {"subset": subset, "detector": detector, "group": group}
            table = table.assign(**labels, source_image=table["image_id"].map(sources))
            tables.append(table)
    order = ["subset", "detector", "group", "source_image"]
    return pd.concat(tables, ignore_index=True)[[*order, *tables[0].columns.drop(order)]]


def keypoint_errors(
    annotations: Annotations, detections: Mapping[int, Detections], group: str = "body", sigmas: str = "halpe"
) -> pd.DataFrame:
    """What became of every labelled keypoint of the people who count.

    Returns
    -------
    DataFrame, columns `image_id, annotation_id, keypoint` (Halpe index), `visibility`, `score` (NaN where
    there is none), `term` (of OKS, 0 where there is none), `kind` (categorical, `KINDS`), `hit` (bool:
    good or jitter)

    Raises
    ------
    InputError
        As `hicp_lib.evaluation.ap.evaluate.evaluate`.
    """
    check_detections(dict(detections), annotations)
    keypoints, constants = GROUPS[group], SIGMAS[sigmas][GROUPS[group]]
    parts = []
    rows_of = pd.Series(range(len(annotations))).groupby(annotations.image_ids).indices
    for image_id, rows in rows_of.items():
        people = annotations.take(rows)
        found = detections.get(image_id, Detections.none())
        matched = matched_people(people, found, keypoints, constants)
        for person in np.flatnonzero(_counts(people)):
            row = matched.get(int(person))
            match = (
                None if row is None else (found.keypoints_px[row, keypoints], found.scores[row, keypoints])
            )
            parts.append(_judge(people, person, match, keypoints, constants))
    columns = ["image_id", "annotation_id", "keypoint", "visibility", "score", "term", "kind"]
    table = pd.concat([pd.DataFrame(columns=columns).astype(_DTYPES), *parts], ignore_index=True)
    kind = pd.Categorical.from_codes(table["kind"], KINDS)
    return table.assign(kind=kind, hit=np.isin(table["kind"], [KINDS.index(name) for name in HITS]))


_DTYPES = {"image_id": int, "annotation_id": int, "keypoint": int, "visibility": float, "score": float,
           "term": float, "kind": int}  # fmt: skip


def _counts(people: Annotations) -> np.ndarray:
    return ~people.is_crowd & ~np.array([bool(extra.get("other")) for extra in people.extras], dtype=bool)


def matched_people(
    people: Annotations, found: Detections, keypoints: np.ndarray, sigmas: np.ndarray
) -> dict[int, int]:
    """The detection of each person who has one: row of the person -> row of the detection.

    Detections, best first, take the free person they fit best, with an OKS of at least .1. People without a
    labelled keypoint take no part: anything near them would fit.

    Parameters
    ----------
    people, found : of one image
    keypoints, sigmas : arrays, shape (k,): Halpe indices of the group, and their constants
    """
    labelled = people.visibility[:, keypoints] > 0
    fit = oks(
        people.keypoints_px[:, None, keypoints],
        labelled[:, None],
        people.boxes_px[:, None],
        people.areas_px2[:, None],
        found.keypoints_px[None, :, keypoints],
        sigmas,
    )
    fit[~labelled.any(axis=1)] = 0.0
    matched: dict[int, int] = {}
    for row in np.argsort(-found.person_scores, kind="stable"):
        person = int(fit[:, row].argmax()) if len(people) else 0
        if len(people) and fit[person, row] >= MATCH_OKS:
            matched[person] = int(row)
            fit[person] = 0.0
    return matched


def _judge(
    people: Annotations, person: int, match: tuple | None, keypoints: np.ndarray, sigmas: np.ndarray
) -> pd.DataFrame:
    labelled = people.visibility[person, keypoints] > 0
    n = int(labelled.sum())
    score, term, kind = np.full(n, np.nan), np.zeros(n), np.full(n, KINDS.index("not found"))
    if match is not None:
        points, scores = match[0][labelled], match[1][labelled]
        given = np.isfinite(points).all(axis=-1)
        terms = np.stack(list(_similarities(people, person, points, keypoints[labelled], sigmas[labelled])))
        term, score = terms[0], np.where(given, scores, np.nan)
        kind = np.where(given, _kinds(*terms), KINDS.index("not given"))
    return pd.DataFrame(
        {
            "image_id": int(people.image_ids[person]), "annotation_id": int(people.ids[person]),
            "keypoint": keypoints[labelled], "visibility": people.visibility[person, keypoints[labelled]],
            "score": score, "term": term, "kind": kind,
        }
    )  # fmt: skip


def _similarities(
    people: Annotations, person: int, points: np.ndarray, keypoints: np.ndarray, sigmas: np.ndarray
) -> Iterator[np.ndarray]:
    """Similarity (k,) of points to the truth, to its other side, and to either of anybody else."""
    other_side = _OTHER_SIDE[keypoints]
    sides = np.where((other_side != keypoints)[:, None], people.keypoints_px[:, other_side], np.nan)
    terms = [
        oks_terms(places, points, people.areas_px2, sigmas)
        for places in (people.keypoints_px[:, keypoints], sides)
    ]
    yield from (term[person] for term in terms)
    others = np.arange(len(people)) != person
    yield np.maximum(*terms)[others].max(axis=0, initial=0.0)


def _kinds(truth: np.ndarray, other_side: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Indices into `KINDS` by similarities (k,)."""
    near = [truth >= GOOD_TERM, truth >= NEAR_TERM]
    confused = [(other_side >= NEAR_TERM) & (other_side >= others), others >= NEAR_TERM]
    return np.select([*near, *confused], range(4), KINDS.index("miss"))


def kind_shares(errors: pd.DataFrame, by: str) -> pd.DataFrame:
    """Share of each kind, every one listed; NaN where there are fewer than `MIN_PEOPLE` people.

    Returns
    -------
    DataFrame, columns `detector, group, BY, kind, share, n_keypoints, n_people`

    Raises
    ------
    InputError
        If the errors have no column of that name.
    """
    if by not in errors:
        raise InputError(f"kinds of error by {by!r}: expected one of {', '.join(errors.columns)}")
    keys = ["detector", "group", by]
    counts = errors.groupby([*keys, "kind"], sort=False, observed=True).size().unstack("kind", fill_value=0)
    counts = counts.reindex(columns=KINDS, fill_value=0)
    people = errors.drop_duplicates({*keys, "subset", "image_id", "annotation_id"})
    n_people = people.groupby(keys, sort=False, observed=True).size().reindex(counts.index)
    shares = counts.div(counts.sum(axis=1), axis=0).where(n_people >= MIN_PEOPLE, np.nan, axis=0)
    n = pd.DataFrame({"n_keypoints": counts.sum(axis=1), "n_people": n_people}).reset_index()
    long = shares.reset_index().melt(keys, var_name="kind", value_name="share")
    return long.merge(n, on=keys)
