"""Looks that are kept: the same answer, asked once."""

import numpy as np
import pytest

from hicp_lib.detectors.base import Detections
from hicp_lib.detectors.combined import Combined
from hicp_lib.detectors.kept import Kept
from hicp_lib.keypoints import N_KEYPOINTS


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path))


class Counting:
    """Finds one person whose nose lies where the brightest pixel is; counts how often it is asked."""

    def __init__(self, name: str = "counting") -> None:
        self.name, self.settings, self.calls = name, {"kind": name}, 0

    def detect(self, image):
        self.calls += 1
        found = np.full((1, N_KEYPOINTS, 2), np.nan)
        found[0, 0] = np.unravel_index(image[..., 0].argmax(), image.shape[:2])[::-1]
        scores = np.where(np.isfinite(found[..., 0]), 0.5, 0.0)
        return Detections(found, scores, np.ones(1))


def picture(u: int, v: int, shape=(40, 60)) -> np.ndarray:
    image = np.zeros((*shape, 3), np.uint8)
    image[v, u] = 255
    return image


def test_the_same_pixels_are_looked_at_once():
    detector = Counting()
    kept = Kept(detector)
    first, again = kept.detect(picture(5, 7)), kept.detect(picture(5, 7))
    assert detector.calls == 1
    assert np.array_equal(first.keypoints_px, again.keypoints_px, equal_nan=True)
    assert Kept(detector).detect(picture(5, 7)).scores[0, 0] == 0.5 and detector.calls == 1


def test_other_pixels_shapes_and_detectors_are_not_mistaken_for_each_other():
    detector = Counting()
    kept = Kept(detector)
    kept.detect(picture(5, 7))
    kept.detect(picture(6, 7))
    kept.detect(np.zeros((40, 60, 3), np.uint8))
    kept.detect(np.zeros((60, 40, 3), np.uint8))
    assert detector.calls == 4
    other = Counting("another")
    assert Kept(other).detect(picture(5, 7)).keypoints_px[0, 0].tolist() == [5, 7] and other.calls == 1


def test_a_combination_finds_the_same_with_and_without_keeping_and_looks_at_nothing_twice():
    body, hands = Counting("body"), Counting("hands")
    image = picture(20, 30, (200, 300))
    plain = Combined(Counting("body"), Counting("hands")).detect(image)
    for _ in range(2):
        found = Combined(body, hands, keep_looks=True).detect(image)
        assert np.array_equal(found.keypoints_px, plain.keypoints_px, equal_nan=True)
    calls = hands.calls
    assert body.calls == 1
    Combined(body, hands, looks="image", arbitrate=False, keep_looks=True).detect(image)
    assert (body.calls, hands.calls) == (1, calls)
    plain, kept = (Combined(body, hands, keep_looks=keep).settings for keep in (False, True))
    assert plain == kept  # the same results, under the same key
