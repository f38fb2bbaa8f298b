"""camera.json: the intrinsics of a recording's camera, and the scale of its depth images."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json, write_json
from hicp_lib.formats.json_validation import is_number, shown

MAX_SIDE_PX = 100_000
_LAYOUT = "fx, 0, 0, 0, fy, 0, cx, cy, 1"


def read_camera(path: str | Path) -> tuple[Camera, float]:
    """Read camera.json: Open3D's PinholeCameraIntrinsic layout, and `depth_scale`.

    The keys are `width`, `height`, `intrinsic_matrix` (nine numbers column by column: fx, 0, 0, 0, fy,
    0, cx, cy, 1) and `depth_scale`, the number of depth-image units per metre. Others are not read.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    intrinsics : Camera
    depth_units_per_m : float

    Raises
    ------
    InputError
        If the file is not such a file; the key is named.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     write_camera(Path(folder, "camera.json"), Camera(640, 480, 600.0, 600.0, 320.0, 240.0), 1000)
    ...     intrinsics, depth_units_per_m = read_camera(Path(folder, "camera.json"))
    >>> intrinsics.width_px, intrinsics.fx_px, depth_units_per_m
    (640, 600.0, 1000.0)
    """
    content = read_json(path)
    if not isinstance(content, dict):
        raise InputError(f"{path}: expected an object with width, height, intrinsic_matrix and depth_scale")

    def read(key: str, is_valid: Callable[[Any], bool], expected: str, hint: str) -> Any:
        value = content.get(key)
        if not is_valid(value):
            raise InputError(f"{path}: {key}: expected {expected}, found {shown(value)}; {hint}")
        return value

    side = (_is_side, f"a whole number from 1 to {MAX_SIDE_PX}", "give the size of the images in pixels")
    width, height = (int(read(key, *side)) for key in ("width", "height"))
    numbers = (_is_matrix, f"nine finite numbers ({_LAYOUT})", "write the matrix column by column")
    matrix = read("intrinsic_matrix", *numbers)
    intrinsics = Camera(width, height, *_focal_and_centre(f"{path}: intrinsic_matrix", matrix))
    units = "the number of depth units per metre, at least 1"
    scale = read("depth_scale", _is_scale, units, "for depth images in millimetres write 1000")
    return intrinsics, float(scale)


def write_camera(path: str | Path, intrinsics: Camera, depth_units_per_m: float) -> None:
    """Write camera.json as `read_camera` reads it, whole or not at all.

    Parameters
    ----------
    path : str or Path
    intrinsics : Camera
    depth_units_per_m : float
        Of the depth images.
    """
    matrix = [intrinsics.fx_px, 0, 0, 0, intrinsics.fy_px, 0, intrinsics.cx_px, intrinsics.cy_px, 1]
    content = {
        "width": int(intrinsics.width_px),
        "height": int(intrinsics.height_px),
        "intrinsic_matrix": [float(number) for number in matrix],
        "depth_scale": float(depth_units_per_m),
    }
    write_json(path, content, indent=1)


def _is_side(value: object) -> bool:
    return is_number(value) and value == int(value) and 1 <= value <= MAX_SIDE_PX


def _is_scale(value: object) -> bool:
    return is_number(value) and value >= 1


def _is_matrix(value: object) -> bool:
    return isinstance(value, list) and len(value) == 9 and all(map(is_number, value))


def _focal_and_centre(where: str, matrix: list) -> tuple[float, float, float, float]:
    fx, *zeros_x, zero_y, fy, zero_z, cx, cy, one = map(float, matrix)
    if any((*zeros_x, zero_y, zero_z)) or one != 1:
        is_by_rows = matrix[6:] == [0, 0, 1]
        hint = "write the matrix column by column" if is_by_rows else "undistort images with skew first"
        raise InputError(f"{where}: expected {_LAYOUT}, other places hold other numbers; {hint}")
    if min(fx, fy) <= 0:
        wrong = f"expected positive focal lengths, found {fx:g} and {fy:g}"
        raise InputError(f"{where}: {wrong}; give them in pixels")
    return fx, fy, cx, cy
