"""Undistort images, and align depth to the colour camera."""

import re
from collections.abc import Sequence

import cv2
import numpy as np

from hicp_lib.core.camera import Camera, deproject, project, transform
from hicp_lib.core.errors import InputError

# From undistorted to distorted pixels. librealsense's own functions treat inverse_brown_conrady the same way,
# despite its name: they agree with this within 0.001 pixels, while the inverse differs by more than 5.
_LEAST_SEEN = 0.5  # share of the undistorted image that the distorted one has to show
_MODELS = ("plumb_bob", "brown_conrady", "inverse_brown_conrady", "rational_polynomial")


def undistortion(
    where: str, camera: Camera, model: str, coefficients: Sequence[float] | np.ndarray
) -> np.ndarray | None:
    """Positions in a distorted image of the pixels of an undistorted camera with the same intrinsics.

    Parameters
    ----------
    where : str
        What the coefficients were read from, for messages.
    camera : Camera
    model : str
        Its name in ROS, in librealsense or in OpenCV's documentation.
    coefficients : sequence of float
        k1, k2, p1, p2, k3 and, of a rational polynomial, k4, k5, k6.

    Returns
    -------
    array or None, shape (height, width, 2), dtype float32
        Pixels (u, v) of the distorted image; None if there is no distortion.

    Raises
    ------
    InputError
        If the distortion's model is not supported, or it leaves hardly anything of the image.

    Examples
    --------
    >>> undistortion("a.json", Camera(4, 3, 5.0, 5.0, 1.5, 1.0), "plumb_bob", [0.0] * 5) is None
    True
    """
    numbers = np.array(coefficients, float)
    if not numbers.any():
        return None
    name = re.sub(r"\W+", "_", model.rpartition(".")[2].lower())
    shown = np.array2string(numbers, precision=4, separator=", ")
    if name not in _MODELS or len(numbers) not in (4, 5, 8) or not np.isfinite(numbers).all():
        known = f"what can be undone is {', '.join(_MODELS)} of 4, 5 or 8 numbers"
        raise InputError(f"{where}: distortion {model or 'without a model'} {shown}; {known}; undo it first")
    matrix = np.array([[camera.fx_px, 0, camera.cx_px], [0, camera.fy_px, camera.cy_px], [0, 0, 1]])
    size = camera.width_px, camera.height_px
    pixels_px = cv2.initUndistortRectifyMap(matrix, numbers, None, matrix, size, cv2.CV_32FC2)[0]
    if (share := camera.contains(pixels_px).mean()) < _LEAST_SEEN:
        problem = f"distortion {shown} leaves {share:.0%} of the image"
        raise InputError(f"{where}: {problem}; check the coefficients and the intrinsics")
    return pixels_px


def rectify(image: np.ndarray, pixels_px: np.ndarray | None) -> np.ndarray:
    """Undistort an image: colour interpolated, depth of the nearest pixel; 0 outside the image.

    Parameters
    ----------
    image : array, shape (height, width, 3) or (height, width)
        Colour, or depth.
    pixels_px : array or None, shape (height, width, 2)
        As from `undistortion`.

    Returns
    -------
    array
        Of the image's shape; the image itself without `pixels_px`.
    """
    if pixels_px is None:
        return image
    interpolation = cv2.INTER_LINEAR if image.ndim == 3 else cv2.INTER_NEAREST
    return cv2.remap(image, pixels_px[..., 0], pixels_px[..., 1], interpolation)


def align_depth(depth_m: np.ndarray, camera: Camera, color: Camera, T_color_depth: np.ndarray) -> np.ndarray:
    """Depth as the colour camera would see it.

    Each depth pixel fills the colour pixels whose centres lie between its projected corners, so that surfaces
    have no holes; where several overlap, the nearest is kept. Depth is along the axis of the colour camera.

    Parameters
    ----------
    depth_m : array, shape (height, width)
        0 or NaN where missing.
    camera : Camera
        The depth camera.
    color : Camera
    T_color_depth : array, shape (4, 4)
        From the depth camera's coordinates to the colour camera's.

    Returns
    -------
    array, shape (height of colour, width of colour)
        0 where there is none.
    """
    v, u = np.nonzero(depth_m > 0)
    z_m = depth_m[v, u]

    def seen(offset_px: float) -> tuple[np.ndarray, np.ndarray]:
        points_m = deproject(camera, np.column_stack([u, v]) + offset_px, z_m)
        moved_m = transform(T_color_depth, points_m)
        return np.ceil(np.nan_to_num(project(color, moved_m), nan=-1)), moved_m[:, 2]

    (first, _), (beyond, _), (_, z_color_m) = seen(-0.5), seen(0.5), seen(0)
    size = beyond - first
    aligned_m = np.full((color.height_px, color.width_px), np.inf)
    for step in np.ndindex(*size.max(axis=0, initial=0).astype(int)):
        pixels = first + step
        is_seen = (size > step).all(axis=1) & color.contains(pixels)
        column, row = pixels[is_seen].astype(int).T
        np.minimum.at(aligned_m, (row, column), z_color_m[is_seen])
    return np.where(np.isfinite(aligned_m), aligned_m, 0)
