"""Visible fraction of each light at every pixel: one ray towards a point of each light, then a filter."""

import numpy as np

from hicp_lib.simulation.rendering import lights
from hicp_lib.simulation.rendering.camera import join_rays
from hicp_lib.simulation.rendering.filters import sum_within
from hicp_lib.simulation.rendering.gbuffer import GBuffer
from hicp_lib.simulation.rendering.raycast import RayScene, dot, pick
from hicp_lib.simulation.rendering.surfaces import column

AMBIENT_REACH_M = 0.7
_OFF_SURFACE_M = 0.003  # start of rays


def visibility(
    sources: list[lights.Light],
    scene: RayScene,
    gbuffer: GBuffer,
    normals: np.ndarray,
    sharp: bool,
    rng: np.random.Generator,
) -> np.ndarray:
    """Visible share of each light and of the surroundings.

    Every second pixel is sampled, in a checkerboard pattern, and the filter fills in the others.

    Parameters
    ----------
    sources : list of lights.Light
    scene : RayScene
    gbuffer : GBuffer
    normals : array, shape (3, rows, columns)
        Of all pixels of the G-buffer's grid.
    sharp : bool
        Whether to use a smaller filter.
    rng : numpy.random.Generator

    Returns
    -------
    array, shape (n_lights + 1, n), dtype float32
        In [0, 1], the surroundings last.
    """
    row, column = np.arange(gbuffer.surface.shape[0])[:, None], np.arange(gbuffer.surface.shape[1])
    turn = (row + column) % 2 == 0
    asked = np.flatnonzero(turn.ravel().take(gbuffer.pixels))
    pixels = gbuffer.pixels.take(asked)
    cell = (row % 4 * 4 + column % 4).ravel().take(pixels)
    facing_out = pick(normals.reshape(3, -1), pixels)
    origins = pick(gbuffer.positions_m.reshape(3, -1), pixels) + np.float32(_OFF_SURFACE_M) * facing_out
    counts = np.zeros((len(sources) + 2, gbuffer.surface.size), np.int16)
    for kind, source in enumerate([*sources, None]):
        offsets = lights.sample_offsets(cell, kind, rng)
        counts[kind][pixels] = _sees(scene, source, origins, facing_out, offsets)
    counts[-1] = turn.ravel()
    counts = counts.reshape(-1, *gbuffer.surface.shape)
    sums = sum_within(counts, gbuffer.surface, gbuffer.positions_m, normals, 2 if sharp else 3)
    *seen, weight = gbuffer.from_grid(sums).astype(np.float32)
    return np.where(weight > 0, np.stack(seen) / np.maximum(weight, 1), np.float32(1))


def _sees(scene: RayScene, source: lights.Light | None, origins_m, normals, offsets) -> np.ndarray:
    """Whether points (3, n) see a point of a light, or of their surroundings (None); (n,), bool."""
    if source is None:  # cosine-distributed directions about the normals
        angle, z = np.float32(2 * np.pi) * offsets[0], 1 - 2 * offsets[1]
        radius = np.float32(0.98) * np.sqrt(np.maximum(1 - z * z, 0))
        around = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.float32(0.98) * z])
        return ~scene.occluded(join_rays(origins_m, normals + around), AMBIENT_REACH_M)
    s, t = 2 * offsets - 1
    towards = column(source.centre_m) + s * column(source.half_u_m) + t * column(source.half_v_m) - origins_m
    facing = np.flatnonzero(dot(towards, normals) > 0)  # pixels facing away are dark without a ray
    seen = np.ones(len(origins_m.T), bool)
    seen[facing] = ~scene.occluded(join_rays(origins_m, towards).take(facing, axis=0), 0.98)
    return seen
