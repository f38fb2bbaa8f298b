"""Hits: counted where the truth is known, and nowhere else."""

import numpy as np
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import COCO_17, SIGMAS
from hicp_lib.evaluation.calibration.keypoint_hits import all_hits, keypoint_hits
from tests.evaluation.made_people import make_annotations, make_detections

AREA = 20_000.0
POINTS = np.random.default_rng(0).uniform(50, 400, (3, 136, 2))


def hit_radius_px(keypoint: int, term: float) -> float:
    """Distance at which the OKS term has a value t: 2 sigma sqrt(-2 A ln t)."""
    return 2 * SIGMAS["halpe"][keypoint] * np.sqrt(-2 * AREA * np.log(term))


@pytest.mark.parametrize("min_term", [0.5, 0.85])
@pytest.mark.parametrize("share, hit", [(0.99, True), (1.01, False)])
def test_a_hit_lies_within_the_distance_at_which_the_term_is_the_least(share, hit, min_term):
    found = POINTS[:1].copy()
    found[0, COCO_17, 0] += [share * hit_radius_px(k, min_term) for k in COCO_17]
    hits = keypoint_hits(make_annotations(POINTS[:1], [0]), {0: make_detections(found)}, min_term=min_term)
    assert hits["keypoint"].tolist() == COCO_17.tolist()
    assert (hits["hit"] == hit).all() and (hits["score"] == 0.5).all()


def test_points_without_a_label_or_not_given_are_left_out():
    visibility = np.full((1, 136), 2.0)
    visibility[0, 3] = 0
    found = POINTS[:1].copy()
    found[0, 7] = np.nan
    hits = keypoint_hits(
        make_annotations(POINTS[:1], [0], visibility=visibility), {0: make_detections(found)}
    )
    assert set(COCO_17) - set(hits["keypoint"]) == {3, 7}


def test_people_who_do_not_count_are_left_out():
    extras = [{}, {"other": True}, {}]
    people = make_annotations(POINTS, [0, 0, 0], crowd=[2], extras=extras)
    hits = keypoint_hits(people, {0: make_detections(POINTS)})
    assert len(hits) == 17 and hits["hit"].all()


def test_a_second_detection_of_a_person_and_one_of_nobody_are_wrong():
    people = make_annotations(POINTS[:1], [0])
    found = np.stack([POINTS[0], POINTS[0] + 1, POINTS[0] + 50_000])
    hits = keypoint_hits(people, {0: make_detections(found, [0.9, 0.8, 0.7])})
    assert hits["hit"].tolist() == [True] * 17 + [False] * 34


def test_the_surer_detection_takes_the_person_first():
    people = make_annotations(POINTS[:1], [0])
    found = make_detections(np.stack([POINTS[0], POINTS[0] + 1]), [0.1, 0.9])
    found.scores[0, COCO_17], found.scores[1, COCO_17] = 0.3, 0.7
    hits = keypoint_hits(people, {0: found})
    assert hits.groupby("score")["hit"].all().to_dict() == {0.3: False, 0.7: True}


def test_hits_of_all_cases_carry_their_labels():
    people = make_annotations(POINTS[:2], [0, 1], extras=[{"source_image_id": 7}, {"source_image_id": 9}])
    found = {i: make_detections(POINTS[i : i + 1]) for i in range(2)}
    table = all_hits({"basic": people}, {("basic", "d"): found}, {"d": ("body", "hand")})
    assert table.groupby("group").size().to_dict() == {"body": 34, "hand": 84}
    assert table.groupby("image_id")["source_image"].unique().to_dict() == {0: [7], 1: [9]}
    assert (table["detector"] == "d").all()
    assert all_hits({"basic": people}, {("basic", "d"): {0: Detections.none()}}, {"d": ("body",)}).empty
