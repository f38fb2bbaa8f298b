"""The worst cases, found by rule."""

import numpy as np
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import INDEX
from hicp_lib.evaluation.failures.error_kinds import all_errors
from hicp_lib.evaluation.failures.worst_cases import lost_points, worst_cases
from tests.evaluation.made_people import POINTS, make_annotations, make_detections


def test_worst_cases_are_the_surest_mistakes_and_the_overlooked():
    people = make_annotations(np.stack([POINTS] * 3), [0, 1, 2])
    points = np.stack([POINTS] * 2)
    points[0, 9:11] += 5_000
    points[1, 9] += 5_000
    found = {("basic", "mediapipe-pose"): {i: make_detections(points[i : i + 1]) for i in range(2)}}
    table = worst_cases(all_errors({"basic": people}, found))
    assert table[["case", "rank", "image_id"]].to_numpy().tolist() == [
        ["surest mistakes", 1, 0], ["surest mistakes", 2, 1], ["overlooked", 1, 2],
    ]  # fmt: skip
    assert table["badness"].tolist() == pytest.approx([1.0, 0.5, 17])
    assert table["mistakes"].tolist() == ["miss × 2", "miss × 1", "17 visible keypoints"]


def test_only_visible_keypoints_are_overlooked_and_an_image_counts_once():
    flags = np.full((3, 136), 2.0)
    flags[1, 5:] = 1
    extras = [{"source_image_id": 0}, {"source_image_id": 1}, {"source_image_id": 1}]
    people = make_annotations(np.stack([POINTS] * 3), [0, 1, 2], visibility=flags, extras=extras)
    errors = all_errors({"basic": people}, {("basic", "mediapipe-pose"): {}})
    table = worst_cases(errors, n=4)
    assert table[["rank", "image_id", "badness"]].to_numpy().tolist() == [[1, 0, 17], [2, 2, 17]]
    assert worst_cases(errors, n=1)["image_id"].tolist() == [0]


def test_the_point_that_is_lost_is_the_one_the_detector_was_surest_of():
    wrist, knee = INDEX["left_wrist"], INDEX["left_knee"]
    truth = {"basic": make_annotations(POINTS[None], [3]), "headless": make_annotations(POINTS[None], [4])}
    moved, scores = POINTS.copy(), np.full((1, 136), 0.5)
    moved[[wrist, knee]] += 5_000
    scores[0, wrist] = 0.9
    where = {"basic": POINTS, "headless": moved}
    found = {
        (subset, detector): {i: Detections(points[None], scores, np.ones(1))}
        for (subset, points), i in zip(where.items(), (3, 4), strict=True)
        for detector in ("loses", "overlooks")
    }
    found["headless", "overlooks"] = {}  # somebody who is not found has lost no point
    table = lost_points(all_errors(truth, found))
    assert table[["detector", "case", "subset", "image_id", "keypoint"]].to_numpy().tolist() == [
        ["loses", "left wrist: miss", "basic", 3, wrist],
        ["loses", "left wrist: miss", "headless", 4, wrist],
    ]
    overlooked = {(subset, name): of for (subset, name), of in found.items() if name == "overlooks"}
    assert lost_points(all_errors(truth, overlooked)).empty
