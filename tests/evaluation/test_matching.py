"""Which detection is of whom: best first, whom it fits, from a least similarity on."""

import numpy as np
import pytest

from hicp_lib.core.keypoints import COCO_17, SIGMAS
from hicp_lib.evaluation.matching import MATCH_OKS, match_best_first, matched_people, pairwise_oks
from tests.evaluation.made_people import make_annotations, make_detections

BODY_SIGMAS = SIGMAS["halpe"][COCO_17]
POINTS = np.random.default_rng(0).uniform(50, 400, (3, 136, 2))
AREA_PX2 = 20_000.0


def moved(oks: float) -> np.ndarray:
    """The first person with every body keypoint off by as much as the similarity says."""
    points = POINTS[0].copy()
    points[COCO_17, 0] += 2 * BODY_SIGMAS * np.sqrt(-2 * AREA_PX2 * np.log(oks))
    return points


def test_the_least_similarity_of_a_match_is_a_tenth():
    assert MATCH_OKS == 0.1
    fit = np.array([[0.1]])
    assert match_best_first(fit, np.ones(1)) == {0: 0}
    assert match_best_first(np.nextafter(fit, 0), np.ones(1)) == {}
    people = make_annotations(POINTS[:1], [0], areas_px2=AREA_PX2)
    for oks, matched in ((0.11, {0: 0}), (0.09, {})):
        found = make_detections(moved(oks)[None])
        assert pairwise_oks(people, found, COCO_17, BODY_SIGMAS)[0, 0] == pytest.approx(oks, rel=1e-6)
        assert matched_people(people, found, COCO_17, BODY_SIGMAS) == matched


def test_the_surest_chooses_first_and_of_equals_the_first():
    fit = np.array([[0.9, 0.8, 0.7], [0.2, 0.3, 0.1]])
    assert match_best_first(fit, np.array([0.1, 0.2, 0.3])) == {0: 2, 1: 1}
    assert match_best_first(fit, np.ones(3)) == {0: 0, 1: 1}
    assert match_best_first(fit, np.ones(3), least=0.5) == {0: 0}
    assert fit[0, 0] == 0.9  # what was given stays
    assert match_best_first(np.zeros((0, 3)), np.ones(3)) == {}


def test_all_pairs_are_told_apart():
    people = make_annotations(POINTS[:2], [0, 0])
    fit = pairwise_oks(people, make_detections(POINTS[[1, 0, 2]]), COCO_17, BODY_SIGMAS)
    assert fit.shape == (2, 3) and (fit[[0, 1], [1, 0]] == 1).all() and fit[:, 2].max() < 0.5


def test_occluded_keypoints_count_and_unlabelled_ones_do_not():
    flags = np.full((1, 136), 1.0)
    flags[0, COCO_17[3]] = 0
    people = make_annotations(POINTS[:1], [0], visibility=flags, areas_px2=AREA_PX2)
    found = make_detections(moved(0.6)[None])
    assert pairwise_oks(people, found, COCO_17, BODY_SIGMAS)[0, 0] == pytest.approx(0.6)
    assert matched_people(people, found, COCO_17, BODY_SIGMAS) == {0: 0}


def test_people_without_a_labelled_keypoint_take_no_detection():
    flags = np.full((2, 136), 2.0)
    flags[0, COCO_17] = 0
    people = make_annotations(POINTS[[0, 0]], [0, 0], visibility=flags, areas_px2=AREA_PX2)
    found = make_detections(np.stack([moved(0.6), moved(0.5)]), [0.9, 0.8])
    assert matched_people(people, found, COCO_17, BODY_SIGMAS) == {1: 0}
