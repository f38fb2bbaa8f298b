"""camera.json: the intrinsics of a recording's camera, and the scale of its depth images."""

from __future__ import annotations

import math
from pathlib import Path

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json, write_json
from hicp_lib.formats.json_validation import shown

MAX_SIDE_PX = 100_000
_LAYOUT = "fx, 0, 0, 0, fy, 0, cx, cy, 1"


def read_camera(path: str | Path) -> tuple[Camera, float]:
    """Read camera.json: Open3D's PinholeCameraIntrinsic layout, and `depth_scale`.

    The keys are `width`, `height`, `intrinsic_matrix` (nine numbers column by column: fx, 0, 0, 0, fy,
    0, cx, cy, 1) and `depth_scale`, the number of depth-image units per metre. Others are not read.

    Returns
    -------
    intrinsics, depth_units_per_m

    Raises
    ------
    InputError
        If the file is not such a file; the key is named.
    """
    content = read_json(path)
    if not isinstance(content, dict):
        raise InputError(f"{path}: expected an object with width, height, intrinsic_matrix and depth_scale")
    width, height = (_side(path, content, key) for key in ("width", "height"))
    fx, fy, cx, cy = _focal_and_centre(path, content)
    return Camera(width, height, fx, fy, cx, cy), _depth_scale(path, content)


def write_camera(path: str | Path, intrinsics: Camera, depth_units_per_m: float) -> None:
    """Write camera.json as `read_camera` reads it, whole or not at all."""
    matrix = [intrinsics.fx_px, 0, 0, 0, intrinsics.fy_px, 0, intrinsics.cx_px, intrinsics.cy_px, 1]
    content = {
        "width": int(intrinsics.width_px),
        "height": int(intrinsics.height_px),
        "intrinsic_matrix": [float(number) for number in matrix],
        "depth_scale": float(depth_units_per_m),
    }
    write_json(path, content, indent=1)


def _side(path: str | Path, content: dict, key: str) -> int:
    value = content.get(key)
    if not _is_number(value) or value != int(value) or not 1 <= value <= MAX_SIDE_PX:
        raise InputError(
            f"{path}: {key}: expected a whole number from 1 to {MAX_SIDE_PX}, found {shown(value)}; "
            "give the size of the images in pixels"
        )
    return int(value)


def _focal_and_centre(path: str | Path, content: dict) -> tuple[float, float, float, float]:
    matrix = content.get("intrinsic_matrix")
    if not isinstance(matrix, list) or len(matrix) != 9 or not all(map(_is_number, matrix)):
        raise InputError(
            f"{path}: intrinsic_matrix: expected nine finite numbers ({_LAYOUT}), found {shown(matrix)}; "
            "write the matrix column by column"
        )
    fx, *zeros_x, zero_y, fy, zero_z, cx, cy, one = map(float, matrix)
    if any((*zeros_x, zero_y, zero_z)) or one != 1:
        by_rows = matrix[6:] == [0, 0, 1]
        raise InputError(
            f"{path}: intrinsic_matrix: expected {_LAYOUT}, other places hold other numbers; "
            + ("write the matrix column by column" if by_rows else "undistort images with skew first")
        )
    if min(fx, fy) <= 0:
        raise InputError(
            f"{path}: intrinsic_matrix: expected positive focal lengths, found {fx:g} and {fy:g}; "
            "give them in pixels"
        )
    return fx, fy, cx, cy


def _depth_scale(path: str | Path, content: dict) -> float:
    value = content.get("depth_scale")
    if not _is_number(value) or value < 1:
        raise InputError(
            f"{path}: depth_scale: expected the number of depth units per metre, at least 1, "
            f"found {shown(value)}; for depth images in millimetres write 1000"
        )
    return float(value)


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond what a float holds
        return False
