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
        ([600, 0, 0, 0, 610, 0, 320, 240], "nine finite numbers"),
        ([600, 0, 0, 0, 610, 0, 320, "240", 1], "nine finite numbers"),
    ],
)
def test_what_is_wrong_with_a_matrix_is_told(tmp_path, matrix, hint):
    with pytest.raises(InputError, match=f"intrinsic_matrix: .*{hint}"):
        read(tmp_path, intrinsic_matrix=matrix)


@pytest.mark.parametrize(
    ("key", "wrong"),
    [
        *(("width", of) for of in (0, -5, 640.5, 16_385, 10**400, True, None)),
        ("height", 0),
        *(("depth_scale", of) for of in (0.99, 0, -1000, 100_001, 1e9, float("nan"), "1000")),
    ],
)
def test_sizes_and_scales_that_none_are_are_named(tmp_path, key, wrong):
    with pytest.raises(InputError, match=f"{key}: expected "):
        read(tmp_path, **{key: wrong})


def matrix(fx=600.0, fy=610.0, cx=320.0, cy=240.0):
    return {"intrinsic_matrix": [fx, 0, 0, 0, fy, 0, cx, cy, 1]}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            {"width": 16_384, "height": 16_384} | matrix(cx=8000, cy=8000),
            "16384 x 16384 pixels; expected up to",
        ),
        (matrix(fx=1e7), "focal lengths 1e.07 and 610; expected 32 to 6000 pixels"),
        (matrix(fy=0), "focal lengths 600 and 0;"),
        (matrix(fx=-600), "focal lengths -600 and 610;"),
        (matrix(fx=31.9), "focal lengths 31.9 and 610"),
        (matrix(fy=6001), "focal lengths 600 and 6001"),
        (matrix(cx=1281), "principal point 1281, 240"),
        (matrix(cy=-481), "principal point 320, -481"),
    ],
)
def test_intrinsics_that_no_camera_has_are_refused(tmp_path, change, said):
    with pytest.raises(InputError, match=said):
        read(tmp_path, **change)


@pytest.mark.parametrize("change", [matrix(fx=32, fy=6000), matrix(cx=1280, cy=-480), {"depth_scale": 1e5}])
def test_intrinsics_at_the_edge_of_what_cameras_have_are_read(tmp_path, change):
    read(tmp_path, **change)


def test_a_number_that_no_float_holds_is_none():
    assert not is_number(10**400) and is_number(10**300)


def test_what_is_written_is_the_layout_others_read(tmp_path):
    path = tmp_path / "camera.json"
    write_camera(path, Camera(640, 480, 600.0, 610.0, 320.0, 240.0), 1000)
    assert json.loads(path.read_text()) == SOUND
    assert path.read_text().splitlines()[1] == ' "width": 640,'
