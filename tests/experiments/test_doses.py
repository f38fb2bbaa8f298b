"""Doses: one thing varied, the rest the same."""

import cv2
import numpy as np
import pytest

from hicp_lib.core.keypoints import COCO_17, INDEX
from hicp_lib.experiments import doses as module
from hicp_lib.simulation.body.identities import Subject

FEW = {"distance": (2.5,), "light": (1.0, 0.01), "hidden": (0.0, 0.5), "resolution": (640, 160),
       "upper part": (1.0, 0.4), "lower part": (1.0, 0.4)}  # fmt: skip


@pytest.fixture(scope="module")
def pictures():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "LEVELS", FEW)
        return {(dose, level): picture for dose, level, picture in module.doses(Subject())}


def rows_of(picture) -> np.ndarray:
    return np.flatnonzero(picture.mask.any(axis=1))


def test_all_doses_start_from_the_same_picture(pictures):
    base = pictures["distance", 2.5].image
    for case in (("light", 1.0), ("hidden", 0.0), ("resolution", 640)):
        np.testing.assert_array_equal(pictures[case].image, base)


def test_the_dark_is_noisy_but_not_darker_and_nothing_moves(pictures):
    bright, dark = pictures["light", 1.0], pictures["light", 0.01]
    patch = slice(200, 260), slice(20, 80)
    grey = [cv2.cvtColor(p.image, cv2.COLOR_RGB2GRAY)[patch].astype(float) for p in (bright, dark)]
    assert grey[1].std() > 3 * grey[0].std() and abs(grey[1].mean() - grey[0].mean()) < 30
    np.testing.assert_array_equal(bright.keypoints_px, dark.keypoints_px)


def test_the_board_hides_the_share_asked_for_from_below(pictures):
    whole, half = rows_of(pictures["hidden", 0.0]), rows_of(pictures["hidden", 0.5])
    assert half[0] == whole[0]
    assert (whole[-1] - half[-1]) / np.ptp(whole) == pytest.approx(0.5, abs=0.03)
    seen = pictures["hidden", 0.5].visibility
    assert seen[INDEX["left_ankle"]] == seen[INDEX["right_knee"]] == 1 and seen[INDEX["nose"]] == 2


def test_a_smaller_picture_is_the_same_view(pictures):
    base, small = pictures["resolution", 640], pictures["resolution", 160]
    assert small.image.shape == (160, 120, 3) and small.area_px2 == pytest.approx(base.area_px2 / 16)
    np.testing.assert_allclose(small.keypoints_px, (base.keypoints_px + 0.5) / 4 - 0.5)


def test_parts_show_what_they_say_and_their_pixels_are_the_pictures(pictures):
    base, upper, lower = pictures["resolution", 640], pictures["upper part", 0.4], pictures["lower part", 0.4]
    height = np.ptp(rows_of(base)) + 1
    for part in (upper, lower):
        assert part.image.shape[0] == pytest.approx(0.4 * height, abs=2)
        assert part.area_px2 == base.area_px2
    assert upper.visibility[INDEX["nose"]] > 0 and not upper.visibility[[15, 16]].any()
    assert lower.visibility[INDEX["left_ankle"]] > 0 and not lower.visibility[:5].any()
    for part in (upper, lower):
        k = COCO_17[part.visibility[COCO_17] > 0][0]
        (u, v), (u0, v0) = (np.round(p.keypoints_px[k]).astype(int) for p in (part, base))
        np.testing.assert_array_equal(part.image[v, u], base.image[v0, u0])
