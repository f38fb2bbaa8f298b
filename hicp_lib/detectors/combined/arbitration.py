"""Assign hands to bodies: from many sightings to at most one left and one right hand per body.

Several runs of the hand model on parts of an image give the same hand more than once, other people's hands,
and hands where there are none. Three rules are applied, in this order:

1. *Duplicates.* Sightings whose roots are closer than a fraction of the hand's size are one hand; its points
   are the medians of theirs, and its scores reflect their number and agreement.
2. *Refusal.* A hand whose root is farther from a wrist than a fraction of the forearm does not belong to it.
   An arm without a wrist takes hands within reach of its elbow or, without an elbow, of its shoulder.
3. *Assignment.* Hands are assigned to arms so that the sum of distances, in forearms, is smallest. Left and
   right are those of the arm, not those of the hand model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.extras import needs
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.detectors.combined.hand_squares import HAND_POINTS, SEED_11, Arms, threshold

with needs("mediapipe"):
    from scipy.optimize import linear_sum_assignment

_REFUSED = 1e6  # beyond any distance of assignment; finite, as the solver needs it


@dataclass(frozen=True)
class ArbitrationRule:
    """Thresholds of the rules above; each field says in its metadata how it was chosen, and on what data.

    Attributes
    ----------
    same_hand : float
        Roots closer than this fraction of the smaller hand's size belong to one hand (size: from the root to
        the farthest point).
    wrist_reach, elbow_reach, shoulder_reach : float
        Farthest root from the arm's last given joint, in forearms.
    alone, scatter : float
        Weights of sightings, see `merge_duplicates`.
    """

    same_hand: float = threshold(0.5, f"{SEED_11}: 0.35 and 0.7 within .01")
    wrist_reach: float = threshold(1.0, f"{SEED_11}: 0.7 and 1.4 within .01")
    elbow_reach: float = threshold(1.5, f"{SEED_11}: 2 within .005, 1 within .01")
    shoulder_reach: float = threshold(2.5, f"{SEED_11}: 1.8 and 3.5 within .005")
    alone: float = threshold(0.85, f"{SEED_11}: 0.7 and 0.95 within .005")
    scatter: float = threshold(4.0, f"{SEED_11}: 2 and 8 within .006")


@dataclass(frozen=True)
class Hands:
    """Sightings of hands.

    Attributes
    ----------
    keypoints_px : array, shape (n, 21, 2)
        The root is always given, others may be NaN.
    scores : array, shape (n, 21)
    sides : array, shape (n,)
        According to the hand model: 0 left, 1 right.
    """

    keypoints_px: np.ndarray
    scores: np.ndarray
    sides: np.ndarray

    @classmethod
    def of(cls, found: Detections) -> Hands:
        """The hands in detections; those without a root are dropped."""
        rows, sides = np.nonzero(np.isfinite(found.keypoints_px[:, HAND_POINTS[:, 0]]).all(axis=-1))
        points = HAND_POINTS[sides]
        return cls(found.keypoints_px[rows[:, None], points], found.scores[rows[:, None], points], sides)

    @classmethod
    def concatenate(cls, parts: list[Hands]) -> Hands:
        """All sightings of several runs."""
        none = cls(np.zeros((0, 21, 2)), np.zeros((0, 21)), np.zeros(0, dtype=int))
        rows = [(part.keypoints_px, part.scores, part.sides) for part in [none, *parts]]
        return cls(*map(np.concatenate, zip(*rows, strict=True)))

    def take(self, rows: np.ndarray) -> Hands:
        """Some of the sightings."""
        return Hands(self.keypoints_px[rows], self.scores[rows], self.sides[rows])

    def __len__(self) -> int:
        return len(self.sides)


def merge_duplicates(hands: Hands, rule: ArbitrationRule) -> Hands:
    """Merge sightings of the same hand: the medians of their points, the side of the majority.

    A point's score is the median of the sightings' scores, times a factor for their agreement: 1 - `alone` /
    n for n sightings, times exp(-`scatter` d) for a mean distance d from the median, in sizes of the hand.
    """
    roots = hands.keypoints_px[:, 0]
    sizes = np.nanmax(np.linalg.norm(hands.keypoints_px - roots[:, None], axis=-1), axis=1, initial=0)
    apart = np.linalg.norm(roots[:, None] - roots[None], axis=-1)
    near = (apart < rule.same_hand * np.minimum.outer(sizes, sizes)) | np.eye(len(hands), dtype=bool)
    left = np.ones(len(hands), dtype=bool)
    merged = []
    while left.any():
        # Start with the hand with the most sightings around it; among equals the first one.
        centre = np.where(left, (near & left).sum(axis=1), 0).argmax()
        merged.append(_median(hands.take(near[centre] & left), rule))
        left &= ~near[centre]
    return Hands.concatenate(merged)


def _median(same: Hands, rule: ArbitrationRule) -> Hands:
    if len(same) == 1:  # always, if the image is looked at once: on a robot, in time
        return Hands(same.keypoints_px, same.scores * (1 - rule.alone), same.sides)
    given = np.isfinite(same.keypoints_px).all(axis=(0, 2))  # points that all sightings give
    points = np.where(given[:, None], np.median(same.keypoints_px, axis=0), same.keypoints_px[0])
    scores = np.where(given, np.median(same.scores, axis=0), same.scores[0])
    size_px = np.nanmax(np.linalg.norm(points - points[0], axis=-1))
    apart = np.linalg.norm(same.keypoints_px - points, axis=-1).mean(axis=0) / max(size_px, 1)
    agreement = (1 - rule.alone / len(same)) * np.exp(-rule.scatter * np.where(given, apart, 0))
    return Hands(points[None], (scores * agreement)[None], np.array([round(same.sides.mean() + 1e-9)]))


def distances(arms: Arms, hands: Hands, rule: ArbitrationRule) -> np.ndarray:
    """Distances of hands from the ends of arms, in forearms.

    Parameters
    ----------
    arms : Arms
    hands : Hands
    rule : ArbitrationRule

    Returns
    -------
    array, shape (n_bodies, 2, n_hands)
        inf where the hand is out of the arm's reach.
    """
    result = np.full((*arms.scales_px.shape, len(hands)), np.inf)
    joints = (
        (arms.shoulders_px, rule.shoulder_reach), (arms.elbows_px, rule.elbow_reach),
        (arms.wrists_px, rule.wrist_reach),
    )  # fmt: skip
    for positions_px, reach in joints:
        away = np.linalg.norm(positions_px[:, :, None] - hands.keypoints_px[:, 0], axis=-1)
        away = away / arms.scales_px[..., None]
        given = np.isfinite(positions_px).all(axis=-1) & np.isfinite(arms.scales_px)
        result = np.where(given[..., None], np.where(away < reach, away, np.inf), result)
    return result


def assign(away: np.ndarray) -> np.ndarray:
    """The hand of each arm, from distances (n_bodies, 2, n_hands): (n_bodies, 2), -1 for none.

    Examples
    --------
    >>> assign(np.array([[[0.2, 0.5], [0.1, np.inf]]])).tolist()
    [[1, 0]]
    """
    chosen = np.full(away.shape[:2], -1)
    costs = np.where(np.isfinite(away), away, _REFUSED).reshape(chosen.size, away.shape[2])
    rows, columns = linear_sum_assignment(costs)
    taken = costs[rows, columns] < _REFUSED
    chosen.flat[rows[taken]] = columns[taken]
    return chosen


def nearest_first(wrists_px: np.ndarray, hands: Hands, chosen: np.ndarray) -> np.ndarray:
    """Assignment without arbitration: each hand, highest score first, to the nearest free wrist.

    Parameters
    ----------
    wrists_px : array, shape (n_bodies, 2, 2)
        NaN where not given.
    hands : Hands
    chosen : array of int, shape (n_bodies, 2)
        The hands already assigned; -1 where an arm is free.

    Returns
    -------
    array of int, shape (n_bodies, 2)
    """
    chosen = chosen.copy()
    away = np.linalg.norm(wrists_px[:, :, None] - hands.keypoints_px[:, 0], axis=-1)
    away = np.where(np.isnan(away), np.inf, away)
    for hand in np.argsort(-hands.scores.mean(axis=1), kind="stable"):
        open_px = np.where(chosen < 0, away[:, :, hand], np.inf)
        if hand not in chosen and np.isfinite(open_px).any():
            chosen.flat[open_px.argmin()] = hand
    return chosen


def give_hands(bodies: Detections, hands: Hands, chosen: np.ndarray) -> Detections:
    """Bodies with their chosen hands; an arm without one keeps the hand from the body detector.

    Parameters
    ----------
    bodies : Detections
        n people.
    hands : Hands
    chosen : array of int, shape (n, 2)
        -1 for none.
    """
    keypoints_px, scores = bodies.keypoints_px.copy(), bodies.scores.copy()
    for body, side in np.argwhere(chosen >= 0):
        hand = chosen[body, side]
        keypoints_px[body, HAND_POINTS[side]] = hands.keypoints_px[hand]
        scores[body, HAND_POINTS[side]] = hands.scores[hand]
    return Detections(keypoints_px, scores, bodies.person_scores)


def in_pairs(hands: Hands) -> Detections:
    """Instances of the k-th best left with the k-th best right hand, by the model's labels."""
    return _instances(hands, *_by_side(hands))


