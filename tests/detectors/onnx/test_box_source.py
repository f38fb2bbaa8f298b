"""The person finder that comes with the library."""

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.detectors.onnx.box_source import BoxSource, NanoDet
from hicp_lib.detectors.registry import make_detector
from tests.detectors.plain_people import render_person


def overlap(a, b) -> float:
    """Intersection over union of two boxes (x, y, width, height)."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    shared = np.minimum(a[:2] + a[2:], b[:2] + b[2:]) - np.maximum(a[:2], b[:2])
    area = np.prod(np.maximum(shared, 0))
    return area / (np.prod(a[2:]) + np.prod(b[2:]) - area)


@pytest.mark.parametrize("seed", range(4))
def test_a_rendered_person_is_in_the_box(seed):
    image, truth_px = render_person(seed)
    boxes_px, scores = NanoDet().find(image)
    assert len(boxes_px) == len(scores) == 1 and 0.3 <= scores[0] <= 1
    low, high = boxes_px[0, :2], boxes_px[0, :2] + boxes_px[0, 2:]
    inside = ((truth_px[:13] > low - 5) & (truth_px[:13] < high + 5)).all(axis=1)
    assert inside.all() and (low >= 0).all() and (high <= image.shape[1::-1]).all()


def test_boxes_move_and_grow_with_the_image():
    image, _ = render_person(0)
    (box,), _ = NanoDet().find(image)
    wide = np.zeros((image.shape[0], 2 * image.shape[1], 3), np.uint8)
    wide[:, image.shape[1] :] = image
    (moved,), _ = NanoDet().find(wide)
    assert overlap(moved - (image.shape[1], 0, 0, 0), box) > 0.85
    (doubled,), _ = NanoDet().find(np.repeat(np.repeat(image, 2, axis=0), 2, axis=1))
    assert overlap(doubled / 2, box) > 0.95


def test_thresholds():
    image, _ = render_person(0)
    assert len(NanoDet(min_score=0.99).find(image)[0]) == 0
    assert len(NanoDet(min_score=0.05, max_overlap=0.99).find(image)[0]) > 1


def test_it_is_what_detects_when_no_other_is_named():
    source = BoxSource(boxes="detected")
    image, _ = render_person(0)
    np.testing.assert_array_equal(source.find(image, None)[0], NanoDet().find(image)[0])
    assert "NanoDet-g" in [fact.value for fact in source.describe()]
    finder, whole = (
        make_detector("movenet-thunder", boxes=boxes).settings for boxes in ("detected", "image")
    )
    assert finder["person_model"]["min_score"] == 0.3 and "person_model" not in whole
    with pytest.raises(InputError, match="boxes 'image': do not use a person model"):
        BoxSource(boxes="image", person_model="yolox.onnx")
