"""The pinhole camera of a recording: points onto pixels, pixels with depth into space, camera.json.

Camera coordinates: x right, y down, z forward, metres. Pixel centres lie at integers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json, write_json
from hicp_lib.formats.json_validation import shown

MAX_SIDE_PX = 100_000
_LAYOUT = "fx, 0, 0, 0, fy, 0, cx, cy, 1"


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole camera without distortion: image size, focal lengths and principal point."""

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float


def project(intrinsics: Intrinsics, points_cam_m: np.ndarray) -> np.ndarray:
    """Pixels (u, v), shape (..., 2), of camera-frame points (..., 3); NaN when not in front (z <= 0)."""
    x, y, z = np.moveaxis(np.asarray(points_cam_m, float), -1, 0)
    z = np.where(z > 0, z, np.nan)
    u = x / z * intrinsics.fx_px + intrinsics.cx_px
    v = y / z * intrinsics.fy_px + intrinsics.cy_px
    return np.stack([u, v], axis=-1)


def deproject(intrinsics: Intrinsics, pixels_px: np.ndarray, depth_m: np.ndarray) -> np.ndarray:
    """Camera-frame points seen at pixels, at a depth along the camera's z axis.

    The paper's equations (section III-B): x = z (u - cx) / fx, y = z (v - cy) / fy.

    Parameters
    ----------
    pixels_px : array, shape (..., 2), (u, v)
    depth_m : array, shape (...)

    Returns
    -------
    array, shape (..., 3), metres; NaN where pixel or depth is
    """
    u, v = np.moveaxis(np.asarray(pixels_px, float), -1, 0)
    z = np.asarray(depth_m, float)
    x = z * (u - intrinsics.cx_px) / intrinsics.fx_px
    y = z * (v - intrinsics.cy_px) / intrinsics.fy_px
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1)


def transform(T: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points in other coordinates: with T_a_b, from b to a.

    Parameters
    ----------
    T : array, shape (..., 4, 4), rigid transforms
    points : array, shape (..., n, 3) with the leading axes of T (or what broadcasts with them);
        or (3,) with a single T

    Returns
    -------
    array, of the points' shape, broadcast with T's leading axes
    """
    T, points = np.asarray(T, float), np.asarray(points, float)
    rows = np.atleast_2d(points)
    moved = rows @ np.swapaxes(T[..., :3, :3], -1, -2) + T[..., None, :3, 3]
    return moved.reshape(points.shape) if points.ndim == 1 and T.ndim == 2 else moved


def read_camera(path: str | Path) -> tuple[Intrinsics, float]:
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
    return Intrinsics(width, height, fx, fy, cx, cy), _depth_scale(path, content)


def write_camera(path: str | Path, intrinsics: Intrinsics, depth_units_per_m: float) -> None:
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
