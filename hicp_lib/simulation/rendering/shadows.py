"""Visible fraction of each light: rays towards points of each light, then a filter."""

import numpy as np

from hicp_lib.simulation.rendering import lights
from hicp_lib.simulation.rendering.camera import join_rays
from hicp_lib.simulation.rendering.filters import sum_within
from hicp_lib.simulation.rendering.gbuffer import GBuffer
from hicp_lib.simulation.rendering.raycast import RayScene, dot, pick, place
from hicp_lib.simulation.rendering.surfaces import column

AMBIENT_REACH_M = 0.4
_OFF_SURFACE_M = 0.003  # start of rays
_ROUNDS = 3  # of the filter


def visibility(
    sources: list[lights.Light], scene: RayScene, gbuffers: list[GBuffer], normals: list[np.ndarray]
) -> np.ndarray:
    """Visible share of each light and of the surroundings.

    Every second pixel is sampled, in a checkerboard pattern, and the filter fills in the others.

    Parameters
    ----------
    sources : list of lights.Light
    scene : RayScene
    gbuffers : list of GBuffer
        Parts of one view.
    normals : list of array, shape (3, n)
        Of each.

    Returns
    -------
    array, shape (n_lights + 1, n_pixels), dtype float32
        At all pixels of the view; in [0, 1], the surroundings last.
    """
    view = gbuffers[0].view
    surface = view.trace.surface
    grid = np.zeros((6, surface.size), np.float32)  # positions and normals
    for part, facing in zip(gbuffers, normals, strict=True):
        place(grid, part.pixels, [*part.positions_m, *facing])
    positions_m, facing_out = grid[:3], grid[3:]
    turn = (np.arange(view.shape[0])[:, None] + np.arange(view.shape[1])) % 2 == 0
    pixels = np.flatnonzero(turn.ravel() & (surface >= 0))
    outwards = pick(facing_out, pixels)
    origins_m = pick(positions_m, pixels) + np.float32(_OFF_SURFACE_M) * outwards
    counts = np.zeros((len(sources) + 2, surface.size), np.int16)
    for kind, source in enumerate([*sources, None]):
        offsets = pick(lights.sample_offsets(*view.shape, kind), pixels)
        counts[kind][pixels] = _sees(scene, source, origins_m, outwards, offsets)
    counts[-1][pixels] = 1
    shape = (-1, *view.shape)
    around = surface.reshape(view.shape), positions_m.reshape(shape), facing_out.reshape(shape)
    sums = sum_within(counts.reshape(shape), *around, _ROUNDS)
    *seen, weight = sums.reshape(len(sums), -1).astype(np.float32)
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
    rays = join_rays(pick(origins_m, facing), pick(towards, facing))
    seen[facing] = ~scene.occluded(rays, 0.98)
    return seen
