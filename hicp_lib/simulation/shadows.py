"""How much of each light every pixel sees: rays towards points of the lights, then a filter.

People are asked at every pixel; the rest of the picture at every second row and column.
"""

from __future__ import annotations

import numpy as np

from hicp_lib.simulation import lights
from hicp_lib.simulation.filters import Looks, mean_within
from hicp_lib.simulation.raycast import RayScene, Trace

AMBIENT_REACH_M = 0.7


def visibility(
    sources: list[lights.Light],
    scene: RayScene,
    trace: Trace,
    looks: Looks,
    is_person: np.ndarray,
    shape: tuple[int, int],
    rng: np.random.Generator,
) -> np.ndarray:
    """Visible share of each light and (last) of the surroundings, (n_lights + 1, n) in [0, 1]."""
    v, u = np.mgrid[: shape[0] : 2, : shape[1] : 2]
    coarse = _sampled(sources, scene, trace, looks, v * shape[1] + u, 2, 3, shape[1], rng)
    seen = _enlarge(coarse, trace, shape)
    rows, columns = (np.flatnonzero(is_person.reshape(shape).any(axis=axis)) for axis in (1, 0))
    if len(rows):
        v, u = np.mgrid[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        where = v * shape[1] + u
        fine = _sampled(sources, scene, trace, looks, where, 1, 1, shape[1], rng, is_person[where])
        person = is_person[where]
        seen[:, where[person]] = fine[:, person]
    return seen


def _sampled(
    sources: list[lights.Light],
    scene: RayScene,
    trace: Trace,
    looks: Looks,
    where: np.ndarray,
    step: int,
    passes: int,
    width: int,
    rng: np.random.Generator,
    wanted: np.ndarray | None = None,
) -> np.ndarray:
    """Filtered visibility on a grid of pixel numbers `where` (rows, columns): (kinds, rows, columns)."""
    surface = trace.surface[where]
    asked = surface >= 0 if wanted is None else wanted
    pixels = where[asked]
    row, column = pixels // width // step, pixels % width // step
    normals = looks.normals[:, pixels]
    origins = looks.positions_m[:, pixels] + np.float32(0.003) * normals
    seen = np.ones((len(sources) + 1, *where.shape), np.float32)
    for kind, source in enumerate([*sources, None]):
        offsets = lights.sample_offsets(row + kind, column + 2 * kind, rng)
        if source is not None:
            towards, end = lights.towards_light(source, origins, offsets), 0.98
        else:
            towards, end = lights.hemisphere(normals, offsets), AMBIENT_REACH_M
        seen[kind, asked] = ~scene.occluded(origins.T, towards.T, end)
    for _ in range(passes):
        seen = mean_within(seen, surface, looks.positions_m[:, where], looks.normals[:, where])
    return seen


def _enlarge(coarse: np.ndarray, trace: Trace, shape: tuple[int, int]) -> np.ndarray:
    """From every second pixel to all; at edges, from the nearest that shows the same thing."""
    kinds, rows, columns = coarse.shape
    full = np.repeat(np.repeat(coarse, 2, axis=1), 2, axis=2)[:, : shape[0], : shape[1]].reshape(kinds, -1)
    v, u = np.mgrid[: shape[0], : shape[1]]
    source = ((v // 2) * 2 * shape[1] + (u // 2) * 2).ravel()
    with np.errstate(invalid="ignore"):
        far = np.abs(trace.depth_m[source] - trace.depth_m) > 0.03 * trace.depth_m
    wrong = np.flatnonzero((trace.surface[source] != trace.surface) | far)
    v, u = wrong // shape[1] // 2, wrong % shape[1] // 2
    best, cost = source[wrong], np.full(len(wrong), np.inf)
    for dv in (-1, 0, 1):
        for du in (-1, 0, 1):
            r, c = np.clip(v + dv, 0, rows - 1), np.clip(u + du, 0, columns - 1)
            near = 2 * r * shape[1] + 2 * c
            with np.errstate(invalid="ignore"):
                gap = np.abs(trace.depth_m[near] - trace.depth_m[wrong]) + 100 * (trace.surface[near] != trace.surface[wrong])
            better = gap < cost
            best[better], cost[better] = (r * columns + c)[better], gap[better]
    full[:, wrong] = coarse.reshape(kinds, -1)[:, np.where(np.isfinite(cost), best, 0)]
    return full
