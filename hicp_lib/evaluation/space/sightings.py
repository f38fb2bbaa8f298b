"""In which images parts of people are found, and how close to their positions, to compare detectors.

There are more parts than in `hicp_lib.evaluation.space.stability`: an arm is found with any of its joints.
Rows are per image, for `hicp_lib.evaluation.statistics.proportions`: shares with intervals, and differences
of detectors or of parts on the same images.

Nearly equal views of still people differ only in the camera's pose, and only a little, so a reliable detector
should give the same result: `similar_views` is `hicp_lib.evaluation.space.flicker` for views that are not a
sequence. Its bootstrap resamples people, and views of each, with the pairs they form.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from hicp_lib.evaluation.space.stability import CASE, PARTS, LiftedViews, Parts, of_each, own_medians
from hicp_lib.evaluation.statistics.resampling import Draws, draw_counts, weighted_median, with_interval

WITHIN_M = 0.05
FOUND, NEAR_MEDIAN, NEAR_TRUTH = "found", "within 5 cm of the median", "within 5 cm of the truth"
ROW = [*CASE, "part", "measure"]

_ARMS = {f"{side} arm": (f"{side}_elbow", f"{side}_wrist") for side in ("left", "right")}
_ANY = {"any arm joint": sum(_ARMS.values(), ()), "any hand": (*PARTS["left hand"], *PARTS["right hand"])}
ALL_PARTS: Parts = {**PARTS, **_ARMS, **_ANY}
"""An arm is an elbow or a wrist, as in `hicp_lib.datasets.visibility`."""


def sightings(lifted: LiftedViews) -> pd.DataFrame:
    """For every part in every image, whether it is found, and which share of its keypoints is near.

    Parameters
    ----------
    lifted : LiftedViews

    Returns
    -------
    DataFrame
        Columns `view, detector, method, part, measure, subject, source_image` (the frame), `value`. `FOUND`
        is 1 where any of the part's keypoints is found; `NEAR_MEDIAN` and, with truth, `NEAR_TRUTH` are the
        share of them within `WITHIN_M` of the detector's median position over the subject's images, and of
        the truth.
    """
    tables = []
    for case, part, whose, found_m, true_m in lifted.cases(ALL_PARTS):
        seen = np.isfinite(found_m[..., 0])
        values = {FOUND: seen.any(axis=1).astype(float)}
        references = {NEAR_MEDIAN: own_medians(found_m, whose)}
        references |= {} if true_m is None else {NEAR_TRUTH: true_m}
        for name, reference_m in references.items():
            values[name] = (np.linalg.norm(found_m - reference_m, axis=-1) <= WITHIN_M).mean(axis=1)
        of_rows = (*case, part, whose, np.arange(len(seen)))
        labels = dict(zip([*CASE, "part", "subject", "source_image"], of_rows, strict=True))
        tables += [pd.DataFrame(labels | {"measure": name, "value": of}) for name, of in values.items()]
    return pd.concat(tables, ignore_index=True)[[*ROW, "subject", "source_image", "value"]]


NEAR_M, NEAR_RAD = 0.05, float(np.radians(5))
"""Maximum difference of nearly equal views' cameras, in position and direction."""


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
    cosine = (np.einsum("iab,jab->ij", turns, turns) - 1) / 2  # of the rotation angle between the two
    return np.argwhere(np.triu((apart_m <= NEAR_M) & (cosine >= np.cos(NEAR_RAD)), 1))


