"""How much of each light every pixel sees: one ray towards a point of each light, then a filter."""

from __future__ import annotations

import numpy as np

from hicp_lib.simulation import lights
from hicp_lib.simulation.camera import join_rays
from hicp_lib.simulation.filters import View, sum_within
from hicp_lib.simulation.raycast import RayScene, dot, pick

AMBIENT_REACH_M = 0.7
_OFF_SURFACE_M = 0.003  # where rays begin


def visibility(
    sources: list[lights.Light],
    scene: RayScene,
    view: View,
    normals: np.ndarray,
    sharp: bool,
    rng: np.random.Generator,
) -> np.ndarray:
    """Visible share of each light and (last) of the surroundings, (n_lights + 1, n) in [0, 1].

    `normals` are those of all of the view's pixels, (3, rows, columns).
    Half of the pixels are asked, by turns, and the filter fills in the others; in a `sharp`
    view it reaches less far.
    """
    rows, columns = view.surface.shape
    cell = (np.arange(rows)[:, None] % 4 * 4 + np.arange(columns) % 4).astype(np.uint8).ravel()
    turn = (np.arange(rows)[:, None] + np.arange(columns)) % 2
    n_kinds = len(sources) + 1
    counts = np.zeros((n_kinds + 2, rows, columns), np.int16)
    counts[n_kinds:] = turn == 0, turn == 1
    facing_out = view.from_grid(normals)
    origins = view.from_grid(view.positions_m) + np.float32(_OFF_SURFACE_M) * facing_out
    halves = [np.flatnonzero(pick(turn.ravel(), view.pixels) == k) for k in (0, 1)]
    for kind, source in enumerate([*sources, None]):
        asked = halves[kind % 2]
        pixels = view.pixels.take(asked)
        offsets = lights.sample_offsets(cell.take(pixels), kind, rng)
        starts, outwards = pick(origins, asked), pick(facing_out, asked)
        counts[kind].ravel()[pixels] = _sees(scene, source, starts, outwards, offsets)
    sums = sum_within(counts, view.surface, view.positions_m, normals, 2 if sharp else 3)
    sums = view.from_grid(sums).astype(np.float32)
    weights = sums[n_kinds:].take(np.arange(n_kinds) % 2, axis=0)
    return np.where(weights > 0, sums[:n_kinds] / np.maximum(weights, 1), np.float32(1))


def _sees(scene: RayScene, source: lights.Light | None, origins_m, normals, offsets) -> np.ndarray:
    """Whether points (3, n) see a point of a light, or of their surroundings (None); (n,), bool."""
    if source is None:
        return ~scene.occluded(join_rays(origins_m, lights.hemisphere(normals, offsets)), AMBIENT_REACH_M)
    towards = lights.towards_light(source, origins_m, offsets)
    facing = np.flatnonzero(dot(towards, normals) > 0)  # what faces away is dark without asking
    seen = np.ones(len(origins_m.T), bool)
    seen[facing] = ~scene.occluded(join_rays(origins_m, towards).take(facing, axis=0), 0.98)
    return seen
