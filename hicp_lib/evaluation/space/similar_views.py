"""What changes between nearly equal views of a still person: keypoints that come and go, and move.

Nothing but the camera's pose differs, and that by little, so an answer that follows what is seen stays. It is
`hicp_lib.evaluation.space.flicker` for views that are no sequence. Views are drawn in the bootstrap, and with
them the pairs they make.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from hicp_lib.evaluation.space.sightings import ALL_PARTS, ROW
from hicp_lib.evaluation.space.stability import MIN_SCORE, cases
from hicp_lib.evaluation.statistics.resampling import draw_counts, weighted_median, with_interval

NEAR_M, NEAR_RAD = 0.05, float(np.radians(5))
"""Views are nearly equal whose cameras are no further apart, in place and in direction."""


def similar_pairs(T_base_cam: np.ndarray) -> np.ndarray:
    """Pairs of nearly equal views.

    Parameters
    ----------
    T_base_cam : array, shape (n, 4, 4)

    Returns
    -------
    array of int, shape (n_pairs, 2)
        Each pair once.

    Examples
    --------
    >>> poses = np.tile(np.eye(4), (3, 1, 1))
    >>> poses[2, 0, 3] = 0.1
    >>> similar_pairs(poses).tolist()
    [[0, 1]]
    """
    places_m, turns = T_base_cam[:, :3, 3], T_base_cam[:, :3, :3]
    apart_m = np.linalg.norm(places_m[:, None] - places_m, axis=-1)
    cosine = (
        np.einsum("iab,jab->ij", turns, turns) - 1
    ) / 2  # of the angle of the turn from one to the other
    return np.argwhere(np.triu((apart_m <= NEAR_M) & (cosine >= np.cos(NEAR_RAD)), 1))


def similar_views(
    points: pd.DataFrame,
    T_base_cam: Mapping[str, np.ndarray],
    min_score: float = MIN_SCORE,
    n_resamples: int = 1000,
    seed: int = 0,
) -> pd.DataFrame:
    """How often a part comes or goes between nearly equal views, and how far it moves in the base frame.

    Parameters
    ----------
    points : DataFrame
        As of `hicp_lib.evaluation.space.stability`.
    T_base_cam : mapping of str to array, shape (n, 4, 4)
        Camera poses, by view.
    min_score : float, optional
        Keypoints above it count.
    n_resamples, seed : int, optional
        Number of bootstrap draws, and what they are drawn with.

    Returns
    -------
    DataFrame
        Columns `view, detector, method, part, measure, value, low, high, n` (pairs that count). "flicker
        rate": of the pairs in which any keypoint of the part is found in either view, the share in which none
        is in the other. "moves [m]": median over pairs of how far a keypoint moves; of several, their median.
    """
    rows: list[tuple] = []
    n_frames = {view: len(poses) for view, poses in T_base_cam.items()}
    pairs = {view: similar_pairs(poses).T for view, poses in T_base_cam.items()}
    for case, part, found_m, _ in cases(points, n_frames, None, min_score, ALL_PARTS):
        a, b = pairs[case[0]]
        times = draw_counts(len(found_m), n_resamples, seed)
        together = times[:, a] * times[:, b]
        seen = np.isfinite(found_m[..., 0]).any(axis=1)
        either = seen[a] | seen[b]
        with np.errstate(invalid="ignore"):
            rate = together @ (seen[a] != seen[b]) / (together @ either)
        moves_m = pd.DataFrame(np.linalg.norm(found_m[a] - found_m[b], axis=-1)).median(axis=1).to_numpy()
        rows.append((*case, part, "flicker rate", *with_interval(rate), either.sum()))
        moved_m = weighted_median(moves_m, together)
        rows.append((*case, part, "moves [m]", *with_interval(moved_m), np.isfinite(moves_m).sum()))
    return pd.DataFrame(rows, columns=[*ROW, "value", "low", "high", "n"])
