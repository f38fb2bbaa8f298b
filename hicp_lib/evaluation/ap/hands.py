"""Single hands: how many are found, and what each part of a combination contributes.

A labelled hand counts as found when some detection has its points, on the correct side, with an OKS of this
hand (its labelled points, the person's area) above .5.
"""

from collections.abc import Iterator, Mapping
from dataclasses import fields
from itertools import accumulate
from operator import or_
from typing import Any

import numpy as np
import pandas as pd

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.detections import Detections
from hicp_lib.core.files import read_json
from hicp_lib.detectors.combined.arbitration import ArbitrationRule
from hicp_lib.detectors.combined.hand_squares import SEED_11, SEED_11_THUNDER, SquareRule
from hicp_lib.evaluation.ap.bootstrap import difference, intervals, resample
from hicp_lib.evaluation.ap.evaluate import evaluate
from hicp_lib.evaluation.ap.person_oks import person_oks
from hicp_lib.evaluation.cases import Found, Truth
from hicp_lib.evaluation.statistics.resampling import Draws, draw_counts, with_interval
from hicp_lib.formats.annotations import Annotations, source_images

FOUND_OKS = 0.5

# Options of `combined.detector.Combined` and its hand detector. Each step changes one thing; the last one is
# the default. The thresholds come second, so that all further steps share them.
_STEPS: dict[str, dict] = read_json(DATA_DIR / "combination_steps.json")
# How the thresholds among these were chosen.
_CHOSEN = {
    "hands_num_hands": "two of one person and two of others in a square; no other was tried",
    "hands_min_score": f"{SEED_11_THUNDER}: 0.1 within .005",
    "min_side_px": f"{SEED_11_THUNDER}: without it .017 less on Headless",
    "looks": f"{SEED_11}: mirrored squares too: .01 to .02 more, for a third more looks",
}
INGREDIENTS: dict[str, dict] = dict(zip(_STEPS, accumulate(_STEPS.values(), or_), strict=True))


def thresholds() -> pd.DataFrame:
    """The thresholds of the combination and how each was chosen: columns `threshold, value, chosen`.

    "within .005" is the change of the AP of hands on Basic and Headless, both body detectors are
    `mediapipe-pose` and `movenet-thunder`; seed 11 means 100 scenes of development identities.
    """
    rules = [field for rule in (SquareRule, ArbitrationRule) for field in fields(rule)]
    rows = [(field.name, field.default, field.metadata["chosen"]) for field in rules]
    rows += [(name, list(INGREDIENTS.values())[-1][name], chosen) for name, chosen in _CHOSEN.items()]
    return pd.DataFrame(rows, columns=["threshold", "value", "chosen"]).astype({"value": str})


def compare_hands(truth: Truth, found: Found, baseline: Found, draws: Draws = Draws()) -> pd.DataFrame:
    """Average precision of hands and hands found, step by step and against a baseline.

    Parameters
    ----------
    truth : Truth
        By subset.
    found : Found
        By image id, of every subset and variant, in the order of the variants.
    baseline : Found
        By image id, of every subset and one detector, for the ratio of hands found.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `subset, variant, AP, AP_low, AP_high, step, step_low, step_high, AR50, n_hands, n_found,
        share, share_low, share_high, ratio, ratio_low, ratio_high`: 95 % bootstrap intervals over source
        images; `step` is AP minus that of the variant before (NaN for the first), `ratio` the hands found
        relative to the baseline, both on the same resamples.
    """
    bases = {subset: run for (subset, _), run in baseline.items()}
    rows = []
    for subset in dict.fromkeys(subset for subset, _ in found):
        runs = {variant: run for (its, variant), run in found.items() if its == subset}
        rows += [(subset, *row) for row in _rows(truth[subset], runs, bases[subset], draws)]
    ends = ("", "_low", "_high")
    ap, step, share, ratio = ([f"{name}{end}" for end in ends] for name in ("AP", "step", "share", "ratio"))
    columns = ["subset", "variant", *ap, *step, "AR50", "n_hands", "n_found", *share, *ratio]
    return pd.DataFrame(rows, columns=columns)


def _rows(
    people: Annotations, runs: Mapping[str, Mapping[int, Detections]], baseline: Mapping, draws: Draws
) -> Iterator[tuple]:
    clusters = source_images(people)
    evaluations = [evaluate(people, run, "hand") for run in runs.values()]
    samples = resample(evaluations, draws, clusters)
    step: Any = (np.nan,) * 3
    for k, (variant, run) in enumerate(runs.items()):
        ap = intervals(evaluations[k].metrics(), samples[k], evaluations[k])["AP"]
        if k:
            step = difference(evaluations[k], evaluations[k - 1], samples[k], samples[k - 1])["AP"]
        counts = _counts(people, run, baseline, clusters)
        n_hands, n_found, _ = (int(n) for n in counts.sum(axis=0))
        found_of, ratio = (_with_interval(counts, 1, per, draws) for per in (0, 2))
        yield variant, *ap, *step, evaluations[k].AR50, n_hands, n_found, *found_of, *ratio


def _counts(people: Annotations, found: Mapping, baseline: Mapping, clusters: Mapping) -> np.ndarray:
    """Per source image: labelled hands, those found, those found by the baseline; shape (n_sources, 3)."""
    table, base = (person_oks(people, of, "each hand", sigmas="halpe") for of in (found, baseline))
    table = table.assign(n=1, found=table["oks"] > FOUND_OKS, base=base["oks"] > FOUND_OKS)
    sources = table["image_id"].map(clusters)
    return table.groupby(sources, sort=True)[["n", "found", "base"]].sum().to_numpy(float)


def _with_interval(counts: np.ndarray, of: int, per: int, draws: Draws) -> tuple[Any, Any, Any]:
    """Ratio of two columns' sums, with an interval from resampling rows; NaN for 0 / 0."""
    if not counts[:, per].sum():
        return np.nan, np.nan, np.nan
    some, whole = (draw_counts(len(counts), draws) @ counts)[:, [of, per]].T
    n_images = 0 if per else np.count_nonzero(counts[:, per])  # the found hands are a share of all hands only
    ratios = np.divide(some, whole, out=np.full(len(whole), np.nan), where=whole > 0)
    return with_interval(ratios, n_frames=n_images)
