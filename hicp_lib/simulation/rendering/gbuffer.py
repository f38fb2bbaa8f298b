"""What each pixel of a view shows: geometry and material at the point its ray met."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import partial

import numpy as np

from hicp_lib.simulation.rendering.filters import View
from hicp_lib.simulation.rendering.raycast import RayScene, dot, interpolate, pick, place
from hicp_lib.simulation.rendering.surfaces import Hits, Look


@dataclass
class Looks:
    """How things look at a view's n pixels; components first, (3, n) or (n,). See `surfaces.Look`."""

    normals: np.ndarray
    albedo: np.ndarray
    glow: np.ndarray
    height_m: np.ndarray
    gloss: np.ndarray
    roughness: np.ndarray
    softness: np.ndarray

    def part(self, block: slice) -> Looks:
        """Some of the pixels."""
        return Looks(*(getattr(self, field.name)[..., block] for field in fields(self)))

    def put(self, rows: np.ndarray, look: Look) -> None:
        """What one surface looks like at some of the pixels."""
        for name in ("albedo", "glow"):
            value = getattr(look, name)
            if np.ndim(value):
                place(getattr(self, name), rows, value)
        for name in ("height_m", "gloss", "roughness", "softness"):
            value = getattr(look, name)
            if np.ndim(value) or value:
                getattr(self, name)[rows] = value


def gather_looks(scene: RayScene, view: View, pixel_rad: float) -> Looks:
    """Interpolated normals, which face the camera, and the materials' looks at a view's pixels."""
    n = len(view.pixels)
    corners = np.ascontiguousarray(scene.triangles.take(view.triangle, axis=0).T, np.intp)
    second, third = view.barycentric.T
    weights = np.stack([1 - second - third, second, third])
    looks = Looks(
        _normals(scene, view, corners, weights),
        *(np.zeros((3, n), np.float32) for _ in range(2)),
        *(np.zeros(n, np.float32) for _ in range(4)),
    )
    surface = view.surface.ravel().take(view.pixels)
    footprint_m = view.depth_m.ravel().take(view.pixels) * np.float32(pixel_rad)
    order = np.argsort(surface, kind="stable")
    bounds = np.searchsorted(surface, np.arange(len(scene.surfaces) + 1), sorter=order)
    for number in np.flatnonzero(np.diff(bounds)):
        rows = order[bounds[number] : bounds[number + 1]]
        coords = partial(_coords, scene, number, corners, weights, rows)
        looks.put(rows, scene.surfaces[number].material(Hits(footprint_m.take(rows), coords)))
    return looks


def _normals(scene: RayScene, view: View, corners: np.ndarray, weights: np.ndarray) -> np.ndarray:
    normals = interpolate(scene.normals, corners, weights)
    # Cloth and leaves are seen from both sides.
    away = dot(scene.face_normals.take(view.triangle, axis=0).T, view.directions) > 0
    scale = 1 / np.maximum(np.sqrt(dot(normals, normals)), np.float32(1e-9))
    normals *= np.where(away, -scale, scale)
    return normals


def _coords(scene: RayScene, number: int, corners, weights, rows: np.ndarray) -> np.ndarray:
    """The coords of one surface's mesh, interpolated at some of the hits."""
    local = pick(corners, rows) - scene.first_vertex[number]
    coords = np.ascontiguousarray(scene.surfaces[number].mesh.coords.T, np.float32)
    return interpolate(coords, local, pick(weights, rows))
