"""Rays against surfaces, through Open3D's RaycastingScene."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields

import cv2
import numpy as np

# Open3D would announce and start its web viewer in every notebook that renders.
os.environ.setdefault("OPEN3D_DISABLE_WEB_VISUALIZER", "true")

import open3d as o3d  # noqa: E402

from hicp_lib.simulation.surfaces import Hits, Surface

N_THREADS = 1  # frames are rendered in parallel by processes; one scene takes calls from one thread only


@dataclass(frozen=True)
class Trace:
    """The first thing each ray met; every array has n rows.

    `depth_m` is the ray parameter (infinite: nothing hit), `triangle` the triangle's number in
    the whole scene (-1: nothing), `surface` the surface's number (-1: nothing), `barycentric`
    the weights of the triangle's second and third corner, `face_normals` its own unit normal.
    """

    depth_m: np.ndarray
    triangle: np.ndarray
    surface: np.ndarray
    barycentric: np.ndarray
    face_normals: np.ndarray

    def part(self, shape: tuple[int, int], pixels: tuple[slice, slice]) -> Trace:
        """Rows and columns of an image's rays; `shape` is the image's (height, width)."""
        return Trace(*(part_of_image(getattr(self, f.name), shape, pixels) for f in fields(self)))

    def take(self, rows: np.ndarray) -> Trace:
        """Some of the rays."""
        return Trace(*(getattr(self, field.name).take(rows, axis=0) for field in fields(self)))

    def between(self, rows: slice) -> Trace:
        """Rays that follow one another, without a copy."""
        return Trace(*(getattr(self, field.name)[rows] for field in fields(self)))

    def put(self, rows: np.ndarray, other: Trace) -> None:
        """Replace some of the rays' answers."""
        for field in fields(self):
            getattr(self, field.name)[rows] = getattr(other, field.name)


class RayScene:
    """Surfaces that rays can be cast at."""

    def __init__(self, surfaces: list[Surface]):
        self.surfaces = surfaces
        n_vertices = [len(s.mesh.vertices_m) for s in surfaces]
        n_triangles = [len(s.mesh.triangles) for s in surfaces]
        first_vertex = np.cumsum([0, *n_vertices])
        self.first_triangle = np.cumsum([0, *n_triangles])
        self.surface_of_triangle = np.repeat(np.arange(len(surfaces), dtype=np.int16), n_triangles)
        vertices = np.concatenate([s.mesh.vertices_m for s in surfaces]).astype(np.float32)
        triangles = np.concatenate(
            [s.mesh.triangles + first for s, first in zip(surfaces, first_vertex, strict=False)]
        ).astype(np.uint32)
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=N_THREADS)
        self._scene.add_triangles(o3d.core.Tensor(vertices), o3d.core.Tensor(triangles))

    def trace(self, rays: np.ndarray) -> Trace:
        """Cast rays, shape (n, 6), float32; their direction's length sets the unit of `depth_m`."""
        answer = self._scene.cast_rays(o3d.core.Tensor(rays), nthreads=N_THREADS)
        depth_m = answer["t_hit"].numpy()
        triangle = answer["primitive_ids"].numpy().astype(np.int32)
        hit = np.isfinite(depth_m)
        triangle[~hit] = -1
        surface = np.where(hit, self.surface_of_triangle[triangle], np.int16(-1))
        barycentric, normals = answer["primitive_uvs"].numpy(), answer["primitive_normals"].numpy()
        return Trace(depth_m, triangle, surface, barycentric, normals)

    def occluded(self, origins_m: np.ndarray, towards_m: np.ndarray, end: float = 1.0) -> np.ndarray:
        """Whether something lies between each origin and ``origin + end * towards``, shape (n,), bool."""
        rays = np.concatenate([origins_m, towards_m], axis=1, dtype=np.float32)
        return self._scene.test_occlusions(
            o3d.core.Tensor(rays), tnear=0.0, tfar=end, nthreads=N_THREADS
        ).numpy()

    def hits(self, trace: Trace, rays: np.ndarray, number: int, pixel_rad: float) -> Hits:
        """Interpolate surface `number`'s mesh where rays (n, 6) met it."""
        mesh = self.surfaces[number].mesh
        local = trace.triangle - self.first_triangle[number]
        corners = np.ascontiguousarray(mesh.triangles[local].T, np.intp)
        second, third = np.ascontiguousarray(trace.barycentric.T)
        weights = (1 - second - third, second, third)
        depth, direction = trace.depth_m, np.ascontiguousarray(rays[:, 3:].T)
        normals = interpolate(mesh.normals, corners, weights)
        # Cloth and leaves are seen from both sides.
        away = dot(trace.face_normals.T, direction) > 0
        normals *= np.where(away, -1, 1).astype(np.float32) / np.maximum(np.sqrt(dot(normals, normals)), 1e-9)
        positions = rays[:, :3].T + depth * direction
        return Hits(positions, normals, interpolate(mesh.coords, corners, weights), local, depth * pixel_rad)


