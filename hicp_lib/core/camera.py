"""The pinhole camera: points onto pixels, pixels with depth into space.

Camera coordinates: x right, y down, z forward, metres. Pixel centres lie at integers.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hicp_lib.core.images import inside


@dataclass(frozen=True)
class Camera:
    """A pinhole camera without distortion.

    Attributes
    ----------
    width_px, height_px : int
        Size of the image.
    fx_px, fy_px : float
        Focal lengths.
    cx_px, cy_px : float
        Principal point.

    Examples
    --------
    >>> camera = Camera(640, 480, 500.0, 500.0, 319.5, 239.5)
    >>> pixels_px = project(camera, np.array([[0.1, 0.0, 1.0], [0.0, 0.0, -1.0]]))
    >>> pixels_px
    array([[369.5, 239.5],
           [  nan,   nan]])
    >>> camera.contains(pixels_px)
    array([ True, False])
    >>> deproject(camera, pixels_px[0], 1.0).round(9)
    array([0.1, 0. , 1. ])
    """

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float

    def contains(self, pixels_px: np.ndarray) -> np.ndarray:
        """Whether pixels (..., 2) lie in the image (`hicp_lib.core.images.inside`); NaN does not."""
        return inside(pixels_px, (0, 0, self.width_px, self.height_px))


def project(intrinsics: Camera, points_cam_m: np.ndarray) -> np.ndarray:
    """Pixels of camera-frame points.

    Parameters
    ----------
    intrinsics : Camera
        The camera.
    points_cam_m : array, shape (..., 3)
        In its frame.

    Returns
    -------
    array, shape (..., 2)
        (u, v); NaN when not in front (z <= 0).
    """
    x, y, z = np.moveaxis(np.asarray(points_cam_m, float), -1, 0)
    z = np.where(z > 0, z, np.nan)
    u = x / z * intrinsics.fx_px + intrinsics.cx_px
    v = y / z * intrinsics.fy_px + intrinsics.cy_px
    return np.stack([u, v], axis=-1)


def deproject(intrinsics: Camera, pixels_px: np.ndarray, depth_m: ArrayLike) -> np.ndarray:
    """Camera-frame points seen at pixels, at a depth along the camera's z axis.

    The paper's equations (section III-B): x = z (u - cx) / fx, y = z (v - cy) / fy.

    Parameters
    ----------
    intrinsics : Camera
        The camera.
    pixels_px : array, shape (..., 2)
        (u, v).
    depth_m : array, shape (...)
        Along the z axis.

    Returns
    -------
    array, shape (..., 3)
        Metres; NaN where pixel or depth is.
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
    T : array, shape (..., 4, 4)
        Rigid transforms.
    points : array, shape (..., n, 3) or (3,)
        With the leading axes of T, or axes that broadcast with them; (3,) with a single T.

    Returns
    -------
    array
        Of the points' shape, broadcast with T's leading axes.

    Examples
    --------
    >>> T_b_a = np.eye(4)
    >>> T_b_a[:3, 3] = [0, 0, 2]
    >>> transform(T_b_a, np.array([1.0, 0.0, 0.0]))
    array([1., 0., 2.])
    """
    T, points = np.asarray(T, float), np.asarray(points, float)
    rows = np.atleast_2d(points)
    moved = rows @ np.swapaxes(T[..., :3, :3], -1, -2) + T[..., None, :3, 3]
    return moved.reshape(points.shape) if points.ndim == 1 and T.ndim == 2 else moved
