"""MoveNet's three networks on real weights and rendered people."""

import numpy as np
import pytest

from hicp_lib.detectors.registry import make_detector
from tests.detectors.plain_people import errors_px, render_person

NAMES = ("movenet-thunder", "movenet-lightning", "movenet-multipose")


def box_around(points_px: np.ndarray) -> list[float]:
    low, high = points_px.min(axis=0) - 15, points_px.max(axis=0) + 15
    return [*low, *(high - low)]


@pytest.mark.parametrize("name", NAMES)
def test_rendered_people_are_found_to_a_few_pixels(name):
    errors = errors_px(make_detector(name))
    assert np.median(errors) < 8
    assert np.max(errors[:, [5, 6]]) < 40, "left and right shoulder are 90 px apart"


@pytest.mark.parametrize("name", NAMES)
def test_a_photograph(name, photograph):
    """A portrait, facing the camera: his left shoulder is on the right."""
    found = make_detector(name).detect(photograph)
    best = np.argmax(found.person_scores)
    nose, left_shoulder, right_shoulder = found.keypoints_px[best, [0, 5, 6]]
    assert np.linalg.norm(nose - (270, 225)) < 20
    assert left_shoulder[0] - right_shoulder[0] == pytest.approx(360, abs=60)


@pytest.mark.parametrize("name", NAMES)
def test_a_mirrored_image_gives_mirrored_points(name):
    """What is left of half an input pixel is the network's own bias."""
    swapped = [0, 2, 1, 4, 3, 6, 5, 8, 7, 10, 9, 12, 11]
    off_px = []
    for seed in range(4):
        image, _ = render_person(seed)
        found, mirrored = (
            make_detector(name).detect(view) for view in (image, np.ascontiguousarray(image[:, ::-1]))
        )
        a, b = (one.keypoints_px[one.person_scores.argmax(), :13, 0] for one in (found, mirrored))
        off_px.append((a + b[swapped] - (image.shape[1] - 1)) / 2 * 256 / max(image.shape[:2]))
    assert abs(np.median(off_px)) < 0.6


def test_one_pose_per_box():
    image, truth_px = render_person(0)
    both = np.hstack([image, image])
    width = image.shape[1]
    boxes = np.array([box_around(truth_px[:13])] * 2)
    boxes[1, 0] += width
    detector = make_detector("movenet-thunder", boxes="gt")
    assert detector.takes_boxes
    found = detector.detect(both, boxes)
    assert len(found) == 2
    np.testing.assert_allclose(found.keypoints_px[1, :17] - (width, 0), found.keypoints_px[0, :17], atol=1)
    assert np.median(np.linalg.norm(found.keypoints_px[0, :13] - truth_px[:13], axis=1)) < 8
    assert len(detector.detect(both, np.zeros((0, 4)))) == 0


def test_the_person_finder_finds_both_and_scores_count():
    image, truth_px = render_person(0)
    both = np.hstack([image, image])
    detector = make_detector("movenet-lightning", boxes="detected")
    found = detector.detect(both)
    assert len(found) == 2 and not detector.takes_boxes
    nose_x = np.sort(found.keypoints_px[:, 0, 0])
    np.testing.assert_allclose(nose_x, truth_px[0, 0] + np.array([0, image.shape[1]]), atol=10)
    assert (found.person_scores < found.scores[:, :17].mean(axis=1)).all()
    assert len(detector.detect(np.full((90, 50, 3), 128, np.uint8))) == 0


def test_multipose_finds_two_and_leaves_out_whom_it_doubts():
    image, _ = render_person(0)
    both = np.hstack([image[:, 120:360]] * 2)
    assert (make_detector("movenet-multipose").detect(both).person_scores > 0.3).sum() == 2
    assert len(make_detector("movenet-multipose", min_person_score=0.0).detect(both)) == 6
    assert len(make_detector("movenet-multipose").detect(np.full((90, 50, 3), 128, np.uint8))) == 0
