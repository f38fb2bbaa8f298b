"""Scores of keypoints that are not visible, and the paper's remarks about them as measures.

Each of the paper's short remarks about a system becomes a measure that is computed for every detector:

- MMPose "adds keypoints at the edge with low confidence": of keypoints outside the picture, the share that is
  given; of those given, the share placed at the border or beyond; their mean score minus that of visible
  ones.
- AlphaPose is "conservative": the share of labelled keypoints given with a score of at least .3, and the
  share of those that are correct.
- Detectron2 has "low shoulder scores": mean score of visible shoulders minus that of other visible keypoints
  below the head.
- OpenPose gives "fingers only with a wrist": of given hands, the share whose body wrist is not given.
"""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json
from hicp_lib.core.keypoints import INDEX, LEFT_HAND, RIGHT_HAND
from hicp_lib.evaluation.cases import Found, Truth, groups_of
from hicp_lib.evaluation.failures.placed_keypoints import landed
from hicp_lib.evaluation.statistics.proportions import mean_with_interval, proportions
from hicp_lib.evaluation.statistics.resampling import Draws, draw_counts, with_interval
from hicp_lib.formats.annotations import source_images

SURE = 0.3  # the paper's threshold
N_BINS = 5
_SHOULDERS = (INDEX["left_shoulder"], INDEX["right_shoulder"])
_FIRST_BELOW_HEAD = INDEX["left_shoulder"]

_NOTHING = (np.nan, np.nan, np.nan, 0)  # value, interval and number of rows where there are none

# Measure: the system that the paper's remark is about.
MEASURES = {said.format(sure=SURE): of for said, of in read_json(DATA_DIR / "paper.json")["remarks"].items()}


def scores_by_state(placed: pd.DataFrame, draws: Draws = Draws()) -> pd.DataFrame:
    """Hit rate against score, for keypoints that are visible, occluded and outside the picture.

    Parameters
    ----------
    placed : DataFrame
        `placed_keypoints.placed_keypoints`.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `detector, state, bin, score` (mean), `value, low, high, n, n_images`, by five equal bins of
        the score.
    """
    rows = placed[placed["hit"].notna()].astype({"hit": bool})
    bins = np.clip((rows["score"] * N_BINS).astype(int), 0, N_BINS - 1)
    keys = ["detector", "state", "bin"]
    rows = rows.assign(bin=bins).sort_values(keys, kind="stable")
    means = rows.groupby(keys)["score"].mean().reset_index()
    return means.merge(proportions(rows, keys, "hit", draws), on=keys)


def paper_remarks(
    placed: pd.DataFrame, errors: pd.DataFrame, truth: Truth, found: Found, draws: Draws = Draws()
) -> pd.DataFrame:
    """Every measure for every detector that was run, and "not run" for a remark's system if it was not.

    Parameters
    ----------
    placed : DataFrame
        `placed_keypoints.placed_keypoints`.
    errors : DataFrame
        `error_kinds.all_errors`.
    truth : Truth
        By subset.
    found : Found
        By image id, of every subset and detector.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `measure, said_of, detector, value, low, high, n, status` ("run" or "not run").
    """
    values = {}
    for detector in dict.fromkeys(detector for _, detector in found):
        its_placed, its_errors = (table[table["detector"] == detector] for table in (placed, errors))
        body = its_errors[its_errors["group"] == "body"]
        hands = _hands(detector, truth, found) if "hand" in groups_of(found, detector) else None
        values[detector] = list(_values(its_placed, body, hands, draws))
    rows: list[tuple] = []
    for i, (measure, system) in enumerate(MEASURES.items()):
        rows += [(measure, system, detector, *of[i], "run") for detector, of in values.items()]
        if not {system, f"{system}-imported"} & values.keys():
            rows.append((measure, system, system, *_NOTHING, "not run"))
    columns = ["measure", "said_of", "detector", "value", "low", "high", "n", "status"]
    return pd.DataFrame(rows, columns=columns)


def _values(
    placed: pd.DataFrame, errors: pd.DataFrame, hands: pd.DataFrame | None, draws: Draws
) -> Iterator[tuple[float, float, float, int]]:
    """Value, interval and number of rows of each of `MEASURES`, in their order."""
    outside = placed[placed["state"] == "outside"]
    given, visible = outside[outside["given"]], placed[(placed["state"] == "visible") & placed["given"]]
    joints = visible[visible["keypoint"] >= _FIRST_BELOW_HEAD]
    shoulder = joints["keypoint"].isin(_SHOULDERS)
    sure = errors["score"] >= SURE
    yield _mean(outside, outside["given"], draws)
    yield _mean(given, landed(given) != "inside", draws)
    yield _difference(given, visible, draws)
    yield _mean(errors, sure, draws)
    yield _mean(errors[sure], errors["hit"][sure], draws)
    yield _difference(joints[shoulder], joints[~shoulder], draws)
    yield _NOTHING if hands is None else _mean(hands, ~hands["wrist"], draws)


def _mean(rows: pd.DataFrame, flags: pd.Series, draws: Draws) -> tuple[float, float, float, int]:
    return *mean_with_interval(flags, rows["source_image"], draws), len(rows)


def _difference(a: pd.DataFrame, b: pd.DataFrame, draws: Draws) -> tuple[float, float, float, int]:
    """Mean score of a minus that of b, both on the same resamples of source images."""
    images = np.unique(np.concatenate([a["source_image"], b["source_image"]]))
    if not len(a) or not len(b):
        return _NOTHING
    times = draw_counts(len(images), draws)
    means = []
    for rows in (a, b):
        place = np.searchsorted(images, rows["source_image"])
        sums, counts = (np.bincount(place, weights=w, minlength=len(images)) for w in (rows["score"], None))
        with np.errstate(invalid="ignore"):
            means.append(times @ sums / (times @ counts))
    return *with_interval(means[0] - means[1]), len(a)


def _hands(detector: str, truth: Truth, found: Found) -> pd.DataFrame:
    """Every hand with a finger given: columns `source_image, wrist` (whether the body's wrist is given)."""
    rows = []
    for (subset, name), run in found.items():
        if name != detector:
            continue
        sources = source_images(truth[subset])
        for image_id, people in run.items():
            given = np.isfinite(people.keypoints_px).all(axis=-1)
            for hand, wrist in ((LEFT_HAND, "left_wrist"), (RIGHT_HAND, "right_wrist")):
                has_hand = given[:, hand[1:]].any(axis=1)
                rows += [(sources[image_id], bool(flag)) for flag in given[has_hand, INDEX[wrist]]]
    return pd.DataFrame(rows, columns=["source_image", "wrist"]).astype({"wrist": bool})