def without_body(hands: Hands) -> Detections:
    """Instances of hands that belong to no detected body: the k-th best left with the k-th best right.

    Sides are the model's labels, as nothing better is known; but of two hands with the same side, the one
    with the lower score gets the other side, since nobody has two left hands.
    """
    lefts, rights = _by_side(hands)
    more, fewer = (lefts, rights) if len(lefts) > len(rights) else (rights, lefts)
    while len(more) > len(fewer) + 1:
        fewer.append(more.pop())
    return _instances(hands, lefts, rights)


def _by_side(hands: Hands) -> tuple[list[int], list[int]]:
    """Rows of the left and of the right hands, highest score first."""
    order = np.argsort(-hands.scores.mean(axis=1), kind="stable").tolist()
    return [row for row in order if hands.sides[row] == 0], [row for row in order if hands.sides[row] == 1]


def _instances(hands: Hands, lefts: list[int], rights: list[int]) -> Detections:
    """People without a body: the k-th left paired with the k-th right hand, where both exist."""
    chosen = np.full((max(len(lefts), len(rights)), 2), -1)
    chosen[: len(lefts), 0], chosen[: len(rights), 1] = lefts, rights
    n = len(chosen)
    nobody = Detections(np.full((n, N_KEYPOINTS, 2), np.nan), np.zeros((n, N_KEYPOINTS)), np.zeros(n))
    found = give_hands(nobody, hands, chosen)
    given = found.scores[:, HAND_POINTS.ravel()] > 0
    person_scores = found.scores.sum(axis=1) / np.maximum(given.sum(axis=1), 1)
    return Detections(found.keypoints_px, found.scores, person_scores)
