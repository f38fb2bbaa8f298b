"""PoseNet on real weights and rendered people."""

import json
from pathlib import Path

import numpy as np
import pytest

from hicp_lib.detectors.posenet.detector import EDGES, DecodingRule, Maps, decode
from hicp_lib.detectors.registry import make_detector
from tests.detectors.plain_people import errors_px, render_person


def test_rendered_people_are_found_to_a_few_pixels():
    errors = errors_px(make_detector("posenet"))
    assert np.median(errors) < 8
    assert np.max(errors[:, [5, 6]]) < 40, "left and right shoulder are 90 px apart"


def test_two_people_are_two_people():
    image, truth_px = render_person(0)
    middle = image[:, 120:360]
    found = make_detector("posenet").detect(np.hstack([middle, middle]))
    best = np.argsort(-found.person_scores)[:2]
    expected = truth_px[0, 0] - 120 + np.array([0, 240])
    np.testing.assert_allclose(np.sort(found.keypoints_px[best, 0, 0]), expected, atol=10)


def test_scores_are_scores_and_nobody_is_nobody():
    detector = make_detector("posenet")
    image, _ = render_person(1)
    found = detector.detect(image)
    assert 0 <= found.scores.min() and found.scores.max() <= 1 and found.person_scores.max() <= 1
    assert len(detector.detect(np.full((90, 50, 3), 128, np.uint8))) == 0
    assert len(make_detector("posenet", max_people=1).detect(np.hstack([image, image]))) == 1


CASES = json.loads((Path(__file__).parent / "reference_poses.json").read_text())["cases"]
STRIDE_PX = 16


def drawn_maps(seed: int, side: int) -> Maps:
    """Maps that say nothing about anybody, drawn at random."""
    rng = np.random.default_rng(seed)
    heat = rng.uniform(0, 1, (17, side, side)).astype(np.float32)
    heat = heat**8 if seed == 3 else heat
    offsets = rng.uniform(-8, 8, (17, side, side, 2)).astype(np.float32)
    to_child, to_parent = (rng.uniform(-60, 60, (16, side, side, 2)).astype(np.float32) for _ in range(2))
    return Maps(heat, offsets, to_child, to_parent)


def maps_of(*people: np.ndarray) -> Maps:
    """Maps that say exactly where people's keypoints (17, 2: x, y) are."""
    side, cells = 16, np.stack(np.meshgrid(np.arange(16), np.arange(16)), axis=-1) * STRIDE_PX
    heat = np.full((17, side, side), 0.01)
    nearest = np.argmin([np.linalg.norm(cells[None] - p[:, None, None], axis=-1) for p in people], axis=0)
    target = np.choose(
        nearest[..., None], [np.broadcast_to(p[:, None, None], (17, 16, 16, 2)) for p in people]
    )
    for order, person in enumerate(people):
        for part, (x, y) in enumerate(np.round(person / STRIDE_PX).astype(int)):
            heat[part, y, x] = 0.9 - 0.1 * order - 0.001 * part
    parents, children = np.array(EDGES).T
    to_child = target_of(people, nearest, children, parents) - target_of(people, nearest, parents, parents)
    to_parent = target_of(people, nearest, parents, children) - target_of(people, nearest, children, children)
    return Maps(heat, target - cells, to_child, to_parent)


def target_of(people, nearest, parts, at):
    """Where `parts` are of the person nearest to each cell with its keypoint of `at`, (16, 16, 16, 2)."""
    chosen = nearest[at]
    return np.choose(
        chosen[..., None], [np.broadcast_to(p[parts][:, None, None], (16, 16, 16, 2)) for p in people]
    )


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"seed {case['seed']}")
def test_it_agrees_with_the_published_decoder_on_random_maps(case):
    rule = DecodingRule(min_root_score=case["min_root_score"])
    positions_px, scores, person_scores = decode(drawn_maps(case["seed"], case["side"]), rule)
    expected = np.array(case["keypoints"])
    np.testing.assert_allclose(positions_px, expected[..., :2], atol=1e-4)
    np.testing.assert_allclose(scores, expected[..., 2], atol=1e-5)
    np.testing.assert_allclose(person_scores, case["person_scores"], atol=1e-5)


def test_a_person_is_walked_to_from_any_root():
    rng = np.random.default_rng(0)
    person = rng.uniform(20, 220, (17, 2))
    for root in range(17):
        maps = maps_of(person)
        cell = maps.cell(*person[root])
        maps.heat[root][cell] = 0.95
        positions_px, scores, _ = decode(maps, DecodingRule())
        np.testing.assert_allclose(positions_px[0], person, atol=1e-9)
        assert scores[0, root] == 0.95


def test_two_people_are_two_and_one_is_one():
    rng = np.random.default_rng(1)
    left = rng.uniform((10, 10), (100, 240), (17, 2))
    right = rng.uniform((140, 10), (235, 240), (17, 2))
    positions_px, _, person_scores = decode(maps_of(left, right), DecodingRule())
    np.testing.assert_allclose(positions_px[:2], [left, right], atol=1e-9)
    assert person_scores[0] > person_scores[1] > 0.5
    assert len(decode(maps_of(left, right), DecodingRule(max_people=1))[2]) == 1


def test_nobody():
    positions_px, scores, person_scores = decode(
        maps_of(np.full((17, 2), 100.0)), DecodingRule(min_root_score=0.99)
    )
    assert positions_px.shape == (0, 17, 2) and scores.shape == (0, 17) and person_scores.shape == (0,)
