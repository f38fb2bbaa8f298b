"""Boxes to crops and back, against the affine transform computed from three points."""

import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hicp_lib.detectors.onnx.fitting import Regions

BOX = st.tuples(*[st.floats(-500, 2000)] * 2, *[st.floats(1, 3000)] * 2)
SIZE = st.sampled_from([(192, 256), (288, 384), (256, 256), (160, 128)])


def three_point_affine(box, size):
    """The documented construction: centre, a point half a width above it, and the third at a right angle."""
    x, y, w, h = box
    aspect = size[0] / size[1]
    w, h = (w, w / aspect) if w > aspect * h else (h * aspect, h)
    w = 1.25 * w
    centre = np.array([x + box[2] / 2, y + box[3] / 2])
    source = [centre, centre + (0, -w / 2), centre + (-w / 2, -0)]
    middle = np.array([size[0] / 2, size[1] / 2])
    target = [middle, middle + (0, -size[0] / 2), middle + (-size[0] / 2, 0)]
    a = np.array([[*p, 1] for p in source])
    return np.linalg.solve(a, np.array(target)).T


@given(box=BOX, size=SIZE, fraction=st.tuples(st.floats(0, 1), st.floats(0, 1)))
def test_a_grid_position_returns_to_where_the_affine_transform_took_it_from(box, size, fraction):
    regions = Regions.around(np.array([box]), size)
    matrix = three_point_affine(box, size)
    position = np.array(fraction) * size
    truth = np.linalg.solve(matrix[:, :2], position - matrix[:, 2])
    for grid in (1, 0.25, 2):  # input pixels, heat map cells, SimCC bins
        got = regions.to_image_px(position[None, None] * grid, np.array(size) * grid)[0, 0]
        assert np.abs(got - truth).max() < 1e-3


@given(box=BOX, size=SIZE, fraction=st.tuples(st.floats(0, 1), st.floats(0, 1)))
def test_with_udp_first_and_last_pixels_of_region_input_and_grid_fall_on_each_other(box, size, fraction):
    """An image point p lies at (p - corner) / extent x (size - 1) of the input, and of any grid likewise."""
    regions = Regions.around(np.array([box]), size, udp=True)
    classic = Regions.around(np.array([box]), size)
    corner = classic.centres_px[0] - classic.sizes_px[0] / 2
    truth = corner + np.array(fraction) * classic.sizes_px[0]
    for grid in (np.array(size), np.array(size) // 4):
        position = np.array(fraction) * (grid - 1)
        assert np.abs(regions.to_image_px(position[None, None], grid)[0, 0] - truth).max() < 1e-3


def test_a_crop_with_udp_shows_the_regions_corners_at_its_own():
    image = np.random.default_rng(0).integers(1, 255, (60, 80, 3), dtype=np.uint8)
    # 64 pixels of the crop over 63 of the image: pixel i is pixel 5 + i.
    regions = Regions(np.array([[5 + 31.5, 3 + 23.5]]), np.array([[63.0, 47.0]]), udp=True)
    np.testing.assert_array_equal(regions.crop(image, (64, 48))[0], image[3:51, 5:69])


@given(box=BOX, size=SIZE)
def test_regions_hold_their_box_and_have_the_inputs_shape(box, size):
    regions = Regions.around(np.array([box]), size)
    corner = regions.centres_px[0] - regions.sizes_px[0] / 2
    assert (corner <= np.array(box[:2]) + 1e-6).all()
    assert (corner + regions.sizes_px[0] >= np.array(box[:2]) + box[2:] - 1e-6).all()
    np.testing.assert_allclose(regions.sizes_px[0, 0] / regions.sizes_px[0, 1], size[0] / size[1])


def test_crop_shows_the_pixels_of_the_region_and_black_beyond_the_image():
    image = np.random.default_rng(0).integers(1, 255, (60, 80, 3), dtype=np.uint8)
    # A region of the input's own size: pixels are copied, none interpolated.
    regions = Regions(np.array([[16.0, 20.0]]), np.array([[64.0, 80.0]]))
    (crop,) = regions.crop(image, (64, 80))
    expected = np.zeros((80, 64, 3), np.uint8)
    # Crop pixel (x, y) is image pixel (x - 16, y - 20).
    expected[20:80, 16:64] = image[0:60, 0:48]
    np.testing.assert_array_equal(crop, expected)


def test_crop_agrees_with_the_three_point_affine_transform():
    image = np.random.default_rng(1).integers(0, 255, (120, 90, 3), dtype=np.uint8)
    for box in [(10.5, 20.25, 31, 77), (-15, 60, 120, 20), (70, 100, 40.5, 40)]:
        (crop,) = Regions.around(np.array([box]), (96, 128)).crop(image, (96, 128))
        truth = cv2.warpAffine(image, three_point_affine(box, (96, 128)), (96, 128), flags=cv2.INTER_LINEAR)
        assert np.abs(crop.astype(int) - truth).max() <= 1


def test_a_box_without_extent_is_one_pixel():
    regions = Regions.around(np.array([[5, 6, 0, 0]]), (192, 256))
    np.testing.assert_allclose(regions.sizes_px, [[1.25, 1.25 * 256 / 192]])
