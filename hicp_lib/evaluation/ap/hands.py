"""Hands one by one: how many are found, and what each part of a combination adds to that.

A labelled hand counts as found when some detection places its points, on the right side, with an OKS
of the hand alone (its labelled points, the person's area) above .5.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import LEFT_HAND, RIGHT_HAND, SIGMAS
from hicp_lib.evaluation.ap.bootstrap import bootstrap_intervals
from hicp_lib.evaluation.ap.evaluate import check_detections, evaluate
from hicp_lib.evaluation.cases import Found, Truth
from hicp_lib.evaluation.matching import best_oks
from hicp_lib.evaluation.statistics.resampling import draw_counts, with_interval
from hicp_lib.formats.annotations import Annotations, source_images

FOUND_OKS = 0.5

# Parts of a combination, as options of `combined.detector.Combined`; the last is its default.
INGREDIENTS: dict[str, dict] = {
    "whole image": {"looks": "image", "arbitrate": False},
    "wrist squares": {"looks": "wrists", "arbitrate": False},
    "all looks": {"arbitrate": False},
    "all looks, arbitrated": {},
}


def hand_oks(
    annotations: Annotations, detections: Mapping[int, Detections], sigmas: str = "halpe"
) -> pd.DataFrame:
    """OKS of each labelled hand of the people who count, with the detection that fits it best.

    Parameters
    ----------
    annotations : Annotations
        The truth.
    detections : mapping of int to Detections
        By image id.
    sigmas : {"halpe", "wholebody"}
        Constants of the keypoints.

    Returns
    -------
    DataFrame
        Columns `image_id, annotation_id, side` ("left", "right"), `oks` (0 when not found).

    Raises
    ------
    InputError
        As `hicp_lib.evaluation.ap.evaluate.evaluate`.
    """
    check_detections(detections, annotations)
    people = annotations.take(~annotations.is_other)
    rows = [
        (people.image_ids[i], people.ids[i], side, fit)
        for side, points in (("left", LEFT_HAND), ("right", RIGHT_HAND))
        for i, fit in best_oks(people, detections, points, SIGMAS[sigmas][points])
    ]
    return pd.DataFrame(rows, columns=["image_id", "annotation_id", "side", "oks"])


def compare_hands(
    truth: Truth, found: Found, baseline: str, n_resamples: int = 1000, seed: int = 0
) -> pd.DataFrame:
    """Average precision of hands and hands found, against a baseline.

    Parameters
    ----------
    truth : Truth
        By subset.
    found : Found
        By image id, of every subset and detector or variant of one.
    baseline : str
        The variant that hands found are set in proportion to.
    n_resamples, seed : int, optional
        Number of bootstrap draws, and what they are drawn with.

    Returns
    -------
    DataFrame
        Columns `subset, variant, AP, AP_low, AP_high, n_hands, n_found, share, share_low, share_high, ratio,
        ratio_low, ratio_high`: 95 % bootstrap intervals over source images; `ratio` is the hands found per
        hand the baseline finds, both on the same draws.
    """
    rows = []
    for subset, variant in found:
        people, clusters = truth[subset], source_images(truth[subset])
        evaluation = evaluate(people, found[subset, variant], "hand")
        ap = bootstrap_intervals(evaluation, n_resamples, seed, clusters).set_index("metric").loc["AP"]
        counts = _counts(people, found[subset, variant], found[subset, baseline], clusters)
        n_hands, n_found, _ = (int(n) for n in counts.sum(axis=0))
        found_of, ratio = (_with_interval(counts, 1, per, n_resamples, seed) for per in (0, 2))
        rows.append((subset, variant, *ap[["value", "low", "high"]], n_hands, n_found, *found_of, *ratio))
    ends = ("", "_low", "_high")
    columns = ["subset", "variant", *(f"AP{end}" for end in ends), "n_hands", "n_found"]
    columns += [f"{name}{end}" for name in ("share", "ratio") for end in ends]
    return pd.DataFrame(rows, columns=columns)


def _counts(people: Annotations, found: Mapping, baseline: Mapping, clusters: Mapping) -> np.ndarray:
    """Per source image: labelled hands, those found, those the baseline finds; shape (n_sources, 3)."""
    table = hand_oks(people, found)[["image_id", "oks"]].assign(n=1)
    table["found"], table["base"] = table["oks"] > FOUND_OKS, hand_oks(people, baseline)["oks"] > FOUND_OKS
    sources = table["image_id"].map(clusters)
    return table.groupby(sources, sort=True)[["n", "found", "base"]].sum().to_numpy(float)


def _with_interval(
    counts: np.ndarray, of: int, per: int, n_resamples: int, seed: int
) -> tuple[Any, Any, Any]:
    """Ratio of two columns' sums over the rows, with the interval from drawing rows; NaN for 0 / 0."""
    if not counts[:, per].sum():
        return np.nan, np.nan, np.nan
    some, whole = (draw_counts(len(counts), n_resamples, seed) @ counts)[:, [of, per]].T
    return with_interval(np.divide(some, whole, out=np.full(len(whole), np.nan), where=whole > 0))
