"""camera.json: the intrinsics of a recording's camera, and the scale of its depth images."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json, write_json
from hicp_lib.formats.json_validation import is_number, shown
from hicp_lib.recordings.rectification import undistortion

MAX_SIDE_PX, MAX_PIXELS = 16_384, 2**25  # of images with depth, which are lifted whole
_LEAST_FOCAL, _MOST_FOCAL_PX = 0.05, 6000.0  # minimum, relative to the longer side: a view of 170 degrees
_MAX_SCALE = 1e5  # units of 0.01 mm, of which 16 bits hold 0.65 m
_DISTORTION = re.compile(r"(?i)d|.*(dist|coef).*|k[1-6]|p[12]")  # names of the key in various tools
_LAYOUT = "fx, 0, 0, 0, fy, 0, cx, cy, 1"


def _is_side(value: object) -> bool:
    return is_number(value) and value == int(value) and 1 <= value <= MAX_SIDE_PX


def _is_matrix(value: object) -> bool:
    return isinstance(value, list) and len(value) == 9 and all(map(is_number, value))


_SIDE = f"a whole number from 1 to {MAX_SIDE_PX}, the size of the images in pixels"
_SCALE = f"depth units per metre, 1 to {_MAX_SCALE:g} (1000 for millimetres), or --depth-scale"
_EXPECTED: tuple[tuple[str, Callable[[object], bool], str], ...] = (
    ("width", _is_side, _SIDE), ("height", _is_side, _SIDE),
    ("intrinsic_matrix", _is_matrix, f"nine finite numbers ({_LAYOUT}), column by column"),
    ("depth_scale", lambda of: is_number(of) and 1 <= of <= _MAX_SCALE, _SCALE),
)  # fmt: skip


def read_camera(path: str | Path) -> tuple[Camera, float]:
    """Read camera.json: Open3D's PinholeCameraIntrinsic layout, and `depth_scale`.

    The keys are `width`, `height`, `intrinsic_matrix` (nine numbers column by column: fx, 0, 0, 0, fy,
    0, cx, cy, 1) and `depth_scale`, the number of depth-image units per metre. Others are not read, but
    distortion is refused.

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
        If the file is malformed (the key is named), or if images are distorted.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     write_camera(Path(folder, "camera.json"), Camera(640, 480, 600.0, 600.0, 320.0, 240.0), 1000)
    ...     intrinsics, depth_units_per_m = read_camera(Path(folder, "camera.json"))
    >>> intrinsics.width_px, intrinsics.fx_px, depth_units_per_m
    (640, 600.0, 1000.0)
    """
    intrinsics, depth_units_per_m, pixels_px = read_distorted_camera(path)
    if pixels_px is not None:
        hint = "undistort the images, as `hicp record import` does, and remove the coefficients"
        raise InputError(f"{path}: says that images are distorted; {hint}")
    return intrinsics, depth_units_per_m


def read_distorted_camera(
    path: str | Path, depth_units_per_m: float | None = None
) -> tuple[Camera, float, np.ndarray | None]:
    """Read the file of a camera whose images may be distorted.

    Parameters
    ----------
    path : str or Path
    depth_units_per_m : float, optional
        In place of the file's.

    Returns
    -------
    intrinsics : Camera
    depth_units_per_m : float
    pixels_px : array or None, shape (height, width, 2)
        As from `undistortion`.

    Raises
    ------
    InputError
        If the file is malformed, or the distortion cannot be removed.
    """
    content = read_json(path)
    if not isinstance(content, dict):
        raise InputError(f"{path}: expected an object with width, height, intrinsic_matrix and depth_scale")

    if depth_units_per_m is not None:
        content = content | {"depth_scale": depth_units_per_m}
    for key, is_valid, expected in _EXPECTED:
        if not is_valid(content.get(key)):
            raise InputError(f"{path}: {key}: expected {expected}; found {shown(content.get(key))}")
    focal_and_centre = _focal_and_centre(f"{path}: intrinsic_matrix", content["intrinsic_matrix"])
    intrinsics = Camera(int(content["width"]), int(content["height"]), *focal_and_centre)
    refuse_implausible(str(path), intrinsics)
    return intrinsics, float(content["depth_scale"]), _distortion(path, content, intrinsics)


def refuse_implausible(where: str, camera: Camera) -> None:
    """Refuse an implausible camera, with which lifting could use up all memory.

    Parameters
    ----------
    where : str
        What it was read from, for messages.
    camera : Camera

    Raises
    ------
    InputError
        If its images are too large, its view is wider than 170 degrees, its focal length above 6000 pixels
        (neighbourhoods of keypoints grow with it), or its principal point more than an image away.
    """
    size, focal, centre = np.array(list(vars(camera).values())).reshape(3, 2)
    low, high = _LEAST_FOCAL * size.max(), _MOST_FOCAL_PX
    problems = {
        f"{camera.width_px} x {camera.height_px} pixels; expected up to 32 million": size.prod() > MAX_PIXELS,
        f"focal lengths {focal[0]:g} and {focal[1]:g}; expected {low:g} to {high:g} pixels":
            not (low <= focal.min() and focal.max() <= high),
        f"principal point {centre[0]:g}, {centre[1]:g}; expected pixels in the image":
            not ((-size <= centre) & (centre <= 2 * size)).all(),
    }  # fmt: skip
    for problem, holds in problems.items():
        if holds or size.min() < 1:
            raise InputError(f"{where}: intrinsic_matrix or size is no camera's: {problem}")


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


def _distortion(path: str | Path, content: dict, intrinsics: Camera) -> np.ndarray | None:
    """The model's name and the list of coefficients, from its keys."""
    said = [content[key] for key in content if _DISTORTION.fullmatch(key)]
    model = next((value for value in said if isinstance(value, str)), "")
    numbers = [value for value in said if not isinstance(value, str | None) and value not in (0, [])]
    if len(numbers) > 1 or not all(isinstance(of, list) and all(map(is_number, of)) for of in numbers):
        expected = "a distortion_model and one list coeffs: k1, k2, p1, p2, k3"
        raise InputError(f"{path}: distortion: expected {expected}, found {shown(numbers)}")
    return undistortion(str(path), intrinsics, model, numbers[0] if numbers else [])


def _focal_and_centre(where: str, matrix: list) -> tuple[float, float, float, float]:
    fx, *zeros_x, zero_y, fy, zero_z, cx, cy, one = map(float, matrix)
    if any((*zeros_x, zero_y, zero_z)) or one != 1:
        is_by_rows = matrix[6:] == [0, 0, 1]
        hint = "write the matrix column by column" if is_by_rows else "undistort images with skew first"
        raise InputError(f"{where}: expected {_LAYOUT}, other places hold other numbers; {hint}")
    return fx, fy, cx, cy
