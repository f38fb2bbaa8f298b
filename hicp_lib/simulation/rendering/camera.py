"""A pinhole camera: rays through pixels, and points onto pixels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hicp_lib.core.camera import Camera, project
from hicp_lib.simulation.rendering.mesh import unit


@dataclass(frozen=True)
class PlacedCamera(Camera):
    """A pinhole camera somewhere in the world.

    Attributes
    ----------
    T_world_camera : array, shape (4, 4)
        Camera coordinates (x right, y down, z forward, metres) to world coordinates.
    """

    T_world_camera: np.ndarray

    @property
    def centre_m(self) -> np.ndarray:
        """The camera's position in the world, shape (3,)."""
        return self.T_world_camera[:3, 3]


def look_at(eye_m: ArrayLike, target_m: ArrayLike, roll_rad: float = 0.0) -> np.ndarray:
    """Pose of a camera that sees a point in its centre, the world's z axis upwards.

    Parameters
    ----------
    eye_m, target_m : array, shape (3,)
        Where it is, and what it looks at; world frame.
    roll_rad : float, optional
        About the line of sight.

    Returns
    -------
    array, shape (4, 4)
        T_world_camera.

    Examples
    --------
    >>> camera = PlacedCamera(64, 48, 60.0, 60.0, 31.5, 23.5, look_at([0, -3, 1], [0, 0, 1]))
    >>> pixel_px, depth_m = project_world(camera, np.array([0, 0, 1]))
    >>> pixel_px.round(6), float(depth_m)
    (array([31.5, 23.5]), 3.0)
    """
    forward = unit(np.asarray(target_m, float) - np.asarray(eye_m, float))
    right = unit(np.cross(forward, [0.0, 0.0, 1.0]))
    down = np.cross(forward, right)
    cos, sin = np.cos(roll_rad), np.sin(roll_rad)
    T_world_camera = np.eye(4)
    T_world_camera[:3, 0] = cos * right + sin * down
    T_world_camera[:3, 1] = cos * down - sin * right
    T_world_camera[:3, 2] = forward
    T_world_camera[:3, 3] = eye_m
    return T_world_camera


def pixel_rays(camera: PlacedCamera, pixels_px: np.ndarray | None = None) -> np.ndarray:
    """Rays in the world whose parameter is the depth along the camera's z axis.

    Parameters
    ----------
    camera : PlacedCamera
    pixels_px : array, shape (n, 2), optional
        (u, v); all pixel centres, row by row, when left out.

    Returns
    -------
    array, shape (n, 6), dtype float32
        Origin and direction. Directions are not unit vectors: their camera-frame z component
        is 1, so a hit at t lies at depth t.
    """
    if pixels_px is None:
        directions = image_directions(camera).reshape(3, -1)
    else:
        across, down = ray_parts(camera, *np.asarray(pixels_px, np.float32).T)
        directions = across + down
    return join_rays(camera.centre_m, directions)


def image_directions(camera: PlacedCamera) -> np.ndarray:
    """Directions of the rays through all pixel centres, shape (3, height, width), as in `pixel_rays`."""
    across, down = ray_parts(camera, np.arange(camera.width_px), np.arange(camera.height_px))
    return across[:, None, :] + down[:, :, None]


def ray_parts(camera: PlacedCamera, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What columns and rows add to a ray's direction.

    Parameters
    ----------
    camera : PlacedCamera
    u, v : array, shape (n,) and (m,)

    Returns
    -------
    across, down : array, shape (3, n) and (3, m), dtype float32
    """
    x = (u.astype(np.float32) - np.float32(camera.cx_px)) / np.float32(camera.fx_px)
    y = (v.astype(np.float32) - np.float32(camera.cy_px)) / np.float32(camera.fy_px)
    right, down, forward = camera.T_world_camera[:3, :3].astype(np.float32).T[..., None]
    return right * x, down * y + forward


def join_rays(origins_m: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Rays (n, 6), float32, from origins (3,) or (3, n) and directions (3, n)."""
    rays = np.empty((directions.shape[1], 6), np.float32)
    rays[:, :3], rays[:, 3:] = origins_m.T, directions.T
    return rays


def project_world(camera: PlacedCamera, points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Project world points.

    Parameters
    ----------
    camera : PlacedCamera
    points_m : array, shape (..., 3)

    Returns
    -------
    pixels_px : array, shape (..., 2)
        NaN for points not in front of the camera.
    depths_m : array, shape (...)
        Along the camera's z axis.
    """
    in_camera_m = (np.asarray(points_m, float) - camera.centre_m) @ camera.T_world_camera[:3, :3]
    return project(camera, in_camera_m), in_camera_m[..., 2]
