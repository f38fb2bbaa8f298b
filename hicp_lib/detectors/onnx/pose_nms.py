"""Pose non-maximum suppression: what top-down programs do when several boxes contain the same person.

MMPose keeps the better of two poses whose OKS is above a limit. AlphaPose compares poses by a parametric
distance and merges those that it considers the same (Fang et al., "RMPE", ICCV 2017; the variant for whole
bodies and the constants are those of its released program).
"""

from dataclasses import dataclass

import numpy as np

from hicp_lib.core.oks import oks_terms

_N_BODY, _N_FACE, _N_HANDS = 26, 68, 42
_FACE_FACTOR, _HAND_FACTOR = 1.9, 0.55
_HAND_AGREEMENT, _HAND_NEARNESS = 0.1, 1.5  # weights in the similarity of whole bodies
# Points as near as these coincide, are merged, agree in their scores.
_COINCIDENT_PX, _MERGED_PX, _AGREEING_PX = 7.0, 15.0, 1.0


def oks_nms(
    positions_px: np.ndarray,
    person_scores: np.ndarray,
    areas_px2: np.ndarray,
    sigmas: np.ndarray,
    max_oks: float = 0.9,
) -> np.ndarray:
    """Rows to keep, by decreasing score: poses whose OKS with every better one is at most `max_oks`.

    Parameters
    ----------
    positions_px : array, shape (n, k, 2)
        A NaN point matches nothing.
    person_scores, areas_px2 : array, shape (n,)
    sigmas : array, shape (k,)
    max_oks : float

    Returns
    -------
    array of int, shape (m,)

    Examples
    --------
    >>> pose_px = np.array([[0.0, 0.0], [50.0, 100.0]])
    >>> poses_px = np.stack([pose_px, pose_px + 1, pose_px + 200])
    >>> oks_nms(poses_px, np.array([0.5, 0.9, 0.1]), np.full(3, 5000.0), np.full(2, 0.08)).tolist()
    [1, 2]
    """
    areas = (areas_px2[:, None] + areas_px2[None]) / 2
    similarity = oks_terms(positions_px - positions_px[:, None], areas, sigmas).mean(axis=-1)
    keep: list[int] = []
    for row in np.argsort(-person_scores, kind="stable"):
        if all(similarity[row, other] <= max_oks for other in keep):
            keep.append(int(row))
    return np.array(keep, dtype=int)


@dataclass(frozen=True)
class PoseNmsRules:
    """Constants of AlphaPose's comparison.

    Attributes
    ----------
    delta1, delta2 : float
        Scales of the scores and of the distances in pixels.
    mu : float
        Weight of the distances relative to the scores.
    gamma : float
        Similarity above which two poses are one person.
    min_score : float
        A person whose points are all below it is dropped.
    min_matches : float
        This many coinciding points make two poses one person.
    reach : float
        Maximum distance of coinciding points, as a fraction of the box's longer side.
    is_whole_body : bool
        Compare body, face and hands each on its own.
    """

    delta1: float = 1.0
    mu: float = 1.7
    delta2: float = 2.65
    gamma: float = 22.48
    min_score: float = 0.3
    min_matches: float = 5
    reach: float = 0.1
    is_whole_body: bool = False


BODY_RULES = PoseNmsRules()
WHOLE_BODY_RULES = PoseNmsRules(is_whole_body=True)
INTEGRAL_RULES = PoseNmsRules(1.0, 1.65, 8.0, 3.6, 0.01, 3, 0.15, is_whole_body=True)


