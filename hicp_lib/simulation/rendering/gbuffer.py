"""The G-buffer: geometry and material of what each pixel shows, where its ray met it."""

from dataclasses import dataclass, fields

import numpy as np

from hicp_lib.simulation.rendering.raycast import RayScene, Trace, dot, interpolate, pick, place
from hicp_lib.simulation.rendering.surfaces import Look


@dataclass(frozen=True)
class GBuffer:
    """Geometry seen at a grid of an image's pixels, of which n are to be shaded.

    Attributes
    ----------
    pixels : array of int, shape (n,)
        Numbers of the n pixels in the grid, row by row.
    surface : array, shape (rows, columns), dtype int16
        What is seen, -1 at pixels that are not to be shaded.
    depth_m : array, shape (rows, columns)
    positions_m : array, shape (3, rows, columns)
        Of what is seen, world frame.
    directions : array, shape (3, n)
        Of the n pixels' rays.
    triangle, barycentric : array, shape (n,) and (n, 2)
        What they met, as in `Trace`.
    """

    pixels: np.ndarray
    surface: np.ndarray
    depth_m: np.ndarray
    positions_m: np.ndarray
    directions: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray

    @classmethod
    def of(
        cls, trace: Trace, centre_m: np.ndarray, directions: np.ndarray, part: tuple[slice, slice], wanted
    ) -> "GBuffer":
        """Some rows and columns of an image, and of these what is wanted.

        Parameters
        ----------
        trace : Trace
            Of the whole image's rays.
        centre_m : array, shape (3,)
            Where the rays begin.
        directions : array, shape (3, height, width)
        part : tuple of slice
            Rows and columns.
        wanted : array of bool, shape (height, width)
            Where nothing was hit, nothing is wanted.
        """
        surface, depth_m, triangle, barycentric = (
            values.reshape(*wanted.shape, *values.shape[1:])[part]
            for values in (trace.surface, trace.depth_m, trace.triangle, trace.barycentric)
        )
        surface = np.where(wanted[part], surface, np.int16(-1))
        pixels = np.flatnonzero(surface.ravel() >= 0)
        depth_m = np.where(surface >= 0, depth_m, np.float32(0))
        rays = np.ascontiguousarray(directions[:, *part])
        positions_m = depth_m * rays + centre_m.astype(np.float32)[:, None, None]
        met = triangle.ravel().take(pixels), barycentric.reshape(-1, 2).take(pixels, axis=0)
        return cls(pixels, surface, depth_m, positions_m, pick(rays.reshape(3, -1), pixels), *met)

    def on_grid(self, values: np.ndarray) -> np.ndarray:
        """Values of the n pixels (k, n) on the grid, (k, rows, columns), zero elsewhere."""
        grid = np.zeros((len(values), self.surface.size), np.float32)
        place(grid, self.pixels, values)
        return grid.reshape(-1, *self.surface.shape)

    def from_grid(self, grid: np.ndarray) -> np.ndarray:
        """Values of the n pixels, (k, n), from the grid's (k, rows, columns)."""
        return pick(grid.reshape(len(grid), -1), self.pixels)


@dataclass(kw_only=True)
class Shading(Look):
    """What a G-buffer's n pixels are shaded by: (3, n) or (n,) each, and their normals."""

    normals: np.ndarray

    def part(self, block: slice) -> "Shading":
        """Some of the pixels."""
        return Shading(**{name: values[..., block] for name, values in vars(self).items()})

    def put(self, rows: np.ndarray, look: Look) -> None:
        """What one surface looks like at some of the pixels."""
        for name, value in vars(look).items():
            target = getattr(self, name)
            if target.ndim == 2 and np.ndim(value):
                place(target, rows, value)
            elif np.ndim(value) or value:
                target[rows] = value


def evaluate_materials(scene: RayScene, gbuffer: GBuffer, pixel_rad: float) -> Shading:
    """Interpolated normals, which face the camera, and what the materials look like.

    Parameters
    ----------
    scene : RayScene
    gbuffer : GBuffer
    pixel_rad : float
        How wide a pixel is, seen from the camera.

    Returns
    -------
    Shading
        Of the G-buffer's n pixels.
    """
    n = len(gbuffer.pixels)
    corners = np.ascontiguousarray(scene.triangles.take(gbuffer.triangle, axis=0).T, np.intp)
    second, third = gbuffer.barycentric.T
    weights = np.stack([1 - second - third, second, third])
    colours = ("albedo", "glow")
    empty = {f.name: np.zeros((3, n) if f.name in colours else n, np.float32) for f in fields(Look)}
    shading = Shading(normals=_normals(scene, gbuffer, corners, weights), **empty)
    surface = gbuffer.surface.ravel().take(gbuffer.pixels)
    footprint_m = gbuffer.depth_m.ravel().take(gbuffer.pixels) * np.float32(pixel_rad)
    order = np.argsort(surface, kind="stable")
    bounds = np.searchsorted(surface, np.arange(len(scene.surfaces) + 1), sorter=order)
    for number in np.flatnonzero(np.diff(bounds)):
        rows = order[bounds[number] : bounds[number + 1]]
        material = scene.surfaces[number].material
        if not isinstance(material, Look):
            local = pick(corners, rows) - scene.first_vertex[number]
            coords = np.ascontiguousarray(scene.surfaces[number].mesh.coords.T, np.float32)
            seen = interpolate(coords, local, pick(weights, rows))
            material = material(seen, footprint_m.take(rows))
        shading.put(rows, material)
    return shading


def _normals(scene: RayScene, gbuffer: GBuffer, corners: np.ndarray, weights: np.ndarray) -> np.ndarray:
    normals = interpolate(scene.normals, corners, weights)
    # Cloth and leaves are seen from both sides.
    away = dot(scene.face_normals.take(gbuffer.triangle, axis=0).T, gbuffer.directions) > 0
    scale = 1 / np.maximum(np.sqrt(dot(normals, normals)), np.float32(1e-9))
    normals *= np.where(away, -scale, scale)
    return normals
