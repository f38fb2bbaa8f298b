"""Kinds of localisation error, after Ronchi and Perona ("Benchmarking and error diagnosis in multi-instance
pose estimation", ICCV 2017).

The similarity of a keypoint to a position is its term of OKS. A keypoint of a detection matched to a person
is

- *good* when its similarity to the truth is at least .85,
- *jitter* when it is at least .5,
- otherwise an *inversion* when it is similar (at least .5) to the same person's keypoint of the other side,
- a *swap* when it is similar to that keypoint, or the other side's, of another person in the image,
- a *miss* when it is similar to none of these.

If an inversion and a swap are both possible, the more similar one is chosen. The paper classifies keypoints
of detections; here every labelled keypoint of an evaluated person has a row, so there are two more kinds:
*not given* by a detection that matches the person, and *not found* when no detection does (with an OKS of .1
or more, as in the paper).
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import GROUPS, SIGMAS, mirror
from hicp_lib.core.oks import oks_terms
from hicp_lib.datasets.visibility import MIN_PEOPLE
from hicp_lib.evaluation.ap.evaluate import check_detections
from hicp_lib.evaluation.cases import Found, Truth, per_case
from hicp_lib.evaluation.matching import matched_people
from hicp_lib.formats.annotations import Annotations, rows_by_image

KINDS = ("good", "jitter", "inversion", "swap", "miss", "not given", "not found")
HITS = ("good", "jitter")
GOOD_TERM, NEAR_TERM = 0.85, 0.5
_OTHER_SIDE = mirror("halpe136")


def all_errors(truth: Truth, found: Found) -> pd.DataFrame:
    """`keypoint_errors` of every case: columns `subset, detector, group, source_image` and its own."""
    return per_case(keypoint_errors, truth, found)


def keypoint_errors(
    annotations: Annotations, detections: Mapping[int, Detections], group: str = "body"
) -> pd.DataFrame:
    """The kind of error of every labelled keypoint of the evaluated people.

    Parameters
    ----------
    annotations : Annotations
        The truth.
    detections : mapping of int to Detections
        By image id.
    group : {"body", "hand"}
        Of keypoints.

    Returns
    -------
    DataFrame
        Columns `image_id, annotation_id, keypoint` (Halpe index), `visibility`, `score` (NaN if missing),
        `term` (of OKS, 0 if missing), `kind` (categorical, `KINDS`), `hit` (bool: good or jitter).

    Raises
    ------
    InputError
        As `hicp_lib.evaluation.ap.evaluate.evaluate`.
    """
    check_detections(detections, annotations)
    keypoints, constants = GROUPS[group], SIGMAS["halpe"][GROUPS[group]]
    parts = [pd.DataFrame(columns=list(_DTYPES)).astype(_DTYPES)]
    for image_id, rows in rows_by_image(annotations.image_ids).items():
        people = annotations.take(rows)
        found = detections.get(image_id, Detections.none())
        matched = matched_people(people, found, keypoints, constants)
        for person in np.flatnonzero(~people.is_crowd & ~people.is_other).tolist():
            parts.append(_judge(people, person, found, matched.get(person), keypoints, constants))
    table = pd.concat(parts, ignore_index=True)
    return table.assign(kind=pd.Categorical(table["kind"], KINDS), hit=table["kind"].isin(HITS))


_DTYPES = {"image_id": int, "annotation_id": int, "keypoint": int, "visibility": float, "score": float,
           "term": float, "kind": object}  # fmt: skip


def _judge(
    people: Annotations, person: int, found: Detections, row: int | None, keypoints: np.ndarray,
    sigmas: np.ndarray,
) -> pd.DataFrame:  # fmt: skip
    """Classify a person's labelled keypoints in detection `row`."""
    labelled = people.visibility[person, keypoints] > 0
    at, other_side = keypoints[labelled], _OTHER_SIDE[keypoints[labelled]]
    points_px, scores = np.full((len(at), 2), np.nan), np.full(len(at), np.nan)
    if row is not None:
        points_px, scores = found.keypoints_px[row, at], found.scores[row, at]
    given = np.isfinite(points_px).all(axis=-1)
    sides_px = np.where((other_side != at)[:, None], people.keypoints_px[:, other_side], np.nan)
    places_px = people.keypoints_px[:, at], sides_px
    # Similarity (n, k) to all people's own points, and to those of their other side.
    own, other = (oks_terms(points_px - of, people.areas_px2, sigmas[labelled]) for of in places_px)
    others = np.maximum(own, other)[np.arange(len(people)) != person].max(axis=0, initial=0.0)
    term, is_inverted = own[person], (other[person] >= NEAR_TERM) & (other[person] >= others)
    cases = [~given, term >= GOOD_TERM, term >= NEAR_TERM, is_inverted, others >= NEAR_TERM]
    missing = "not found" if row is None else "not given"
    kind = np.select(cases, [missing, *KINDS[:4]], "miss")
    columns = {"keypoint": at, "visibility": people.visibility[person, at]}
    columns |= {"score": np.where(given, scores, np.nan), "term": term, "kind": kind.astype(object)}
    ids = {"image_id": int(people.image_ids[person]), "annotation_id": int(people.ids[person])}
    return pd.DataFrame(ids | columns)


def kind_proportions(errors: pd.DataFrame, by: str) -> pd.DataFrame:
    """Proportion of every kind; NaN with fewer than `MIN_PEOPLE` people.

    Parameters
    ----------
    errors : DataFrame
        `all_errors`, with the column `by`.
    by : str
        Column to group by, in addition to detector and group of keypoints.

    Returns
    -------
    DataFrame
        Columns `detector, group, BY, kind, share, n_keypoints, n_people`.

    Raises
    ------
    InputError
        If the errors have no such column.
    """
    if by not in errors:
        raise InputError(f"kinds of error by {by!r}: expected one of {', '.join(errors.columns)}")
    keys = ["detector", "group", by]
    counts = errors.groupby([*keys, "kind"], sort=False, observed=True).size().unstack("kind", fill_value=0)
    counts = counts.reindex(columns=KINDS, fill_value=0)
    people = errors.drop_duplicates({*keys, "subset", "image_id", "annotation_id"})
    n_people = people.groupby(keys, sort=False, observed=True).size().reindex(counts.index)
    n = pd.DataFrame({"n_keypoints": counts.sum(axis=1), "n_people": n_people})
    share = counts.div(n["n_keypoints"], axis=0).where(n_people >= MIN_PEOPLE, np.nan, axis=0)
    long = share.reset_index().melt(keys, var_name="kind", value_name="share")
    return long.merge(n.reset_index(), on=keys)
