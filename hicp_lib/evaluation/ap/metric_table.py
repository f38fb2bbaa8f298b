"""Detectors compared on the HiCP subsets: one tidy table of figures, and the loss without the head.

Throughout, `truth` maps a subset's name to its annotations, and `found` maps (subset, detector) to
detections by image id. Crops of one source image are drawn together in the bootstrap.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import GROUPS, N_KEYPOINTS
from hicp_lib.detectors.registry import DETECTORS
from hicp_lib.detectors.runtime.results import Timed
from hicp_lib.evaluation.ap.bootstrap import bootstrap_difference, difference, intervals, resample
from hicp_lib.evaluation.ap.evaluate import Evaluation, evaluate, person_oks
from hicp_lib.formats.annotations import Annotations, source_images

Found = Mapping[tuple[str, str], Mapping[int, Detections]]
# (subset, detector, group) -> its evaluation, and its figures on draws that all detectors share
Drawn = Mapping[tuple[str, str, str], tuple[Evaluation, pd.DataFrame]]


def compare(
    truth: Mapping[str, Annotations], found: Found, n_resamples: int = 1000, seed: int = 0
) -> pd.DataFrame:
    """AP and AR of every detector on every subset, for the groups of keypoints it gives.

    Returns
    -------
    DataFrame, columns `subset, group, detector, metric, value, low, high, n_people`
    """
    return figures(draw_cases(truth, found, n_resamples, seed))


def draw_cases(
    truth: Mapping[str, Annotations],
    found: Found,
    n_resamples: int = 1000,
    seed: int = 0,
    groups: Collection[str] = tuple(GROUPS),
) -> dict[tuple[str, str, str], tuple[Evaluation, pd.DataFrame]]:
    """Every case evaluated, as it is and on draws of source images: what `figures` and `pairs` read.

    The detectors of one subset and group are drawn together, so that they can be told apart on the same
    images. Only `groups` of keypoints are looked at.
    """
    cases = [case for case in _cases(found) if case[-1] in groups]
    together: dict[tuple[str, str], dict[str, Evaluation]] = {}
    for subset, detector, group in cases:
        evaluation = evaluate(truth[subset], found[subset, detector], group)
        together.setdefault((subset, group), {})[detector] = evaluation
    drawn = {}
    for (subset, group), evaluations in together.items():
        clusters = source_images(truth[subset])
        samples = resample(list(evaluations.values()), n_resamples, seed, clusters)
        for (detector, evaluation), sample in zip(evaluations.items(), samples, strict=True):
            drawn[subset, detector, group] = evaluation, sample
    return {case: drawn[case] for case in cases}


def figures(drawn: Drawn) -> pd.DataFrame:
    """AP and AR of every case: what `compare` returns."""
    tables = []
    for (subset, detector, group), (evaluation, samples) in drawn.items():
        table = intervals(evaluation.metrics(), samples).assign(n_people=evaluation.n_people)
        tables.append(_labelled(table, subset=subset, group=group, detector=detector))
    return pd.concat(tables, ignore_index=True)


def pairs(drawn: Drawn) -> pd.DataFrame:
    """AP and AR of every detector less every other's, on the same crops and the same draws of them.

    Two detectors stumble over the same pictures, so this says more of which is better than two intervals
    side by side.

    Returns
    -------
    DataFrame, columns `subset, group, detector, other, pair` ("a less b"), `metric, value, low, high`
    """
    columns = ["subset", "group", "detector", "other", "pair", "metric", "value", "low", "high"]
    tables = []
    for (subset, detector, group), (evaluation, samples) in drawn.items():
        for (its_subset, other, its_group), (its, of_other) in drawn.items():
            if (its_subset, its_group) == (subset, group) and other != detector:
                table = difference(evaluation, its, samples, of_other)
                labels = {"detector": detector, "other": other, "pair": f"{detector} less {other}"}
                tables.append(_labelled(table, subset=subset, group=group, **labels))
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=columns)


def head_loss(
    truth: Mapping[str, Annotations], found: Found, n_resamples: int = 1000, seed: int = 0
) -> pd.DataFrame:
    """Change of AP from Basic to Headless, on the people who are in both.

    Returns
    -------
    DataFrame, columns `group, detector, basic, headless, change, low, high, n_people`; the interval
    is the change's
    """
    shared = truth["basic"].images.keys() & truth["headless"].images.keys()
    same = {subset: truth[subset].of_images(shared) for subset in ("basic", "headless")}
    rows = []
    for subset, detector, group in _cases(found):
        if subset != "basic":
            continue
        basic, headless = (
            evaluate(same[s], {i: found[s, detector].get(i, Detections.none()) for i in shared}, group)
            for s in ("basic", "headless")
        )
        clusters = source_images(same["basic"])
        change = (
            bootstrap_difference(headless, basic, n_resamples, seed, clusters).set_index("metric").loc["AP"]
        )
        rows.append(
            (group, detector, basic.AP, headless.AP, *change[["value", "low", "high"]], basic.n_people)
        )
    columns = ["group", "detector", "basic", "headless", "change", "low", "high", "n_people"]
    return pd.DataFrame(rows, columns=columns).sort_values("group", kind="stable", ignore_index=True)


def people_oks(truth: Mapping[str, Annotations], found: Found) -> pd.DataFrame:
    """OKS of each person's best detection: `subset, group, detector` and the columns of `person_oks`."""
    tables = [
        _labelled(
            person_oks(truth[subset], found[subset, detector], group),
            subset=subset,
            group=group,
            detector=detector,
        )
        for subset, detector, group in _cases(found)
    ]
    return pd.concat(tables, ignore_index=True)


def detection_times(runs: Mapping[tuple[str, str], Mapping[int, Timed]]) -> pd.DataFrame:
    """Time per image: columns `subset, detector, image_id, time_ms, workers`."""
    rows = [
        (subset, detector, image_id, result.time_ms, result.workers)
        for (subset, detector), run in runs.items()
        for image_id, result in run.items()
    ]
    return pd.DataFrame(rows, columns=["subset", "detector", "image_id", "time_ms", "workers"])


def groups_of(found: Found, detector: str) -> tuple[str, ...]:
    """The keypoint groups a detector is scored on: its own, or those an imported one gives a keypoint of."""
    if detector in DETECTORS:
        return DETECTORS[detector].groups
    given = np.zeros(N_KEYPOINTS, dtype=bool)
    for (_, name), images in found.items():
        if name == detector:
            for people in images.values():
                given |= np.isfinite(people.keypoints_px).all(axis=-1).any(axis=0)
    return tuple(group for group, keypoints in GROUPS.items() if given[keypoints].any())


def _cases(found: Found) -> Iterator[tuple[str, str, str]]:
    for subset, detector in found:
        for group in groups_of(found, detector):
            yield subset, detector, group


def _labelled(table: pd.DataFrame, **labels: str) -> pd.DataFrame:
    return table.assign(**labels)[[*labels, *table.columns]]
