"""Detectors compared on the HiCP subsets: one tidy table of metrics, and the loss without the head.

Throughout, `truth` and `found` are as `hicp_lib.evaluation.cases` says. Crops of one source image are drawn
together in the bootstrap.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import GROUPS, SIGMAS
from hicp_lib.detectors.runtime.results import Timed
from hicp_lib.evaluation.ap.bootstrap import Samples, difference, intervals, resample
from hicp_lib.evaluation.ap.evaluate import Evaluation, check_detections, evaluate, people_seen
from hicp_lib.evaluation.ap.options import choose
from hicp_lib.evaluation.cases import Found, Truth, all_cases, per_case
from hicp_lib.evaluation.matching import best_oks
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.formats.annotations import Annotations, source_images

# All groups an average precision is given for: hands as one object, and every hand by itself.
GROUPS_OF_OBJECTS = (*GROUPS, "each hand")
# (subset, detector, group) -> its evaluation, and its figures on draws that all detectors share
Drawn = Mapping[tuple[str, str, str], tuple[Evaluation, Samples]]


def compare(truth: Truth, found: Found, draws: Draws = Draws()) -> pd.DataFrame:
    """AP and AR of every detector on every subset, for the groups of keypoints it gives.

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
    """Every case evaluated, as it is and on draws of source images: what `metric_table` and `pairs` read.

    The detectors of one subset and group are drawn together, so that they can be told apart on the same
    images.

    Parameters
    ----------
    truth : Truth
        By subset.
    found : Found
        By image id, of every subset and detector.
    draws : Draws, optional
        Of the bootstrap.
    groups : sequence of str, optional
        Keys of `options.OBJECTS` that are looked at, where a detector gives such keypoints.
    **options : str
        Fields of `options.Options`.

    Returns
    -------
    dict of (str, str, str) to (Evaluation, Samples)
        By subset, detector and group: its evaluation, and its figures on the draws.
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
        for metric, figure in intervals(its.metrics(), samples).items()
    ]
    return pd.DataFrame(rows, columns=columns)


def pairs(drawn: Drawn) -> pd.DataFrame:
    """AP and AR of every detector less every other's, on the same crops and the same draws of them.

    Detectors fail on the same images, so this says more of which is better than two intervals side by side.

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
    """Basic and Headless with the people who are in both; further subsets as they are.

    Equal image ids are then of the same person, so that `draw_cases` draws the same people in both.
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


def person_oks(
    annotations: Annotations, detections: Mapping[int, Detections], group: str = "body", **options: Any
) -> pd.DataFrame:
    """OKS of the best-fitting detection for each person who counts, 0 when nobody was found.

    Parameters
    ----------
    annotations : Annotations
        The truth.
    detections : mapping of int to Detections
        By image id.
    group : str
        A key of `OBJECTS`.
    **options : str
        Fields of `Options`.

    Returns
    -------
    DataFrame
        Columns `image_id, annotation_id, oks, n_labelled`.
    """
    objects, chosen = choose(group, options)
    check_detections(detections, annotations)
    people = people_seen(annotations, objects, chosen)
    rows = [
        (people.image_ids[i], people.ids[i], fit, int((people.visibility[i, keypoints] > 0).sum()))
        for keypoints in objects
        for i, fit in best_oks(people, detections, keypoints, SIGMAS[chosen.sigmas][keypoints])
    ]
    types = {"image_id": int, "annotation_id": int, "oks": float, "n_labelled": int}
    return pd.DataFrame(rows, columns=list(types)).astype(types)
