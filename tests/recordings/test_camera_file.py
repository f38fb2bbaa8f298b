"""camera.json: what is read, and which hint belongs to what is wrong."""

import json

import pytest

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.formats.json_validation import is_number
from hicp_lib.recordings.camera_file import read_camera, write_camera

SOUND = {
    "width": 640, "height": 480, "depth_scale": 1000,
    "intrinsic_matrix": [600, 0, 0, 0, 610, 0, 320, 240, 1],
}  # fmt: skip


def read(tmp_path, **changes):
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(SOUND | changes))
    return read_camera(path)


def test_the_matrix_is_read_column_by_column(tmp_path):
    camera, depth_units_per_m = read(tmp_path)
    assert (camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px) == (600, 610, 320, 240)
    assert (camera.width_px, camera.height_px, depth_units_per_m) == (640, 480, 1000)


@pytest.mark.parametrize(
    ("matrix", "hint"),
    [
        ([600, 0, 320, 0, 610, 240, 0, 0, 1], "write the matrix column by column"),
        ([600, 0, 0, 2, 610, 0, 320, 240, 1], "undistort images with skew first"),
        ([600, 0, 0, 0, 610, 0, 320, 240, 2], "undistort images with skew first"),
        ([600, 0, 0, 0, 610, 5, 320, 240, 1], "undistort images with skew first"),
        ([600, 0, 320, 0, 610, 240, 0, 0, 2], "undistort images with skew first"),
        ([600, 0, 0, 0, 0, 0, 320, 240, 1], "expected positive focal lengths, found 600 and 0"),
        ([-600, 0, 0, 0, 610, 0, 320, 240, 1], "expected positive focal lengths, found -600 and 610"),
        ([600, 0, 0, 0, 610, 0, 320, 240], "nine finite numbers"),
        ([600, 0, 0, 0, 610, 0, 320, "240", 1], "nine finite numbers"),
    ],
)
def test_what_is_wrong_with_a_matrix_is_told(tmp_path, matrix, hint):
    with pytest.raises(InputError, match=f"intrinsic_matrix: .*{hint}"):
        read(tmp_path, intrinsic_matrix=matrix)


@pytest.mark.parametrize(
    ("key", "most_wrong", "least"), [("width", 0, 1), ("height", 0, 1), ("depth_scale", 0.99, 1)]
)
def test_sizes_and_scales_begin_at_one(tmp_path, key, most_wrong, least):
    read(tmp_path, **{key: least})
    with pytest.raises(InputError, match=f"{key}: expected "):
        read(tmp_path, **{key: most_wrong})


def test_images_have_at_most_a_hundred_thousand_pixels_a_side(tmp_path):
    assert read(tmp_path, width=100_000)[0].width_px == 100_000
    for width in (100_001, 640.5, True, None):
        with pytest.raises(InputError, match="width: expected a whole number from 1 to 100000"):
            read(tmp_path, width=width)


def test_a_number_that_no_float_holds_is_none():
    assert not is_number(10**400) and is_number(10**300)


def test_what_is_written_is_the_layout_others_read(tmp_path):
    path = tmp_path / "camera.json"
    write_camera(path, Camera(640, 480, 600.0, 610.0, 320.0, 240.0), 1000)
    assert json.loads(path.read_text()) == SOUND
    assert path.read_text().splitlines()[1] == ' "width": 640,'


def test_any_positive_focal_length_is_one(tmp_path):
    assert read(tmp_path, intrinsic_matrix=[0.5, 0, 0, 0, 0.25, 0, 320, 240, 1])[0].fy_px == 0.25
