"""Smooth edges: where surfaces meet, pixels mix their neighbours' colours by coverage.

Only rays are cast anew, nothing is shaded again: each sub-pixel sample takes the colour of
the neighbouring pixel that shows the same thing.
"""

from __future__ import annotations

import numpy as np

from hicp_lib.simulation.camera import Camera, pixel_rays
from hicp_lib.simulation.raycast import RayScene, Trace

# Rotated grid: four sub-pixel positions with distinct rows and columns.
SAMPLES_PX = np.array([[-0.125, -0.375], [0.375, -0.125], [-0.375, 0.125], [0.125, 0.375]])

AROUND = [(dv, du) for dv in (-1, 0, 1) for du in (-1, 0, 1) if dv or du]  # the eight neighbours


def edge_pixels(trace: Trace, sharp: np.ndarray) -> np.ndarray:
    """Numbers of the pixels at an outline or a step in depth where one side is `sharp`.

    `sharp` is a mask of the image's shape, (height, width).
    """
    shape = sharp.shape
    surface, depth = trace.surface.reshape(shape), trace.depth_m.reshape(shape)
    edge = np.zeros(shape, bool)
    with np.errstate(invalid="ignore"):
        for axis in (0, 1):
            low = tuple(slice(0, -1) if a == axis else slice(None) for a in (0, 1))
            high = tuple(slice(1, None) if a == axis else slice(None) for a in (0, 1))
            step = (surface[low] != surface[high]) | (np.abs(depth[low] - depth[high]) > 0.03 * depth[low])
            step &= sharp[low] | sharp[high]
            edge[low] |= step
            edge[high] |= step
    return np.flatnonzero(edge)


def smooth_edges(
    image: np.ndarray, edges: np.ndarray, trace: Trace, scene: RayScene, camera: Camera
) -> np.ndarray:
    """The image (height, width, 3) with its edge pixels replaced by the mean of four samples."""
    if len(edges) == 0:
        return image
    height, width = image.shape[:2]
    v, u = np.divmod(edges, width)
    where = (np.stack([u, v], axis=1)[:, None] + SAMPLES_PX).astype(np.float32)
    found = scene.trace(pixel_rays(camera, where.reshape(-1, 2)))
    best = np.repeat(edges, len(SAMPLES_PX))
    cost = _difference(trace, best, found)
    open_rows = np.flatnonzero(cost > 0.012)  # the others show what their pixel's middle shows
    v, u, cost = (np.repeat(v, 4)[open_rows], np.repeat(u, 4)[open_rows], cost[open_rows])
    found = found.take(open_rows)
    for dv, du in AROUND:
        near = np.clip(v + dv, 0, height - 1) * width + np.clip(u + du, 0, width - 1)
        other = _difference(trace, near, found) + np.float32(0.002)
        better = np.flatnonzero(other < cost)
        cost[better], best[open_rows[better]] = other[better], near[better]
    flat = image.reshape(-1, 3)
    # Averaged after compression: a bright window does not eat its frame.
    mixed = flat[best] / (1 + flat[best])
    mixed = mixed.reshape(len(edges), len(SAMPLES_PX), 3).mean(axis=1)
    flat[edges] = mixed / (1 - mixed)
    return image


def _difference(trace: Trace, pixels: np.ndarray, found: Trace) -> np.ndarray:
    """How little pixels show what samples found: another surface, another depth, another slant."""
    depth = np.minimum(found.depth_m, 1e3)
    cost = np.abs(np.minimum(trace.depth_m[pixels], 1e3) - depth) / depth
    cost += 10 * (trace.surface[pixels] != found.surface)
    slant = np.einsum("ij,ij->i", trace.face_normals[pixels], found.face_normals)
    return cost + np.float32(0.04) * (1 - slant)
