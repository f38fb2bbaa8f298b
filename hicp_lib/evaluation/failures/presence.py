"""Presence: keypoints declared present by calibrated scores, and their extended OKS.

A keypoint that is given inside the picture is *declared present* when its score, or better its calibrated
score, reaches a threshold; one placed outside the picture is declared absent. The calibration is an isotonic
curve (`calibration.curves`) of how often a keypoint placed in the picture really is in the picture, for each
detector and part of the body. It is cross-fitted: source images are split into two halves, and each person is
evaluated with the curve fitted on the other half. It is valid for people truncated as often as in these data.

`false_presence` is the hallucination rate: of parts of people outside the picture, the share that a detector
nevertheless gives inside it.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import inside
from hicp_lib.core.keypoints import COCO_17, COCO_NAMES
from hicp_lib.datasets.crops import with_outside
from hicp_lib.evaluation.ap.bootstrap import difference, intervals
from hicp_lib.evaluation.ap.extended_oks import PRESENCE_CUT
from hicp_lib.evaluation.ap.metric_table import Drawn, draw_cases
from hicp_lib.evaluation.calibration.curves import Calibration, split_half
from hicp_lib.evaluation.cases import Found, Truth, labelled
from hicp_lib.evaluation.failures.false_confidence import SURE
from hicp_lib.evaluation.failures.placed_keypoints import landed, placed_keypoints
from hicp_lib.evaluation.statistics.proportions import proportions
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.formats.annotations import Annotations, source_images

# The body part of each of the 17 keypoints: the head, or the name of a pair of keypoints.
PART_OF = np.array(["head"] * 5 + [name.partition("_")[2] for name in COCO_NAMES[5:]])
PARTS = tuple(dict.fromkeys(PART_OF))
MEASURES = ("OKS", "extended OKS, all given", "extended OKS, decided", "gained by deciding")


Presence = Callable[[str, object, np.ndarray], np.ndarray]
"""Probability that a placed keypoint is in the picture, by detector, source image, scores (..., 17)."""


def fit_presence(placed: pd.DataFrame, seed: int = 0) -> Presence:
    """Fit the probability that a keypoint is in the picture, per half of the source images.

    Parameters
    ----------
    placed : DataFrame
        `placed_keypoints.placed_keypoints`.
    seed : int, optional
        Seed of the split of the source images.

    Returns
    -------
    callable
        A `Presence`; the scores of a part without a curve are kept.
    """
    in_picture = placed["given"] & (landed(placed) != "outside")
    rows = placed[in_picture & (placed["state"] != "unknown")]
    half, part = split_half(rows["source_image"], seed), PART_OF[rows["keypoint"]]
    rows = rows.assign(half=half, part=part, present=rows["state"] != "outside")
    curves = {
        (detector, part, bool(half)): Calibration.fit(of["score"].to_numpy(), of["present"].to_numpy())
        for (detector, part, half), of in rows.groupby(["detector", "part", "half"])
    }
    first_half = frozenset(rows.loc[half, "source_image"])

    def presence(detector: str, source_image: object, scores: np.ndarray) -> np.ndarray:
        worth = np.array(scores, dtype=float)
        for part in PARTS:
            curve = curves.get((detector, part, source_image not in first_half))
            if curve is not None:
                worth[..., PART_OF == part] = curve(worth[..., PART_OF == part])
        return worth

    return presence


def declared(truth: Truth, found: Found, presence: Presence | None = None) -> Found:
    """Detections whose body keypoints' scores are probabilities of being in the picture.

    Parameters
    ----------
    truth : Truth
        Of crops, by subset.
    found : Found
        By image id, of every subset and detector.
    presence : callable, optional
        A `Presence`; by default every given keypoint is declared present, with score 1.

    Returns
    -------
    Found
        As `found`; a keypoint placed outside the picture gets score 0: it is declared absent.
    """
    result: dict[tuple[str, str], dict[int, Detections]] = {}
    for (subset, detector), run in found.items():
        sources, images = source_images(truth[subset]), truth[subset].images
        people = result[subset, detector] = {}
        for image_id, of_image in run.items():
            box_px = (0, 0, images[image_id].width_px, images[image_id].height_px)
            scores = of_image.scores.copy()
            body = presence(detector, sources[image_id], scores[:, COCO_17]) if presence else 1.0
            scores[:, COCO_17] = np.where(inside(of_image.keypoints_px[:, COCO_17], box_px), body, 0.0)
            people[image_id] = replace(of_image, scores=scores)
    return result


def extended_table(
    truth: Truth, found: Found, source: Annotations, drawn: Drawn, draws: Draws = Draws()
) -> pd.DataFrame:
    """AP of bodies by OKS and by extended OKS, with every given keypoint present and with a decision.

    Parameters
    ----------
    truth : Truth
        Of crops, by subset.
    found : Found
        By image id, of every subset and detector.
    source : Annotations
        What the crops were made from.
    drawn : Drawn
        From `draw_cases` of the same.
    draws : Draws, optional
        Of the bootstrap; its seed also selects the halves.

    Returns
    -------
    DataFrame
        Columns `subset, detector, measure` (of `MEASURES`), `value, low, high, n_people`; the last measure is
        the third minus the second, on the same resamples.
    """
    presence = fit_presence(placed_keypoints(truth, found, source), draws.seed)
    ways = {"given": declared(truth, found), "decided": declared(truth, found, presence)}
    runs = {(s, f"{d}, {way}"): run for way, its in ways.items() for (s, d), run in its.items()}
    known = {subset: with_outside(people, source) for subset, people in truth.items()}
    counted = draw_cases(known, runs, draws, groups=["body"], outside="count")
    rows = []
    for subset, detector in found:
        if (subset, detector, "body") in drawn:
            given, decided = (counted[subset, f"{detector}, {way}", "body"] for way in ("given", "decided"))
            cases = (drawn[subset, detector, "body"], given, decided)
            figures = [(intervals(of.metrics(), samples, of), of) for of, samples in cases]
            figures.append((difference(decided[0], given[0], decided[1], given[1]), given[0]))
            for measure, (figure, of) in zip(MEASURES, figures, strict=True):
                rows.append((subset, detector, measure, *figure["AP"], of.n_people))
    columns = ["subset", "detector", "measure", "value", "low", "high", "n_people"]
    return pd.DataFrame(rows, columns=columns)


# When a keypoint counts as given: the paper's threshold on raw scores, or a threshold on calibrated ones.
DECISIONS = (f"score of at least {SURE}", f"calibrated score of at least {PRESENCE_CUT}")
_FIRST_OF_PAIRS = 5  # the first five keypoints are the head's


def false_presence(
    truth: Truth, found: Found, placed: pd.DataFrame, source: Annotations, draws: Draws = Draws()
) -> pd.DataFrame:
    """Hallucination rate: how often parts of people outside the picture are given inside it.

    A head is outside when none of its keypoints is in the picture and at least one is known to be outside; it
    is given when one of its keypoints is. All other parts are one keypoint each, on either side.

    Parameters
    ----------
    truth : Truth
        Of crops, by subset.
    found : Found
        By image id, of every subset and detector.
    placed : DataFrame
        `placed_keypoints.placed_keypoints` of them.
    source : Annotations
        What the crops were made from.
    draws : Draws, optional
        Of the bootstrap; its seed also selects the halves.

    Returns
    -------
    DataFrame
        Columns `subset, detector, part` (of `PARTS`), `decision` (of `DECISIONS`), `value` (share of the
        parts outside), `low, high` (95 %, over source images), `n` (parts outside), `n_images, n_found`
        (those of detected people; of the others none is given).
    """
    calibrated = declared(truth, found, fit_presence(placed, draws.seed))
    kinds = {SURE: placed, PRESENCE_CUT: placed_keypoints(truth, calibrated, source)}
    missing = {subset: _missing(with_outside(people, source)) for subset, people in truth.items()}
    keys = ["subset", "detector", "image_id", "unit"]
    rows = []
    for decision, (cut, table) in zip(DECISIONS, kinds.items(), strict=True):
        is_given = (table["score"] >= cut) & (landed(table) != "outside")
        table = table.assign(unit=np.maximum(table["keypoint"] - _FIRST_OF_PAIRS + 1, 0), given=is_given)
        given = table.groupby(keys)["given"].any().reset_index()
        for subset, detector in found:
            labels = {"subset": subset, "detector": detector, "decision": decision}
            rows.append(labelled(missing[subset], **labels).merge(given, how="left", on=keys))
    parts = pd.concat(rows).assign(found=lambda t: t["given"].notna())
    parts["given"] = parts["given"].eq(True)
    by = ["subset", "detector", "part", "decision"]
    n_found = parts.groupby(by)["found"].sum().rename("n_found").reset_index()
    return proportions(parts, by, "given", draws).merge(n_found, on=by)


def _missing(people: Annotations) -> pd.DataFrame:
    """The parts that are outside the picture: columns `image_id, source_image, part, unit`."""
    people = people.take(~people.is_crowd)
    flags, sources = people.visibility[:, COCO_17], source_images(people)
    n = _FIRST_OF_PAIRS
    seen, gone = (np.column_stack([of[:, :n].any(axis=1), of[:, n:]]) for of in (flags > 0, flags < 0))
    who, unit = np.nonzero(gone & ~seen)
    image_ids = people.image_ids[who].tolist()
    of_image = {"image_id": image_ids, "source_image": [sources[i] for i in image_ids]}
    return pd.DataFrame(of_image | {"part": PART_OF[_FIRST_OF_PAIRS - 1 :][unit], "unit": unit})
