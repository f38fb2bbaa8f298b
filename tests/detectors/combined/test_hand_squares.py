"""Squares for the hand model: where they lie, and that points come back exactly."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.detectors.combined.hand_squares import (
    MIN_OBLONG,
    Arms,
    Square,
    SquareRule,
    hand_squares,
    squares_along,
)

IMAGE = np.zeros((300, 400, 3), np.uint8)


def arms(**points) -> Arms:
    names = dict(l_shoulder=5, r_shoulder=6, l_elbow=7, r_elbow=8, l_wrist=9, r_wrist=10)
    keypoints, scores = np.full((1, N_KEYPOINTS, 2), np.nan), np.zeros((1, N_KEYPOINTS))
    for name, point in points.items():
        keypoints[0, names[name]], scores[0, names[name]] = point, 1.0
    return Arms.of(Detections(keypoints, scores, np.ones(1)), SquareRule())


def test_the_square_lies_a_third_of_the_forearm_beyond_the_wrist():
    rule = SquareRule(side=1.5)
    ((person, side, square),) = hand_squares(arms(l_elbow=(100, 100), l_wrist=(160, 100)), rule, IMAGE)
    assert (person, side, square.side_px) == (0, 0, 90)
    middle = np.array([square.left_px, square.top_px]) + (square.side_px - 1) / 2
    np.testing.assert_allclose(middle, (160 + 0.33 * 60, 100), atol=0.5)


def test_a_forearm_that_points_at_the_camera_is_not_taken_for_short():
    front = arms(l_shoulder=(250, 100), r_shoulder=(150, 100), l_elbow=(270, 160), l_wrist=(272, 165))
    upper = np.hypot(20, 60)
    assert front.scales_px[0, 0] == pytest.approx(max(0.9 * upper, 0.6 * 100))
    assert front.scales_px[0, 1] == pytest.approx(60)


def test_without_an_elbow_the_square_lies_around_the_wrist_and_without_a_scale_there_is_none():
    rule = SquareRule(side=1.0)
    shoulders = dict(l_shoulder=(250, 100), r_shoulder=(150, 100))
    ((_, side, square),) = hand_squares(arms(r_wrist=(100, 200), **shoulders), rule, IMAGE)
    assert side == 1
    middle = np.array([square.left_px, square.top_px]) + (square.side_px - 1) / 2
    np.testing.assert_allclose(middle, (100, 200), atol=0.5)
    assert hand_squares(arms(r_wrist=(100, 200)), rule, IMAGE) == []


def test_squares_off_the_image_are_left_out_and_none_is_larger_than_the_image():
    assert hand_squares(arms(l_elbow=(900, 100), l_wrist=(960, 100)), SquareRule(), IMAGE) == []
    wild = hand_squares(arms(l_elbow=(-90_000, 100), l_wrist=(200, 100)), SquareRule(beyond_wrist=0.0), IMAGE)
    assert {square.side_px for _, _, square in wild} == {400}


@given(
    st.integers(-60, 90),
    st.integers(-60, 70),
    st.integers(2, 120),
    st.integers(2, 200),
    st.integers(0, 10_000),
)
def test_what_lies_at_a_pixel_of_the_cut_lies_there_in_the_image(left, top, side, min_side, pick):
    """A blob's centre in the enlarged square maps back onto its centre in the image, to half a pixel."""
    image = np.zeros((80, 100, 3), np.uint8)
    square = Square(left, top, side)
    if not square.overlaps(image):
        return
    inside = [
        (u, v)
        for u in (max(left, 0), min(left + side, 100) - 1)
        for v in (max(top, 0), min(top + side, 80) - 1)
    ]
    u, v = inside[pick % 4]
    image[v, u] = 255
    pixels = square.cut(image, min_side)
    assert pixels.shape == (max(side, min_side),) * 2 + (3,)
    weights = pixels[..., 0].astype(float)
    weights[weights < weights.max()] = 0  # the blob's peak, not the ringing of the interpolation
    peak = np.argwhere(weights).mean(axis=0)[::-1]
    # The peak is known to a pixel of the cut; at the border interpolation draws it outwards.
    at_border = u in (left, left + side - 1) or v in (top, top + side - 1)
    atol = 0.5 if at_border else 0.5 * side / max(side, min_side) + 1e-9
    np.testing.assert_allclose(square.to_image_px(peak, min_side), (u, v), atol=atol)


def test_the_border_of_the_square_is_the_border_of_its_pixels():
    square = Square(10, 20, 50)
    corners = square.to_image_px(np.array([[-0.5, -0.5], [199.5, 199.5]]), 200)
    np.testing.assert_allclose(corners, [[9.5, 19.5], [59.5, 69.5]])


@pytest.mark.parametrize("height, width", [(400, 100), (100, 400), (302, 200), (100, 140)])
def test_squares_along_an_image_cover_it_and_overlap(height, width):
    squares = squares_along(np.zeros((height, width, 3), np.uint8))
    if max(height, width) < MIN_OBLONG * min(height, width):
        assert squares == []
        return
    starts = [max(square.left_px, square.top_px) for square in squares]
    side = min(height, width)
    assert starts[0] == 0 and starts[-1] + side == max(height, width)
    assert max(np.diff(starts)) <= side / 2 + 1
    assert all(square.side_px == side for square in squares)


def test_the_published_numbers():
    """A third of the forearm beyond the wrist, and 0.9 of the upper arm, are OpenPose's."""
    assert (SquareRule().beyond_wrist, SquareRule().forearms_per_upper_arm) == (0.33, 0.9)


def test_a_wrist_at_the_least_score_counts_and_one_below_does_not():
    keypoints, scores = np.zeros((1, N_KEYPOINTS, 2)), np.zeros((1, N_KEYPOINTS))
    scores[0, [9, 10]] = 0.1, np.nextafter(0.1, 0)
    found = Arms.of(Detections(keypoints, scores, np.ones(1)), SquareRule())
    assert np.isfinite(found.wrists_px).all(axis=-1).tolist() == [[True, False]]


def test_an_image_is_oblong_from_three_to_two_on():
    assert squares_along(np.zeros((100, 149, 3))) == []
    assert [square.left_px for square in squares_along(np.zeros((100, 150, 3)))] == [0, 50]
    assert [(s.left_px, s.top_px) for s in squares_along(np.zeros((250, 100, 3)))] == [
        (0, 0), (0, 50), (0, 100), (0, 150)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("left_px", "top_px", "expected"),
    [(-9, 0, True), (-10, 0, False), (399, 0, True), (400, 0, False),
     (0, -9, True), (0, -10, False), (0, 299, True), (0, 300, False)],
)  # fmt: skip
def test_a_square_overlaps_an_image_by_a_pixel_or_not_at_all(left_px, top_px, expected):
    square = Square(left_px, top_px, 10)
    assert square.overlaps(IMAGE) is expected
    if expected:
        assert square.cut(IMAGE + 1, 2).any()
