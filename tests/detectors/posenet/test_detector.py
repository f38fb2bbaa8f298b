"""PoseNet on real weights and rendered people."""

import numpy as np

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