def merge_poses(
    positions_px: np.ndarray, scores: np.ndarray, boxes_px: np.ndarray, rules: PoseNmsRules
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """AlphaPose's pose non-maximum suppression.

    Parameters
    ----------
    positions_px : array, shape (n, k, 2)
    scores : array, shape (n, k)
        Missing positions are NaN, with score 0.
    boxes_px : array, shape (n, 4: x, y, width, height)
    rules : PoseNmsRules
        Constants.

    Returns
    -------
    rows : array of int, shape (m,)
        The people kept, best first.
    positions_px : array, shape (m, k, 2)
    scores : array, shape (m, k)
        Each merged with the poses it absorbed.
    """
    scores = np.where(scores == 0, 1e-5, scores)
    reaches = rules.reach * boxes_px[:, 2:].max(axis=1, initial=0)
    means = scores.mean(axis=1)
    left = np.arange(len(scores))
    rows, merged = [], []
    while len(left):
        best = left[np.argmax(means[left])]
        distances = _distances(positions_px[best], positions_px[left])
        same = _similarity(distances, scores[best], scores[left], rules) > rules.gamma
        same |= _matches(distances, scores[best], reaches[best], rules) >= rules.min_matches
        absorbed = left[same] if same.any() else np.array([best])
        pose = _merge(best, absorbed, positions_px, scores, min(reaches[best], _MERGED_PX))
        if scores[best].max() >= rules.min_score and pose[1].max() >= rules.min_score:
            rows.append(best)
            merged.append(pose)
        left = np.setdiff1d(left, absorbed)
    points, values = ([pose[k] for pose in merged] for k in (0, 1))
    shape = -1, *positions_px.shape[1:]
    return np.array(rows, int), np.reshape(points, shape), np.reshape(values, shape[:2])


def _distances(pose_px: np.ndarray, others_px: np.ndarray) -> np.ndarray:
    """(m, k) distances; infinite where a point is not given."""
    distances = np.linalg.norm(others_px - pose_px, axis=-1)
    return np.where(np.isnan(distances), np.inf, distances)


def _similarity(
    distances: np.ndarray, best_scores: np.ndarray, scores: np.ndarray, rules: PoseNmsRules
) -> np.ndarray:
    """Similarity (m,) of poses to the best one: agreeing scores where points coincide, and nearness."""
    near = distances <= _AGREEING_PX
    agreement = np.tanh(best_scores / rules.delta1) * np.tanh(scores / rules.delta1)
    if not rules.is_whole_body:
        agreement = np.where(near, agreement, 0)
        return agreement.sum(axis=1) + rules.mu * np.exp(-distances / rules.delta2).sum(axis=1)
    # As released: in whole bodies agreement counts at points of low score, nearness at the others.
    weak = scores < rules.min_score
    agreement = np.where(near & weak, agreement, 0)
    n_body = distances.shape[1] - _N_FACE - _N_HANDS
    scale = rules.delta2 * np.repeat([1, _FACE_FACTOR, _HAND_FACTOR], [n_body, _N_FACE, _N_HANDS])
    nearness = np.where(weak, 0, np.exp(-distances / scale))
    body, face, hands = _part_means(agreement)
    body_near, face_near, hands_near = _part_means(nearness)
    nearness = body_near + face_near + _HAND_NEARNESS * hands_near
    return body + face + _HAND_AGREEMENT * hands + rules.mu * nearness


def _matches(
    distances: np.ndarray, best_scores: np.ndarray, reach_px: float, rules: PoseNmsRules
) -> np.ndarray:
    """Number (m,) of points that coincide with the best pose's."""
    limit = min(reach_px, _COINCIDENT_PX)
    if not rules.is_whole_body:
        return (distances <= limit).sum(axis=1)
    n_sure = int((best_scores > rules.min_score / 2).sum())
    if n_sure == 0:
        return np.zeros(len(distances))
    n_poses, n_keypoints = distances.shape
    # As released: Halpe's groups, which end at 26 and 94, for COCO-WholeBody's 133 points too.
    factors = np.repeat([1, _FACE_FACTOR, _HAND_FACTOR], [_N_BODY, _N_FACE, n_keypoints - _N_BODY - _N_FACE])
    count = (distances <= limit * factors).sum(axis=1)
    # As released: the count is divided by the sure points of all poses compared, twice over.
    return count / (4 * n_poses * n_sure) * n_keypoints


def _merge(
    best: int, absorbed: np.ndarray, positions_px: np.ndarray, scores: np.ndarray, reach_px: float
) -> tuple[np.ndarray, np.ndarray]:
    """Mean of the absorbed poses' points near the best one's, weighted by score."""
    near = _distances(positions_px[best], positions_px[absorbed]) <= reach_px
    weights = np.where(near, scores[absorbed], 0.0)
    total = weights.sum(axis=0)
    shares = weights / np.where(total > 0, total, 1.0)
    points = (np.where(near[..., None], positions_px[absorbed], 0.0) * shares[..., None]).sum(axis=0)
    given = total > 0
    return np.where(given[:, None], points, np.nan), (weights * shares).sum(axis=0)


def _part_means(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    parts = np.split(values, [-_N_FACE - _N_HANDS, -_N_HANDS], axis=1)
    return tuple(part.mean(axis=1) for part in parts)
