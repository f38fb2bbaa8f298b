"""The G-buffer: geometry and material of what pixels show, where their rays met it."""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from hicp_lib.simulation.rendering.raycast import RayScene, Trace, dot, interpolate, pick
from hicp_lib.simulation.rendering.surfaces import Look


@dataclass(frozen=True)
class View:
    """What the rays through a grid of pixels met.

    Attributes
    ----------
    trace : Trace
        Of the pixels, row by row.
    centre_m : array, shape (3,)
        Where the rays begin, world frame.
    directions : array, shape (3, rows, columns), dtype float32
    """

    trace: Trace
    centre_m: np.ndarray
    directions: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.directions.shape[1:]

    def offsets_m(self, pixels: np.ndarray) -> np.ndarray:
        """From the centre to what is seen at pixels (n,), (3, n)."""
        return self.trace.depth_m.take(pixels, mode="clip") * pick(self.directions.reshape(3, -1), pixels)


@dataclass(frozen=True)
class GBuffer:
    """Geometry seen at n of a view's pixels, surface by surface.

    Attributes
    ----------
    view : View
    pixels : array of int, shape (n,)
        Their numbers in the view, row by row.
    parts : list of tuple
        Numbers of the surfaces that are seen, and which of the n pixels show each.
    """

    view: View
    pixels: np.ndarray
    parts: list[tuple[int, slice]]

    @classmethod
    def of(cls, view: View, wanted: np.ndarray) -> "GBuffer":
        """Of the pixels that are `wanted`, (rows, columns), and show something."""
        pixels = np.flatnonzero(wanted.ravel() & (view.trace.surface >= 0))
        surface = view.trace.surface.take(pixels)
        parts, start = [], 0
        for number, n in enumerate(np.bincount(surface).tolist()):
            if n:
                parts.append((number, slice(start, start + n)))
            start += n
        return cls(view, pixels.take(np.argsort(surface, kind="stable")), parts)

    @cached_property
    def directions(self) -> np.ndarray:
        """Of the pixels' rays, (3, n)."""
        return pick(self.view.directions.reshape(3, -1), self.pixels)

    @cached_property
    def offsets_m(self) -> np.ndarray:
        """From the view's centre to what is seen, (3, n)."""
        return self.depth_m * self.directions

    @property
    def positions_m(self) -> np.ndarray:
        """Of what is seen, world frame, (3, n)."""
        return self.offsets_m + self.view.centre_m[:, None]

    @cached_property
    def depth_m(self) -> np.ndarray:
        """Along the camera's z axis, (n,)."""
        return self.view.trace.depth_m.take(self.pixels)

    @cached_property
    def triangle(self) -> np.ndarray:
        """Number of the triangle that each ray met, (n,)."""
        return self.view.trace.triangle.take(self.pixels)

    @cached_property
    def weights(self) -> np.ndarray:
        """Of the triangles' corners where the rays met them, (n, 3), float32."""
        weights = np.empty((len(self.pixels), 3), np.float32)
        weights[:, 1:] = self.view.trace.barycentric.take(self.pixels, axis=0)
        np.subtract(1 - weights[:, 1], weights[:, 2], out=weights[:, 0])
        return weights

    def normals(self, scene: RayScene) -> np.ndarray:
        """Interpolated between vertices; they face the camera, (3, n)."""
        normals = interpolate(scene.normals, scene.triangles.take(self.triangle, axis=0), self.weights)
        # Cloth and leaves are seen from both sides.
        away = dot(pick(scene.face_normals, self.triangle), self.directions) > 0
        scale = 1 / np.maximum(np.sqrt(dot(normals, normals)), np.float32(1e-9))
        normals *= np.where(away, -scale, scale)
        return normals


@dataclass(kw_only=True)
class Shading(Look):
    """What a G-buffer's n pixels are shaded by: (3, n) or (n,) each, and their normals."""

    normals: np.ndarray

    def part(self, block: slice) -> "Shading":
        """Some of the pixels."""
        return Shading(**{name: values[..., block] for name, values in vars(self).items()})


def evaluate_materials(scene: RayScene, gbuffer: GBuffer, normals: np.ndarray, pixel_rad: float) -> Shading:
    """What the materials look like where rays met them.

    Parameters
    ----------
    scene : RayScene
    gbuffer : GBuffer
    normals : array, shape (3, n)
    pixel_rad : float
        How wide a pixel is, seen from the camera.

    Returns
    -------
    Shading
        Of the G-buffer's n pixels.
    """
    n = len(gbuffer.pixels)
    empty = {
        f.name: np.zeros((3, n) if f.name in ("albedo", "glow") else n, np.float32) for f in fields(Look)
    }
    shading = Shading(normals=normals, **empty)
    for number, part in gbuffer.parts:
        surface = scene.surfaces[number]
        look = surface.material
        if not isinstance(look, Look):
            corners = surface.mesh.triangles.take(
                gbuffer.triangle[part] - scene.first_triangle[number], axis=0
            )
            coords = interpolate(surface.mesh.coords, corners, gbuffer.weights[part])
            look = look(coords, gbuffer.depth_m[part] * np.float32(pixel_rad))
        for name, value in vars(look).items():
            getattr(shading, name)[..., part] = value
    return shading
