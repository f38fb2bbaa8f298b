"""Detectors compared on the HiCP subsets: one tidy table of metrics, and the loss without the head.

`truth` and `found` are always as described in `hicp_lib.evaluation.cases`. Crops of one source image are
resampled together in the bootstrap.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from hicp_lib.core.keypoints import GROUPS
from hicp_lib.detectors.runtime.results import Timed
from hicp_lib.evaluation.ap.bootstrap import Samples, difference, intervals, resample
from hicp_lib.evaluation.ap.evaluate import Evaluation, evaluate
from hicp_lib.evaluation.ap.person_oks import person_oks
from hicp_lib.evaluation.cases import Found, Truth, all_cases, per_case
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.formats.annotations import Annotations, source_images

# All groups with an AP: hands as one object, and every hand alone.
GROUPS_OF_OBJECTS = (*GROUPS, "each hand")
# (subset, detector, group) -> its evaluation, and its figures on draws that all detectors share
Drawn = Mapping[tuple[str, str, str], tuple[Evaluation, Samples]]


def compare(truth: Truth, found: Found, draws: Draws = Draws()) -> pd.DataFrame:
    """AP and AR of every detector on every subset, for its groups of keypoints.

    Parameters
    ----------
    truth : Truth
        By subset.
    found : Found
        By image id, of every subset and detector.
    draws : Draws, optional
        Of the bootstrap.

    Returns
    -------
    DataFrame
        Columns `subset, group, labelled, detector, metric, value, low, high, n_people`.
    """
    return metric_table(draw_cases(truth, found, draws))


def draw_cases(
    truth: Truth, found: Found, draws: Draws = Draws(), groups: Sequence[str] = tuple(GROUPS), **options: Any
) -> dict[tuple[str, str, str], tuple[Evaluation, Samples]]:
    """Evaluate every case on the sample and on resamples of source images, for `metric_table` and `pairs`.

    The detectors of one subset and group share their resamples, so that they are compared on the same images.

    Parameters
    ----------
    truth : Truth
        By subset.
    found : Found
        By image id, of every subset and detector.
    draws : Draws, optional
        Of the bootstrap.
    groups : sequence of str, optional
        Keys of `options.OBJECTS` to evaluate, if a detector gives such keypoints.
    **options : str
        Fields of `options.Options`.

    Returns
    -------
    dict of (str, str, str) to (Evaluation, Samples)
        By subset, detector and group: the evaluation, and its metrics on the draws.
    """
    cases, drawn = list(all_cases(found, groups)), {}
    for subset, group in dict.fromkeys((subset, group) for subset, _, group in cases):
        detectors = [case[1] for case in cases if case[::2] == (subset, group)]
        evaluations = [evaluate(truth[subset], found[subset, d], group, **options) for d in detectors]
        samples = resample(evaluations, draws, source_images(truth[subset]))
        for detector, evaluation, sample in zip(detectors, evaluations, samples, strict=True):
            drawn[subset, detector, group] = evaluation, sample
    return {case: drawn[case] for case in cases}


def metric_table(drawn: Drawn) -> pd.DataFrame:
    """AP and AR of every case of `draw_cases`: what `compare` returns."""
    columns = "subset group labelled detector metric value low high n_people".split()
    rows = [
        (subset, group, its.options.labelled, detector, metric, *figure, its.n_people)
        for (subset, detector, group), (its, samples) in drawn.items()
        for metric, figure in intervals(its.metrics(), samples, its).items()
    ]
    return pd.DataFrame(rows, columns=columns)


def pairs(drawn: Drawn) -> pd.DataFrame:
    """AP and AR of every detector minus every other's, on the same crops and resamples.

    Detectors tend to fail on the same images, so this says more about which is better than two separate
    intervals.

    Parameters
    ----------
    drawn : Drawn
        From `draw_cases`.

    Returns
    -------
    DataFrame
        Columns `subset, group, labelled, detector, other, pair` ("a less b"), `metric, value, low, high`.
    """
    columns = "subset group labelled detector other pair metric value low high".split()
    rows = [
        (subset, group, its.options.labelled, detector, other, f"{detector} less {other}", metric, *figure)
        for (subset, detector, group), (its, samples) in drawn.items()
        for (other_subset, other, other_group), (others, of_other) in drawn.items()
        if (other_subset, other_group) == (subset, group) and other != detector
        for metric, figure in difference(its, others, samples, of_other).items()
    ]
    return pd.DataFrame(rows, columns=columns)


def head_loss(drawn: Drawn) -> pd.DataFrame:
    """Change of AP from Basic to Headless, on the people who are in both.

    Parameters
    ----------
    drawn : Drawn
        From `draw_cases`, on `same_people`.

    Returns
    -------
    DataFrame
        Columns `group, detector, basic, headless, change, low, high, n_people`; the interval is the change's.
    """
    rows = []
    for (subset, detector, group), (basic, of_basic) in drawn.items():
        if subset == "basic":
            headless, of_headless = drawn["headless", detector, group]
            change = difference(headless, basic, of_headless, of_basic)["AP"]
            rows.append((group, detector, basic.AP, headless.AP, *change, basic.n_people))
    columns = ["group", "detector", "basic", "headless", "change", "low", "high", "n_people"]
    return pd.DataFrame(rows, columns=columns).sort_values("group", kind="stable", ignore_index=True)


def same_people(truth: Truth, found: Found) -> tuple[dict[str, Annotations], Found]:
    """Basic and Headless with only the people who are in both; further subsets unchanged.

    Equal image ids then mean the same person, so that `draw_cases` resamples the same people in both.
    """
    pair = ("basic", "headless")
    shared = truth["basic"].images.keys() & truth["headless"].images.keys()
    people = {s: of.of_images(shared) if s in pair else of for s, of in truth.items()}
    seen = {case: {i: run[i] for i in run if i in people[case[0]].images} for case, run in found.items()}
    return people, seen


def people_oks(truth: Truth, found: Found) -> pd.DataFrame:
    """OKS of each person's best detection.

    Columns `subset, group, detector, source_image` and those of `person_oks`.
    """
    table = per_case(person_oks, truth, found)
    first = ["subset", "group", "detector", "source_image"]
    return table[[*first, "image_id", "annotation_id", "oks", "n_labelled"]]


def detection_times(runs: Mapping[tuple[str, str], Mapping[int, Timed]]) -> pd.DataFrame:
    """Time per image: columns `subset, detector, image_id, time_ms, workers`."""
    rows = [
        (subset, detector, image_id, result.time_ms, result.workers)
        for (subset, detector), run in runs.items()
        for image_id, result in run.items()
    ]
    return pd.DataFrame(rows, columns=["subset", "detector", "image_id", "time_ms", "workers"])
