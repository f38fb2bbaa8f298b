"""COCO's keypoint evaluation on arrays: matching of detections to people, precision and recall.

The rules are pycocotools', and so are the numbers (`tests/evaluation/ap/test_cocoeval.py`). There is no
Python object per person: the best detections of all images are matched at once, then the second-best ones,
and so on.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

OKS_THRESHOLDS = np.linspace(0.5, 0.95, 10)
RECALLS = np.linspace(0.0, 1.0, 101)
METRICS = ("AP", "AP50", "AP75", "AR", "AR50", "AR75")
MAX_DETECTIONS = 20
_AT_75 = 5  # index into `OKS_THRESHOLDS`
_BLOCK = 2**9  # pairs whose similarity is computed at a time, to stay in the processor's cache

# Rows of people (n, m) and of detections (n,) -> similarity of each detection and its m people (n, m).
Similarity = Callable[[np.ndarray, np.ndarray], np.ndarray]


class People(NamedTuple):
    """n annotated people (or hands, ...): a detection can be matched only to those in its slot.

    `slots` (n,) of int; `counts` (n,) of bool: people who do not count are matched only if no other is
    available, and that detection is ignored; `is_crowd` (n,) of bool: crowds can match any number of
    detections.
    """

    slots: np.ndarray
    counts: np.ndarray
    is_crowd: np.ndarray


class Found(NamedTuple):
    """n detections: `slots` (n,) of int, finite `scores` (n,)."""

    slots: np.ndarray
    scores: np.ndarray


@dataclass(frozen=True)
class Matches:
    """Which detections are correct, sorted by decreasing score: all that AP and AR depend on.

    Attributes
    ----------
    image_ids, n_people : array of int, shape (n_images,)
        The images, and the number of evaluated people in each.
    image_rows : array of int, shape (n_detections,)
        The detections' rows in `image_ids`.
    is_true, is_false : array of bool, shape (10, n_detections)
        Per OKS threshold; both False if ignored.
    """

    image_ids: np.ndarray
    n_people: np.ndarray
    image_rows: np.ndarray
    is_true: np.ndarray
    is_false: np.ndarray


def match(
    image_ids: np.ndarray, people: People, found: Found, similarity: Similarity, per_image: int = 1
) -> Matches:
    """Match detections to people, the highest score of each slot first.

    Parameters
    ----------
    image_ids : array of int, shape (n_images,)
        All images, ascending.
    people : People
        The annotated people.
    found : Found
        The detections; the 20 best of a slot are used.
    similarity : callable
        OKS or a replacement.
    per_image : int, optional
        Number of slots of an image; those of the first image come first.

    Returns
    -------
    Matches
    """
    kept, rank = _ranked(found)
    by_slot = np.argsort(people.slots, kind="stable")
    taken = np.zeros((len(OKS_THRESHOLDS), len(by_slot)), dtype=bool)
    matched = np.full((len(OKS_THRESHOLDS), len(kept)), -1)
    for rows, sorted_people in _rivals(people.slots[by_slot], found.slots[kept], rank):
        who = by_slot[sorted_people]
        fits = similarity(who, kept[rows])
        chosen = _chosen(fits, ~taken[:, who] | people.is_crowd[who], people.counts[who])
        at, row = np.nonzero(chosen >= 0)
        matched[at, rows[row]] = person = who[row, chosen[at, row]]
        taken[at, person] = True
    order = np.argsort(-found.scores[kept], kind="stable")
    matched = matched[:, order]
    n_people = np.bincount(people.slots[people.counts] // per_image, minlength=len(image_ids))
    is_true = (matched >= 0) & np.append(people.counts, False)[matched]
    return Matches(image_ids, n_people, found.slots[kept][order] // per_image, is_true, matched < 0)


def _ranked(found: Found) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the best detections of each slot, slot by slot, and each one's place among them."""
    order = np.lexsort((-found.scores, found.slots))
    slots = found.slots[order]
    rank = np.arange(len(slots)) - np.searchsorted(slots, slots)
    best = rank < MAX_DETECTIONS
    return order[best], rank[best]


