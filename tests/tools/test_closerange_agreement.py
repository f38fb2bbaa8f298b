"""How networks are held against Thunder on photographs."""

import numpy as np
from closerange.agreement import Case, _headless, agreement

from hicp_lib.core.detections import Detections

SIDE_PX = 200


def person(sure=True):
    """Points one below the other, the nose first, 10 px apart."""
    points = np.stack([np.full(17, 100.0), 10.0 + 10 * np.arange(17)], axis=1)
    return Case("basic", np.zeros((SIDE_PX, SIDE_PX, 3), np.uint8), points, np.full(17, sure))


class Shifted:
    def __init__(self, points, off_px):
        self.points = points + [off_px, 0]

    def detect(self, _image):
        whole = np.full((1, 136, 2), np.nan)
        whole[0, :17] = self.points
        return Detections.of_parts(whole, np.ones((1, 136)), np.ones(1), "halpe136")


def test_the_head_is_cut_off_and_does_not_count():
    whole = person()
    cut = _headless(whole)
    assert cut.crop.shape == (SIDE_PX - 51, SIDE_PX, 3)
    assert not cut.counts[:5].any() and cut.counts[5:].all()
    np.testing.assert_array_equal(cut.keypoints_px[5], [100, 9])


def test_who_shows_no_head_is_not_cut():
    whole = person()
    whole.counts[:5] = False
    assert not _headless(whole).counts.any()


def test_agreement_is_oks():
    whole = person()
    values = [agreement(Shifted(whole.keypoints_px, off), whole) for off in (0, 5, 15, 400)]
    assert values[0] == 1 and values[-1] < 1e-6 and all(np.diff(values) < 0)
    whole.counts[3:] = False
    exact = np.exp(-(5**2) / 2 / 0.53 / SIDE_PX**2 / (2 * np.array([0.026, 0.025, 0.025])) ** 2).mean()
    np.testing.assert_allclose(agreement(Shifted(whole.keypoints_px, 5), whole), exact, rtol=1e-6)
