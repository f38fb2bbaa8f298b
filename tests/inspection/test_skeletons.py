"""Skeletons on pictures: where they belong, in the colour asked for, and nothing else touched."""

import numpy as np
import pytest

from hicp_lib.core.keypoints import INDEX
from hicp_lib.inspection.skeletons import draw_people


def person(**points) -> tuple[np.ndarray, np.ndarray]:
    keypoints, scores = np.full((1, 136, 2), np.nan), np.zeros((1, 136))
    for name, (u, v, score) in points.items():
        keypoints[0, INDEX[name]], scores[0, INDEX[name]] = (u, v), score
    return keypoints, scores


def test_a_keypoint_is_drawn_around_its_pixel_in_its_colour():
    canvas = draw_people(
        np.zeros((60, 80, 3), np.uint8), *person(nose=(30, 20, 1)), "#FF0000", thickness_px=3
    )
    assert canvas[20, 30].tolist() == [255, 0, 0]
    rows, columns = np.nonzero(canvas[..., 0] > 200)
    assert (rows.mean(), columns.mean()) == pytest.approx((20, 30), abs=0.1)


def test_limbs_join_shown_points_only():
    image = np.zeros((60, 80, 3), np.uint8)
    shown = person(left_shoulder=(10, 30, 1), left_elbow=(70, 30, 1))
    weak = person(left_shoulder=(10, 30, 1), left_elbow=(70, 30, 0.05))
    assert draw_people(image, *shown, "#FFFFFF")[30, 40].tolist() == [255, 255, 255]
    assert draw_people(image, *weak, "#FFFFFF")[30, 40].tolist() == [0, 0, 0]


def test_drawing_leaves_the_image_and_survives_wild_points():
    image = np.zeros((20, 20, 3), np.uint8)
    draw_people(image, *person(nose=(1e9, -1e9, 1), left_eye=(-40, 400, 1)), "#FFFFFF")
    assert not image.any()