def _rivals(
    people_slots: np.ndarray, found_slots: np.ndarray, rank: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Rows of detections of one rank, the best first, and of the people in the slot of each."""
    first = np.searchsorted(people_slots, found_slots)
    n = np.searchsorted(people_slots, found_slots, side="right") - first
    for at_rank, n_people in sorted(set(zip(rank.tolist(), n.tolist(), strict=True))):
        places = np.flatnonzero((rank == at_rank) & (n == n_people))
        size = max(1, _BLOCK // max(1, n_people))
        for part in np.split(places, range(size, len(places), size)) if n_people else ():
            yield part, first[part, None] + np.arange(n_people)


def _chosen(fits: np.ndarray, free: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """The people to whom detections are matched, -1 for none; shape (10, n_detections).

    A detection takes the most similar person (of equal ones the last) among the free ones above the threshold
    who count; only if there is none, among those who do not count.

    Parameters
    ----------
    fits : array, shape (n_detections, n_people)
        OKS.
    free : array of bool, shape (10, n_detections, n_people)
    counted : array of bool, shape (n_detections, n_people)
    """
    near = free & (fits >= OKS_THRESHOLDS[:, None, None])
    near &= counted | ~(near & counted).any(axis=-1, keepdims=True)
    last = np.where(near, fits, -1.0)[..., ::-1].argmax(axis=-1)
    return np.where(near.any(axis=-1), fits.shape[1] - 1 - last, -1)


def precision_recall(matches: Matches, weights: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """COCO's interpolated precision and final recall, with a weight per image.

    With all weights 1 this equals pycocotools to the bit.

    Parameters
    ----------
    matches : Matches
        Which detections are correct.
    weights : array of int, shape (..., n_images), optional
        How often each image occurs; once by default.

    Returns
    -------
    precision : array, shape (..., 10, 101)
        NaN without evaluated people.
    recall : array, shape (..., 10)
        NaN without evaluated people.
    """
    weights = np.ones(len(matches.image_ids), dtype=int) if weights is None else weights
    draws = weights.reshape(int(np.prod(weights.shape[:-1])), -1)  # also without images
    n_people = draws @ matches.n_people
    precision = np.zeros((len(draws), len(OKS_THRESHOLDS), len(RECALLS)))
    recall = np.zeros(precision.shape[:2])
    times, counted, seen = draws[:, matches.image_rows], None, None
    for t, (is_true, is_false) in enumerate(zip(matches.is_true, matches.is_false, strict=True)):
        if seen is None or (counted != is_true | is_false).any():
            counted = is_true | is_false
            seen = np.cumsum(times * counted, axis=1)
        # Precision and recall rise only at correct detections.
        rows = np.flatnonzero(is_true)
        true = np.cumsum(times.take(rows, axis=1), axis=1)
        reached = true / np.maximum(n_people, 1)[:, None]
        share = true / (seen.take(rows, axis=1) + np.spacing(1))
        rising = np.maximum.accumulate(share[:, ::-1], axis=1)[:, ::-1]
        for of_draw, r, envelope in zip(precision[:, t], reached, rising, strict=True):
            at = r.searchsorted(RECALLS)
            n = at.searchsorted(len(r))  # past the last: precision 0
            of_draw[:n] = envelope[at[:n]]
        recall[:, t] = reached[:, -1] if reached.shape[1] else 0.0
    precision[n_people == 0], recall[n_people == 0] = np.nan, np.nan
    shape = weights.shape[:-1]
    return precision.reshape(*shape, *precision.shape[1:]), recall.reshape(*shape, -1)


def metrics(precision: np.ndarray, recall: np.ndarray) -> dict[str, np.ndarray]:
    """AP, AP50, AP75, AR, AR50, AR75 from precision (..., 10, 101) and recall (..., 10).

    Examples
    --------
    >>> float(metrics(np.full((10, 101), 0.5), np.linspace(1.0, 0.1, 10))["AR75"])
    0.5
    """
    of_precision = precision.mean(axis=(-2, -1)), *(precision[..., t, :].mean(axis=-1) for t in (0, _AT_75))
    of_recall = recall.mean(axis=-1), recall[..., 0], recall[..., _AT_75]
    return dict(zip(METRICS, (*of_precision, *of_recall), strict=True))
