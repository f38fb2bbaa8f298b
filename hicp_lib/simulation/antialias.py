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
MAX_PIXELS = 40_000


def edge_pixels(trace: Trace, shape: tuple[int, int]) -> np.ndarray:
    """Numbers of the pixels at an outline, a step in depth or a crease."""
    surface, depth = trace.surface.reshape(shape), trace.depth_m.reshape(shape)
    normals = trace.face_normals.reshape(*shape, 3)
    edge = np.zeros(shape, bool)
    with np.errstate(invalid="ignore"):
        for axis in (0, 1):
            low = tuple(slice(0, -1) if a == axis else slice(None) for a in (0, 1))
            high = tuple(slice(1, None) if a == axis else slice(None) for a in (0, 1))
            step = (surface[low] != surface[high]) | (np.abs(depth[low] - depth[high]) > 0.02 * depth[low])
            step |= np.einsum("ijk,ijk->ij", normals[low], normals[high]) < 0.5
            edge[low] |= step
            edge[high] |= step
    return np.flatnonzero(edge)


def smooth_edges(
    image: np.ndarray, edges: np.ndarray, trace: Trace, scene: RayScene, camera: Camera
) -> np.ndarray:
    """The image with its edge pixels replaced by the mean of four samples."""
    if len(edges) == 0:
        return image
    height, width = image.shape[:2]
    v, u = np.divmod(edges, width)
    where = np.stack([u, v], axis=1)[:, None] + SAMPLES_PX
    found = scene.trace(pixel_rays(camera, where.reshape(-1, 2)))
    n_samples = len(SAMPLES_PX)
    best_cost = np.full(len(edges) * n_samples, np.inf, np.float32)
    best = np.repeat(edges, n_samples)
    depth = np.where(np.isfinite(found.depth_m), found.depth_m, 1e3)
    for dv in (0, -1, 1):
        for du in (0, -1, 1):
            near = np.clip(v + dv, 0, height - 1) * width + np.clip(u + du, 0, width - 1)
            near = np.repeat(near, n_samples)
            near_depth = trace.depth_m[near]
            cost = np.abs(np.where(np.isfinite(near_depth), near_depth, 1e3) - depth) / depth
            cost += 10 * (trace.surface[near] != found.surface)
            cost += 0.2 * (1 - np.einsum("ij,ij->i", trace.face_normals[near], found.face_normals))
            cost += 0.002 * (abs(du) + abs(dv))
            better = cost < best_cost
            best_cost[better], best[better] = cost[better], near[better]
    flat = image.reshape(-1, 3)
    # Averaged after compression: a bright window does not eat its frame.
    mixed = flat[best] / (1 + flat[best])
    mixed = mixed.reshape(len(edges), n_samples, 3).mean(axis=1)
    result = flat.copy()
    result[edges] = mixed / (1 - mixed)
    return result.reshape(image.shape)
