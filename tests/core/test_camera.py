"""The pinhole model against its definition, and camera.json from outside."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hicp_lib.core.camera import Camera, deproject, project, transform
from hicp_lib.core.errors import InputError
from hicp_lib.recordings.camera_file import read_camera, write_camera

VGA = Camera(640, 480, 615.0, 613.5, 318.2, 241.7)

fast = settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])

focal, share = st.floats(200, 5_000), st.floats(-1, 2)
cameras = st.builds(
    lambda width, height, fx, fy, u, v: Camera(width, height, fx, fy, u * width, v * height),
    st.integers(1, 4_000), st.integers(1, 4_000), focal, focal, share, share,
)  # fmt: skip
units = st.floats(1, 1e5)


@fast
@given(cameras, st.integers(0, 2**32 - 1))
def test_project_then_deproject_gives_the_point_back(camera, seed):
    points = np.random.default_rng(seed).uniform([-3, -3, 0.1], [3, 3, 8], (50, 3))
    back = deproject(camera, project(camera, points), points[:, 2])
    assert np.abs(back - points).max() <= 1e-9


def test_pinhole_by_hand():
    camera = Camera(640, 480, 600, 300, 320, 240)
    np.testing.assert_allclose(project(camera, [[0.5, 0.5, 2.0], [0, 0, 1]]), [[470, 315], [320, 240]])
    np.testing.assert_allclose(deproject(camera, [470, 315], 2.0), [0.5, 0.5, 2.0])


def test_points_not_in_front_have_no_pixel():
    pixels = project(VGA, [[0, 0, 0], [0.1, 0.1, -1], [0.1, 0.1, np.nan], [0, 0, 1]])
    assert np.isnan(pixels).all(axis=1).tolist() == [True, True, True, False]
    assert np.isnan(deproject(VGA, [[np.nan, 3], [4, 5]], [1.0, np.nan])).any(axis=1).all()


def test_transform_takes_points_from_b_to_a():
    T = np.eye(4)
    T[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    T[:3, 3] = [1, 2, 3]
    np.testing.assert_allclose(transform(T, [1, 0, 0]), [1, 3, 3])
    np.testing.assert_allclose(transform(T, [[1, 0, 0], [0, 1, 0]]), [[1, 3, 3], [0, 2, 3]])
    batch = np.stack([np.eye(4), T])
    np.testing.assert_allclose(transform(batch, [[[1, 0, 0]], [[1, 0, 0]]]), [[[1, 0, 0]], [[1, 3, 3]]])


@fast
@given(cameras, units)
def test_camera_file_round_trip(tmp_path, camera, depth_units_per_m):
    write_camera(tmp_path / "camera.json", camera, depth_units_per_m)
    assert read_camera(tmp_path / "camera.json") == (camera, depth_units_per_m)


def test_camera_file_is_column_major_as_open3d_writes_it(tmp_path):
    open3d = pytest.importorskip("open3d")
    path = tmp_path / "camera.json"
    o3d = open3d.camera.PinholeCameraIntrinsic(640, 480, 615.0, 613.5, 318.2, 241.7)
    open3d.io.write_pinhole_camera_intrinsic(str(path), o3d)
    path.write_text(json.dumps(json.loads(path.read_text()) | {"depth_scale": 1000}))
    assert read_camera(path) == (VGA, 1000.0)
    write_camera(path, VGA, 1000)
    read = open3d.io.read_pinhole_camera_intrinsic(str(path))
    np.testing.assert_array_equal(read.intrinsic_matrix, [[615.0, 0, 318.2], [0, 613.5, 241.7], [0, 0, 1]])


def valid() -> dict:
    matrix = [615.0, 0, 0, 0, 613.5, 0, 318.2, 241.7, 1]
    return {"width": 640, "height": 480, "intrinsic_matrix": matrix, "depth_scale": 1000}


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("width", 0, "whole number"),
        ("width", 640.5, "whole number"),
        ("height", True, "found true"),
        ("height", "480", "the text"),
        ("intrinsic_matrix", [1, 2, 3], "a list of 3"),
        ("intrinsic_matrix", [615, 0, 318, 0, 613, 241, 0, 0, 1], "column by column"),
        ("intrinsic_matrix", [615, 0, 0, 2, 613, 0, 318, 241, 1], "skew"),
        ("intrinsic_matrix", [-615, 0, 0, 0, 613, 0, 318, 241, 1], "expected 32 to 6000 pixels"),
        ("intrinsic_matrix", [float("nan"), 0, 0, 0, 613, 0, 318, 241, 1], "finite"),
        ("depth_scale", 0.001, "1000 for millimetres"),
        ("depth_scale", None, "depth_scale"),
    ],
)
def test_wrong_values_are_named_in_one_line(tmp_path, key, value, says):
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(valid() | {key: value}))
    with pytest.raises(InputError) as caught:
        read_camera(path)
    message = str(caught.value)
    assert says in message and key in message and str(path) in message and "\n" not in message


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20) | st.just(10**400),
    lambda inner: st.lists(inner, max_size=10) | st.dictionaries(st.text(max_size=5), inner, max_size=5),
    max_leaves=12,
)


def read_or_refuse(path: Path) -> None:
    try:
        camera, depth_units_per_m = read_camera(path)
    except InputError as error:
        assert "\n" not in str(error) and str(path) in str(error)
    else:
        assert min(camera.width_px, camera.height_px, camera.fx_px, camera.fy_px) > 0
        assert depth_units_per_m >= 1


@fast
@given(st.sampled_from(sorted(valid())), anything, anything)
def test_malformed_content_only_raises_input_errors(tmp_path, key, value, whole):
    path = tmp_path / "camera.json"
    numbers = valid()["intrinsic_matrix"]
    for content in (valid() | {key: value}, whole, valid() | {"intrinsic_matrix": [*numbers[:8], value]}):
        path.write_text(json.dumps(content))
        read_or_refuse(path)


@fast
@given(st.binary(max_size=60))
def test_malformed_files_only_raise_input_errors(tmp_path, content):
    path = tmp_path / "camera.json"
    path.write_bytes(content)
    read_or_refuse(path)
    path.write_bytes(json.dumps(valid()).encode()[: len(content)])
    read_or_refuse(path)
