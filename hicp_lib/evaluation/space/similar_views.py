"""What changes between nearly equal views of still people: keypoints that come and go, and move.

Nothing but the camera's pose differs, and that by little, so an answer that follows what is seen stays. It is
`hicp_lib.evaluation.space.flicker` for views that are no sequence. In the bootstrap people are drawn, and
views of each, and with them the pairs they make.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from hicp_lib.evaluation.space.sightings import ALL_PARTS, ROW
from hicp_lib.evaluation.space.stability import LiftedViews, of_each
from hicp_lib.evaluation.statistics.resampling import Draws, draw_counts, weighted_median, with_interval

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
    cosine = (np.einsum("iab,jab->ij", turns, turns) - 1) / 2  # of the angle of the turn between the two
    return np.argwhere(np.triu((apart_m <= NEAR_M) & (cosine >= np.cos(NEAR_RAD)), 1))


def similar_views(
    lifted: LiftedViews, T_base_cam: Mapping[str, np.ndarray], draws: Draws = Draws()
) -> pd.DataFrame:
    """How often a part comes or goes between nearly equal views, and how far it moves in the base frame.

    Parameters
    ----------
    lifted : LiftedViews
        Views of one subject make pairs.
    T_base_cam : mapping of str to array, shape (n, 4, 4)
        Camera poses, by view.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `view, detector, method, part, measure, value, low, high, n` (pairs that count), `n_people`
        (with one that does; no interval from fewer than `MIN_DRAWN` of several). "flicker rate": of the pairs
        in which any keypoint of the part is found in either view, the share in which none is in the other.
        "moves [m]": median over pairs of how far a keypoint moves; of several, their median.
    """
    rows: list[tuple] = []
    pairs = {view: similar_pairs(poses).T for view, poses in T_base_cam.items()}
    for case, part, whose, found_m, _ in lifted.cases(ALL_PARTS):
        a, b = pairs[case[0]]
        a, b = a[whose[a] == whose[b]], b[whose[a] == whose[b]]
        together = _drawn_together(draw_counts(whose, draws), whose, a, b)
        seen = np.isfinite(found_m[..., 0]).any(axis=1)
        either = seen[a] | seen[b]
        with np.errstate(invalid="ignore"):
            rate = together @ (seen[a] != seen[b]) / (together @ either)
        moves_m = pd.DataFrame(np.linalg.norm(found_m[a] - found_m[b], axis=-1)).median(axis=1).to_numpy()
        moved, moved_m = np.isfinite(moves_m), weighted_median(moves_m, together)
        for measure, drawn, count in (("flicker rate", rate, either), ("moves [m]", moved_m, moved)):
            n_people = len(set(whose[a[count]]))
            interval = with_interval(drawn, n_people if n_people > 1 or len(set(whose)) == 1 else 0)
            rows.append((*case, part, measure, *interval, count.sum(), n_people))
    return pd.DataFrame(rows, columns=[*ROW, "value", "low", "high", "n", "n_people"])


def _drawn_together(times: np.ndarray, subjects: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """How often each pair of one subject's images is drawn, (draws, n_pairs), from how often each image is.

    A subject that is drawn twice makes pairs within each time, not between them: on average half of those
    that its images make.
    """
    drawn = np.ones(times.shape)
    for of in of_each(subjects):
        drawn[:, of] = np.maximum(times[:, of].mean(axis=1, keepdims=True), 1)
    return times[:, a] * times[:, b] / drawn[:, a]