def trace_image(scene: RayScene, rays: np.ndarray, shape: tuple[int, int], fine: np.ndarray) -> Trace:
    """Trace an image's rays (height * width, 6), but not where it is plain.

    Every second row and column is traced. Between four of those that meet one and the same
    triangle the rest is known: 1 / depth is linear over a plane's image. Everything else is
    traced as well, and so is all that lies near surfaces with a true `fine` (one per surface).
    """
    height, width = shape
    every_second = (slice(None, None, 2), slice(None, None, 2))
    coarse = scene.trace(part_of_image(rays, shape, every_second))
    coarse_shape = (-(-height // 2), -(-width // 2))
    triangle = coarse.triangle.reshape(coarse_shape)
    plain = (triangle >= 0) & ~np.append(fine, False)[coarse.surface].reshape(coarse_shape)
    plain[:-1, :-1] &= (triangle[:-1, :-1] == triangle[1:, :-1]) & (triangle[:-1, :-1] == triangle[1:, 1:])
    plain[:-1, :-1] &= triangle[:-1, :-1] == triangle[:-1, 1:]
    plain[-1], plain[:, -1] = False, False
    plain = cv2.erode(plain.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    full = Trace(
        np.empty(height * width, np.float32),
        np.empty(height * width, np.int32),
        np.empty(height * width, np.int16),
        np.zeros((height * width, 2), np.float32),
        np.empty((height * width, 3), np.float32),
    )
    unknown = np.ones(shape, bool)
    for field in fields(full):
        values = getattr(coarse, field.name)
        components = values.shape[1:]
        image = getattr(full, field.name).reshape(*shape, *components)
        image[every_second] = values.reshape(*coarse_shape, *components)
    unknown[every_second] = False
    at = np.flatnonzero(plain)
    row, column = np.divmod(at, coarse_shape[1])
    inverse, met = 1 / coarse.depth_m, coarse.take(at)
    down, right = at + coarse_shape[1], at + 1
    for dv, du, value in (
        (0, 1, (inverse[at] + inverse[right]) / 2),
        (1, 0, (inverse[at] + inverse[down]) / 2),
        (1, 1, (inverse[at] + inverse[down + 1]) / 2),
    ):
        pixels = (2 * row + dv) * width + 2 * column + du
        full.depth_m[pixels], full.triangle[pixels] = 1 / value, met.triangle
        full.surface[pixels], full.face_normals[pixels] = met.surface, met.face_normals
        unknown.ravel()[pixels] = False
    rest = np.flatnonzero(unknown)
    full.put(rest, scene.trace(rays.take(rest, axis=0)))
    return full


def part_of_image(values: np.ndarray, shape: tuple[int, int], pixels: tuple[slice, slice]) -> np.ndarray:
    """Rows and columns of an image kept as one row per pixel, (height * width, ...), kept the same way."""
    chosen = values.reshape(*shape, *values.shape[1:])[pixels]
    return np.ascontiguousarray(chosen).reshape(-1, *values.shape[1:])


def interpolate(values: np.ndarray, corners: np.ndarray, weights: tuple[np.ndarray, ...]) -> np.ndarray:
    """Values per vertex (n_vertices, k) at n places of triangles with corners (3, n): (k, n), float32."""
    result = np.empty((values.shape[1], corners.shape[1]), np.float32)
    for k in range(values.shape[1]):
        component = np.ascontiguousarray(values[:, k], np.float32)
        result[k] = sum(w * component[c] for w, c in zip(weights, corners, strict=True))
    return result


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Dot products of vectors (3, n)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
