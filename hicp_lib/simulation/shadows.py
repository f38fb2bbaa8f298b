"""How much of each light every pixel sees: one ray towards a point of each light, then a filter."""

from __future__ import annotations

import numpy as np

from hicp_lib.simulation import lights
from hicp_lib.simulation.filters import Looks, View, mean_within
from hicp_lib.simulation.raycast import RayScene, dot

AMBIENT_REACH_M = 0.7


def visibility(
    sources: list[lights.Light], scene: RayScene, view: View, looks: Looks, passes: int, rng: np.random.Generator
) -> np.ndarray:
    """Visible share of each light and (last) of the surroundings, (n_lights + 1, n) in [0, 1].

    More `passes` of the filter make shadows smoother and their edges softer.
    """
    shape = view.wanted.shape
    pixels = np.flatnonzero(view.wanted)
    row, column = np.divmod(pixels, shape[1])
    normals = looks.normals[:, pixels]
    origins = looks.positions_m[:, pixels] + np.float32(0.003) * normals
    seen = np.ones((len(sources) + 1, view.wanted.size), np.float32)
    for kind, source in enumerate([*sources, None]):
        offsets = lights.sample_offsets(row + kind, column + 2 * kind, rng)
        if source is None:
            seen[kind, pixels] = ~scene.occluded(origins.T, lights.hemisphere(normals, offsets).T, AMBIENT_REACH_M)
            continue
        towards = lights.towards_light(source, origins, offsets)
        facing = np.flatnonzero(dot(towards, normals) > 0)  # the rest is dark without asking
        seen[kind, pixels[facing]] = ~scene.occluded(origins[:, facing].T, towards[:, facing].T, 0.98)
    surface = np.where(view.wanted.ravel(), view.trace.surface, -1).reshape(shape)
    positions, directions = (x.reshape(3, *shape) for x in (looks.positions_m, looks.normals))
    seen = seen.reshape(-1, *shape)
    for _ in range(passes):
        seen = mean_within(seen, surface, positions, directions)
    return seen.reshape(len(seen), -1)
