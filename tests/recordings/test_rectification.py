"""Alignment of depth: each depth pixel fills what it covers, and the nearest surface counts."""

from __future__ import annotations

import numpy as np
import pytest

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.recordings.rectification import align_depth, undistortion

DEPTH = Camera(8, 6, 8.0, 8.0, 3.5, 2.5)


def test_the_same_camera_sees_the_same():
    depth_m = np.arange(1.0, 49).reshape(6, 8)
    depth_m[2, 3] = np.nan
    depth_m[4, 4] = 0
    np.testing.assert_allclose(align_depth(depth_m, DEPTH, DEPTH, np.eye(4)), np.nan_to_num(depth_m))


def test_a_finer_camera_sees_no_holes():
    fine = Camera(16, 12, 16.0, 16.0, 7.5, 5.5)
    aligned_m = align_depth(np.full((6, 8), 2.0), DEPTH, fine, np.eye(4))
    np.testing.assert_allclose(aligned_m, 2.0)


def test_the_nearest_surface_hides_the_other():
    depth_m = np.full((6, 8), 4.0)
    depth_m[:, 5] = 1.0
    T_color_depth = np.eye(4)
    T_color_depth[0, 3] = -0.25  # what is at 1 m goes two pixels to the left, what is at 4 m half a pixel
    aligned_m = align_depth(depth_m, DEPTH, DEPTH, T_color_depth)
    np.testing.assert_allclose(aligned_m[:, 3], 1.0)


def test_nothing_seen_is_nothing():
    assert not align_depth(np.zeros((6, 8)), DEPTH, DEPTH, np.eye(4)).any()


def test_a_distortion_that_leaves_nothing_of_the_image_is_refused():
    with pytest.raises(InputError, match=r"rec/info: distortion .* leaves 0% of the image"):
        undistortion("rec/info", DEPTH, "plumb_bob", [1e30, 0, 0, 0, 0])
    assert undistortion("rec/info", DEPTH, "plumb_bob", [-0.3, 0.1, 0, 0, 0]).shape[-1] == 2
