"""Antialiasing: at edges of surfaces, pixels mix their neighbours' colours by coverage.

Additional rays are cast, but nothing is shaded again: one ray through each border between two pixels, which
takes the colour of the pixel that shows the same surface. The sample points on a pixel's four borders form a
rotated square, mirrored from pixel to pixel so that neighbours share them (FLIPQUAD: Akenine-Moller, "An
extremely inexpensive multisampling scheme", 2003); its centre is a fifth sample.
"""

import numpy as np

from hicp_lib.simulation.rendering.camera import PlacedCamera, join_rays, ray_parts
from hicp_lib.simulation.rendering.raycast import DEPTH_STEP, RayScene, Trace, dot

_SHIFT_PX = 0.17  # along the border, from its middle


def edge_pixels(trace: Trace, sharp: np.ndarray) -> np.ndarray:
    """Numbers of the pixels at an outline or a step in depth.

    Parameters
    ----------
    trace : Trace
        Of the image's pixels.
    sharp : array of bool, shape (height, width)
        One side of the edge must be.

    Returns
    -------
    array of int, shape (n,)
    """
    shape = sharp.shape
    surface, depth = trace.surface.reshape(shape), trace.depth_m.reshape(shape)
    edge = np.zeros(shape, bool)
    with np.errstate(invalid="ignore"):
        for low, high in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
            step = (surface[low] != surface[high]) | (
                np.abs(depth[low] - depth[high]) > DEPTH_STEP * depth[low]
            )
            step &= sharp[low] | sharp[high]
            edge[low] |= step
            edge[high] |= step
    return np.flatnonzero(edge)


def smooth_edges(
    image: np.ndarray, edges: np.ndarray, trace: Trace, scene: RayScene, camera: PlacedCamera
) -> np.ndarray:
    """Replace edge pixels by the mean of five samples.

    Parameters
    ----------
    image : array, shape (height, width, 3), dtype float32
        Linear RGB; changed in place.
    edges : array of int, shape (n,)
        Numbers of pixels, see `edge_pixels`.
    trace : Trace
        Of the image's pixels.
    scene : RayScene
    camera : PlacedCamera

    Returns
    -------
    array, shape (height, width, 3), dtype float32
        The image.
    """
    if len(edges) == 0:
        return image
    row, column = np.divmod(edges, image.shape[1])
    wide = 2 * image.shape[1] + 1  # row by row, pixels and the borders between them are numbered together
    middle = (2 * row + 1) * wide + 2 * column + 1
    borders, around = np.unique([middle - 1, middle + 1, middle - wide, middle + wide], return_inverse=True)
    shown = _alike(borders, trace, scene, camera)
    flat = image.reshape(-1, 3)
    # Averaged after compression, so that a bright window does not swallow its frame.
    colour, mixed = _compressed(flat.take(shown, axis=0)), _compressed(flat.take(edges, axis=0))
    for numbers in around:
        mixed += colour.take(numbers, axis=0)
    mixed /= 1 + len(around)
    flat[edges] = mixed / (1 - mixed)
    return image


def _compressed(light: np.ndarray) -> np.ndarray:
    return light / (1 + light)


def _alike(borders: np.ndarray, trace: Trace, scene: RayScene, camera: PlacedCamera) -> np.ndarray:
    """Which of the two pixels at each border shows what a ray through the border meets, (n,)."""
    height, width = camera.height_px, camera.width_px
    row, column = np.divmod(borders, 2 * width + 1)
    upright = row % 2 == 1
    # Of the pixel to the right of an upright border, or below a level one.
    row, column = row // 2, column // 2
    shift = _SHIFT_PX * ((row + column) % 2 * 2 - 1)
    u, v = column + np.where(upright, -0.5, -shift), row + np.where(upright, shift, -0.5)
    found = scene.trace(join_rays(camera.centre_m, np.add(*ray_parts(camera, u, v))))
    first, second = (
        np.clip(v, 0, height - 1) * width + np.clip(u, 0, width - 1)
        for v, u in ((row - ~upright, column - upright), (row, column))
    )
    better = _difference(trace, second, found, scene) < _difference(trace, first, found, scene)
    return np.where(better, second, first)


def _difference(trace: Trace, pixels: np.ndarray, found: Trace, scene: RayScene) -> np.ndarray:
    """Difference between pixels and samples: in surface, depth and orientation."""
    depth = np.minimum(found.depth_m, np.float32(1e3))
    cost = np.abs(np.minimum(trace.depth_m.take(pixels), np.float32(1e3)) - depth) / depth
    cost += 10 * (trace.surface.take(pixels) != found.surface)
    seen, met = (
        scene.face_normals.take(triangle, axis=1, mode="wrap")
        for triangle in (trace.triangle.take(pixels), found.triangle)
    )
    return cost + np.float32(0.04) * (1 - dot(seen, met))