def similar_views(
    lifted: LiftedViews, T_base_cam: Mapping[str, np.ndarray], draws: Draws = Draws()
) -> pd.DataFrame:
    """How often a part appears or disappears between nearly equal views, and how far it moves.

    Parameters
    ----------
    lifted : LiftedViews
        Pairs are formed within a subject.
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
        "moves [m]": median over pairs of the distance that a keypoint moves; for several keypoints, their
        median.
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
            n_people, alone = len(set(whose[a[count]])), len(set(whose)) == 1
            n_images = len(np.union1d(a[count], b[count])) if measure == "flicker rate" else 0
            interval = with_interval(drawn, n_people if n_people > 1 or alone else 0, n_images)
            rows.append((*case, part, measure, *interval, count.sum(), n_people))
    return pd.DataFrame(rows, columns=[*ROW, "value", "low", "high", "n", "n_people"])


def _drawn_together(times: np.ndarray, subjects: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """How often each pair of one subject's images is drawn, (draws, n_pairs), from the counts of images.

    A subject that is drawn twice forms pairs within each copy, not between them: on average half of all pairs
    of its images.
    """
    drawn = np.ones(times.shape)
    for of in of_each(subjects):
        drawn[:, of] = np.maximum(times[:, of].mean(axis=1, keepdims=True), 1)
    return times[:, a] * times[:, b] / drawn[:, a]


_LEAST_IMAGES = 3  # of a person: with one, the distance to the median is 0


def spread_and_bias(lifted: LiftedViews, draws: Draws = Draws()) -> pd.DataFrame:
    """Stability and accuracy as distances, over the images in which a keypoint was found.

    Parameters
    ----------
    lifted : LiftedViews
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `view, detector, method, part, n_images` (in which it was found), `n_people` (for spread and
        bias; no intervals from fewer than `MIN_DRAWN` of several), then in metres, each with `_low` and
        `_high`: `spread_m`, the median distance to the subject's median position; with `truth` also `bias_m`,
        the distance of a subject's median position from the true one, mean over subjects, and `error_m`, the
        median distance to the truth. For a hand, the mean of each over its keypoints; NaN where nothing was
        found. Spread and bias use subjects with the keypoint found in at least three images. With n images
        the spread is underestimated by a fraction of about 1 / n, since the median is computed from the same
        images.
    """
    rows = []
    for case, part, whose, found_m, true_m in lifted.cases():
        weights, n_people = draw_counts(whose, draws), _n_people(found_m, whose)
        n_images = np.isfinite(found_m[..., 0]).sum(axis=0).mean()
        labels = [*CASE, "part", "n_images", "n_people"]
        row = dict(zip(labels, (*case, part, n_images, n_people), strict=True))
        several = n_people > 1 or len(set(whose)) == 1
        for name, drawn in _distances_drawn(found_m, true_m, weights, whose).items():
            interval = with_interval(drawn, n_people if several else 0)
            row |= zip((name, f"{name}_low", f"{name}_high"), interval, strict=True)
        rows.append(row)
    return pd.DataFrame(rows)


def _n_people(found_m: np.ndarray, subjects: np.ndarray) -> int:
    """Number of subjects with a keypoint of the part in at least `_LEAST_IMAGES` images."""
    counts = [np.isfinite(found_m[of, :, 0]).sum(axis=0).max() for of in of_each(subjects)]
    return int(np.sum(np.array(counts) >= _LEAST_IMAGES))


def _distances_drawn(
    found_m: np.ndarray, true_m: np.ndarray | None, weights: np.ndarray, subjects: np.ndarray
) -> dict[str, np.ndarray]:
    """Spread, bias and error in every draw, shape (draws,), mean over the keypoints found.

    Medians are recomputed in every draw.
    """
    draws: dict[str, list[np.ndarray]] = {"spread_m": [], "bias_m": [], "error_m": []}
    for k, found in enumerate(found_m.swapaxes(0, 1)):
        people = [of for of in of_each(subjects) if np.isfinite(found[of, 0]).sum() >= _LEAST_IMAGES]
        if not people:
            continue
        off_m, biases_m = np.full(weights.shape, np.nan), np.full((len(people), len(weights)), np.nan)
        for of, bias_m in zip(people, biases_m, strict=True):
            medians = [weighted_median(found[of, i], weights[:, of]) for i in range(3)]
            median_m = np.stack(medians, axis=1)
            off_m[:, of] = np.linalg.norm(found[of] - median_m[:, None], axis=-1)
            if true_m is not None:  # equal in all images of a still person
                bias_m[:] = np.linalg.norm(median_m - true_m[of, k].mean(axis=0), axis=1)
        draws["spread_m"].append(weighted_median(off_m, weights))
        if true_m is not None:
            times = np.where(np.isfinite(biases_m), [weights[:, of].mean(axis=1) for of in people], 0.0)
            with np.errstate(invalid="ignore"):
                draws["bias_m"].append((times * np.nan_to_num(biases_m)).sum(axis=0) / times.sum(axis=0))
            draws["error_m"].append(weighted_median(np.linalg.norm(found - true_m[:, k], axis=1), weights))
    names = ("spread_m",) if true_m is None else tuple(draws)
    nothing = [np.full(len(weights), np.nan)]
    return {name: np.mean(draws[name] or nothing, axis=0) for name in names}
