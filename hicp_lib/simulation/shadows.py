"""How much of each light every pixel sees: one ray towards a point of each light, then a filter."""

from __future__ import annotations

import numpy as np

from hicp_lib.simulation import lights
from hicp_lib.simulation.filters import View, sum_within
from hicp_lib.simulation.raycast import RayScene, dot

AMBIENT_REACH_M = 0.7


def visibility(
    sources: list[lights.Light],
    scene: RayScene,
    view: View,
    positions_m: np.ndarray,
    normals: np.ndarray,
    sharp: bool,
    rng: np.random.Generator,
) -> np.ndarray:
    """Visible share of each light and (last) of the surroundings, (n_lights + 1, n) in [0, 1].

    `positions_m` and `normals` are those of all of the view's pixels, (3, n).
    Half of the pixels are asked, by turns, and the filter fills in the others; in a `sharp`
    view it reaches less far.
    """
    shape = view.wanted.shape
    turn = (np.arange(shape[0])[:, None] + np.arange(shape[1])) & 1
    seen = np.zeros((len(sources) + 1, view.wanted.size), np.float32)
    for kind, source in enumerate([*sources, None]):
        row, column = np.nonzero(view.wanted & (turn == kind % 2))
        pixels = row * shape[1] + column
        offsets = lights.sample_offsets(row + kind, column + 3 * kind, rng)
        facing_out = normals[:, pixels]
        origins = positions_m[:, pixels] + np.float32(0.003) * facing_out
        seen[kind, pixels] = 1
        if source is None:
            seen[kind, pixels] = ~scene.occluded(
                origins.T, lights.hemisphere(facing_out, offsets).T, AMBIENT_REACH_M
            )
            continue
        towards = lights.towards_light(source, origins, offsets)
        facing = np.flatnonzero(dot(towards, facing_out) > 0)  # the rest is dark without asking
        seen[kind, pixels[facing]] = ~scene.occluded(origins[:, facing].T, towards[:, facing].T, 0.98)
    surface = np.where(view.wanted.ravel(), view.trace.surface, -1).reshape(shape)
    positions, directions = (x.reshape(3, *shape) for x in (positions_m, normals))
    asked = np.stack([turn == 0, turn == 1]).astype(np.float32)
    sums = np.concatenate([seen.reshape(-1, *shape), asked])
    sums = sum_within(sums, surface, positions, directions, 2 if sharp else 3)
    weights = sums[-2:][np.arange(len(seen)) % 2]
    return np.where(weights > 0, sums[:-2] / np.maximum(weights, 1e-6), 1).reshape(len(seen), -1)
