"""Matching, precision and recall are pycocotools' to the last bit, on generated sets and odd ones."""

from dataclasses import replace
from functools import reduce

import numpy as np
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.evaluation.ap import cocoeval
from hicp_lib.evaluation.ap.evaluate import evaluate
from tests.evaluation.by_pycocotools import figures, run_pycocotools

N_SETS = 40


def assert_the_same(annotations, detections, group) -> float:
    """AP; also the matches themselves are compared."""
    run = run_pycocotools(annotations, detections, group)
    ours = evaluate(annotations, detections, group, score="person")
    precision, recall = cocoeval.precision_recall(ours.matches)
    assert np.array_equal(run.eval["precision"][:, :, 0, 0, 0], precision)
    assert np.array_equal(run.eval["recall"][:, 0, 0, 0], recall)
    assert ours.metrics() == figures(run)
    of_all_areas = [image for image in run.evalImgs[: len(annotations.images)] if image is not None]
    assert ours.n_people == sum(
        np.count_nonzero(np.asarray(image["gtIgnore"]) == 0) for image in of_all_areas
    )
    matched = np.concatenate([image["dtMatches"] > 0 for image in of_all_areas], axis=1)
    ignored = np.concatenate([image["dtIgnore"] for image in of_all_areas], axis=1)
    order = np.argsort(-np.concatenate([image["dtScores"] for image in of_all_areas]), kind="stable")
    assert np.array_equal(ours.matches.is_true, (matched & ~ignored)[:, order])
    assert np.array_equal(ours.matches.is_false, ~matched[:, order])
    return ours.AP


@pytest.mark.parametrize("group", ["body", "hand"])
def test_generated_sets(scene, group):
    values = [assert_the_same(*scene(seed), group) for seed in range(N_SETS)]
    assert (
        np.min(values) > 0.02 and np.max(values) < 0.95 and len(set(values)) == N_SETS
    )  # they say something


def test_crowded_sets_with_ties_in_scores_places_and_people(scene):
    """Everything twice and in a few grid places: equal scores, equal OKS, people on top of each other."""
    for seed in range(N_SETS):
        annotations, detections = scene(seed, n_images=12)
        rng = np.random.default_rng(seed)
        twice = np.repeat(np.arange(len(annotations)), 2)
        doubled = replace(annotations.take(twice), ids=np.arange(len(twice)) + 1)
        doubled = replace(doubled, is_crowd=doubled.is_crowd | (rng.random(len(twice)) < 0.1))
        found = {
            i: replace(one.concatenate(one), person_scores=rng.integers(0, 3, 2 * len(one)) / 2)
            for i, one in detections.items()
        }
        assert_the_same(doubled, found, "body")


def test_more_detections_than_take_part_and_images_without_any(scene):
    annotations, detections = scene(1)
    many = {i: reduce(Detections.concatenate, [one] * 10) for i, one in detections.items() if i % 3}
    assert max(map(len, many.values())) > 20
    assert_the_same(annotations, many, "body")


def test_keypoints_that_are_not_given(scene):
    annotations, detections = scene(2)
    rng = np.random.default_rng(2)
    for i, one in detections.items():
        absent = rng.random(one.scores.shape) < 0.4
        points = np.where(absent[..., None], np.nan, one.keypoints_px)
        detections[i] = replace(one, keypoints_px=points, scores=np.where(absent, 0.0, one.scores))
    assert 0.02 < assert_the_same(annotations, detections, "body") < 0.95


@pytest.mark.parametrize("areas_px2", [0.0, 1e-30, 1e12])
def test_people_of_no_or_any_area(scene, areas_px2):
    annotations, detections = scene(3)
    exact = {
        i: replace(one, keypoints_px=np.round(one.keypoints_px / 200) * 200) for i, one in detections.items()
    }
    visible = np.where(annotations.visibility > 0, 2.0, 0.0)
    points = np.where(visible[..., None] > 0, np.round(annotations.keypoints_px / 200) * 200, np.nan)
    people = replace(
        annotations, areas_px2=np.full(len(annotations), areas_px2), keypoints_px=points, visibility=visible
    )
    assert assert_the_same(people, exact, "body") > 0.02


def test_similarities_on_a_threshold_match(annotated, detected):
    """Some of the points exactly right, the others far off: OKS is n / 20."""
    points = np.random.default_rng(0).uniform(100, 300, (20, 136, 2))
    visibility = np.full((20, 136), 2.0)
    visibility[:, 114:] = 0
    visibility[:, :6] = 0
    people = annotated(points, range(20), visibility=visibility)
    found = points.copy()
    for n in range(20):
        found[n, 94 + n :] += 5000
    detections = {i: detected([found[i]], [1 - i / 100]) for i in range(20)}
    assert_the_same(people, detections, "hand")
    _, recall = cocoeval.precision_recall(evaluate(people, detections, "hand").matches)
    assert recall.tolist() == [np.mean(np.arange(20) / 20 >= t) for t in np.linspace(0.5, 0.95, 10)]
