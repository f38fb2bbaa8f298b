"""Stability and accuracy of 3D keypoints of still people in many views (paper section IV-B).

A person sits still while the robot looks from many poses, so every view should give the same position in the
robot's base frame. *Stability* is how close views are to the detector's own median position of that person;
it needs no ground truth, and a detector that is always wrong in the same way is stable. *Accuracy* is the
same relative to the true position, which simulated recordings have.

Throughout, `points` is the table of `hicp_lib.lifting.table.lift_recording` with the columns `view`,
`subject`, `detector` and `method` before its own, frame numbers of a view continue from subject to subject,
and `subjects` maps every view to the subject of each of its images. The person with the highest score of each
image is used; a keypoint counts as found when its score is above `min_score` and it could be lifted.
Intervals are 95 % percentile ones from resampling subjects, and images of each.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
import pandas as pd

from hicp_lib.core.keypoints import GROUPS, LEFT_HAND, NAMES, RIGHT_HAND
from hicp_lib.evaluation.cases import groups_of
from hicp_lib.evaluation.statistics.resampling import Draws, draw_counts, with_interval

CASE = ["view", "detector", "method"]
POSITION = ["x_m", "y_m", "z_m"]
PIXEL = ["u_px", "v_px"]
THRESHOLDS_M = (0.025, 0.05, 0.1)
MIN_SCORE = 0.1

Parts = Mapping[str, Sequence[str]]

# The parts in the paper. All 21 keypoints of a hand are used, each relative to its own median position.
PARTS: Parts = {
    f"{side} {part}": keypoints
    for part in ("shoulder", "elbow", "wrist", "hand")
    for side, hand in (("left", LEFT_HAND), ("right", RIGHT_HAND))
    for keypoints in [tuple(NAMES[i] for i in hand) if part == "hand" else (f"{side}_{part}",)]
}


def counted(
    points: pd.DataFrame, min_score: float = MIN_SCORE, columns: Sequence[str] = POSITION
) -> pd.DataFrame:
    """The used rows: the best person of an image, scores above `min_score`, with a position in `columns`.

    Parameters
    ----------
    points : DataFrame
        Lifted keypoints, as described in this module.
    min_score : float, optional
        Keypoints above it count.
    columns : sequence of str, optional
        The coordinates that must be present.

    Returns
    -------
    DataFrame

    Examples
    --------
    >>> rows = pd.DataFrame({"person": [0, 1, 0], "score": [0.9, 0.9, 0.1]}).assign(x_m=0.0, y_m=0.0, z_m=1.0)
    >>> counted(rows).index.tolist()
    [0]
    """
    placed = points[list(columns)].notna().all(axis=1)
    return points[(points["person"] == 0) & (points["score"] > min_score) & placed]


@dataclass(frozen=True)
class LiftedViews:
    """Lifted keypoints of people in views.

    Attributes
    ----------
    points : DataFrame
        As described in this module.
    subjects : mapping of str to array, shape (n_frames,)
        The subject of each image, by view.
    truth : mapping of str to DataFrame or None
        By view, a table with `frame, keypoint` and true coordinates; None if unknown.
    min_score : float
        Keypoints above it count.
    """

    points: pd.DataFrame
    subjects: Mapping[str, np.ndarray]
    truth: Mapping[str, pd.DataFrame] | None = None
    min_score: float = MIN_SCORE

    def cases(self, parts: Parts = PARTS, columns: Sequence[str] = POSITION) -> Iterator[tuple]:
        """Every part of every detector in every view.

        A detector in the registry gives the groups of keypoints named there, any other those that it finds in
        some view. A group that is given but not found is included.

        Parameters
        ----------
        parts : mapping of str to tuple of str, optional
            Keypoints by part.
        columns : sequence of str, optional
            The coordinates, d of them.

        Yields
        ------
        case : tuple of str
            View, detector and method.
        part : str
        subjects : array, shape (n_frames,)
        found, true : array, shape (n_frames, n_keypoints, d)
            Positions; the true ones None without `truth`.
        """
        by_detector, names = self.points.groupby("detector"), list(dict.fromkeys(chain(*parts.values())))
        given = {name: _gives(name, set(rows["keypoint"].unique())) for name, rows in by_detector}
        found = dict(list(counted(self.points, self.min_score, columns).groupby(CASE, sort=False)))
        runs = self.points[["detector", "method"]].drop_duplicates()
        for view, whose in self.subjects.items():
            n = len(whose)
            true = None if self.truth is None else position_array(self.truth[view], names, n, columns)
            for run in runs.itertuples(index=False, name=None):
                # A detector that finds nobody in a view has no rows there, but must be included.
                places = position_array(found.get((view, *run), self.points[:0]), names, n, columns)
                for part, keypoints in parts.items():
                    if given[run[0]] & set(keypoints):
                        at = [names.index(name) for name in keypoints]
                        yield (view, *run), part, whose, places[:, at], None if true is None else true[:, at]


def median_positions(points: pd.DataFrame, min_score: float = MIN_SCORE) -> pd.DataFrame:
    """Coordinate-wise median over the views of every subject's keypoints, in the base frame.

    Returns
    -------
    DataFrame
        Columns `view, detector, method, subject, keypoint, n, x_m, y_m, z_m`; `n` is the number of images.
    """
    labels = [*CASE, "subject", "keypoint"]
    groups = counted(points, min_score).groupby(labels, sort=False)
    table = groups[POSITION].median().assign(n=groups.size()).reset_index()
    return table[[*labels, "n", *POSITION]]


def within_distance(
    lifted: LiftedViews, thresholds_m: Sequence[float] = THRESHOLDS_M, draws: Draws = Draws()
) -> pd.DataFrame:
    """Fraction of images in which a keypoint was found within a distance of its reference position.

    An image in which it was not found counts as not within. The keypoints of a hand have equal weight. A
    detector that does not give a part has no row; one that gives it has a row, even if it never finds it.

    Parameters
    ----------
    lifted : LiftedViews
        With truth, distances are to the true positions; else to the median over the subject's images.
    thresholds_m : sequence of float, optional
        The distances.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `view, detector, method, part, reference` ("median" or "truth"), `threshold_m, value, low,
        high`, `found` (fraction of images, at any distance), `n_people`.
    """
    rows: list[tuple] = []
    reference = "median" if lifted.truth is None else "truth"
    for case, part, whose, found_m, true_m in lifted.cases():
        weights, n_people = draw_counts(whose, draws), len(set(whose))
        off_m = np.linalg.norm(found_m - (own_medians(found_m, whose) if true_m is None else true_m), axis=-1)
        within = (off_m[..., None] <= np.asarray(thresholds_m)).mean(axis=1)
        shares = weights @ within / weights.sum(axis=1, keepdims=True)
        bounds = zip(thresholds_m, *with_interval(shares, n_people, len(whose)), strict=True)
        found = np.isfinite(off_m).mean()
        rows += [(*case, part, reference, *numbers, found, n_people) for numbers in bounds]
    columns = [*CASE, "part", "reference", "threshold_m", "value", "low", "high", "found", "n_people"]
    return pd.DataFrame(rows, columns=columns)


def position_array(
    rows: pd.DataFrame, keypoints: Sequence[str], n_frames: int, columns: Sequence[str] = POSITION
) -> np.ndarray:
    """Positions of one case as an array.

    Parameters
    ----------
    rows : DataFrame
        Columns `frame, keypoint` and `columns`.
    keypoints : sequence of str
        Their names.
    n_frames : int
        Number of images.
    columns : sequence of str, optional
        The coordinates, d of them.

    Returns
    -------
    array, shape (n_frames, len(keypoints), d)
        NaN where not found.
    """
    result = np.full((n_frames, len(keypoints), len(columns)), np.nan)
    place = {name: k for k, name in enumerate(keypoints)}
    rows = rows[rows["keypoint"].isin(place)]
    result[rows["frame"], rows["keypoint"].map(place).astype(int)] = rows[list(columns)]
    return result


def _gives(detector: str, found: set[str]) -> set[str]:
    """The keypoints of the groups that a detector gives, or finds if it is not in the registry."""
    names = {group: {NAMES[i] for i in keypoints} for group, keypoints in GROUPS.items()}
    groups = groups_of({}, detector) or [group for group in names if names[group] & found]
    return set().union(*(names[group] for group in groups))


def own_medians(found_m: np.ndarray, subjects: np.ndarray) -> np.ndarray:
    """Coordinate-wise medians over the images of the subject of each image, shape as `found_m` (n, k, 3).

    For keypoints never found of a subject they are 0.
    """
    medians_m = np.zeros_like(found_m)
    for of in of_each(subjects):
        seen = np.isfinite(found_m[of]).any(axis=0)
        medians_m[of] = np.nanmedian(np.where(seen, found_m[of], 0.0), axis=0)
    return medians_m


def of_each(subjects: np.ndarray) -> list[np.ndarray]:
    """Which images (n_frames,) are of each subject, in the order of first occurrence."""
    return [np.equal(subjects, subject) for subject in dict.fromkeys(subjects)]
