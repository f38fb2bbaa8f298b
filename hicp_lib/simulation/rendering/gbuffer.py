"""The G-buffer: geometry and material of what pixels show, where their rays met it."""

from dataclasses import dataclass, fields

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
        """From the centre to what is seen at pixels (n,), (3, n); 1 km away where nothing is."""
        depth_m = np.minimum(self.trace.depth_m.take(pixels, mode="clip"), np.float32(1e3))
        return depth_m * pick(self.directions.reshape(3, -1), pixels)


def from_half(values: np.ndarray, half: View, view: View, pixels: np.ndarray) -> np.ndarray:
    """Values at every second row and column, interpolated to pixels within the surfaces these show.

    Parameters
    ----------
    values : array, shape (k, n_half), dtype float32
    half, view : View
        The first is every second row and column of the other.
    pixels : array of int, shape (n,)
        Numbers in the view.

    Returns
    -------
    array, shape (k, n), dtype float32
        Where no neighbour shows a pixel's surface, that of the nearest.
    """
    row, column = np.divmod(pixels, view.shape[1])
    surface = view.trace.surface.take(pixels)
    total = np.float32(1e-3) * pick(values, row // 2 * half.shape[1] + column // 2)
    weight = np.full(len(row), 1e-3, np.float32)
    for below in (0, 1):
        start = np.minimum((row + below) // 2, half.shape[0] - 1) * half.shape[1]
        for right in (0, 1):
            near = start + np.minimum((column + right) // 2, half.shape[1] - 1)
            alike = half.trace.surface.take(near) == surface
            total += alike * pick(values, near)
            weight += alike
    return total / weight


class GBuffer:
    """Geometry seen at n of a view's pixels, surface by surface.

    Parameters
    ----------
    view : View
    wanted : array of bool, shape (rows, columns)
        Pixels that count if they show something.

    Attributes
    ----------
    pixels : array of int, shape (n,)
        Their numbers in the view, row by row.
    parts : list of tuple
        Numbers of the surfaces that are seen, and which of the n pixels show each.
    directions, offsets_m : array, shape (3, n)
        Of the pixels' rays, and from the view's centre to what they met.
    depth_m : array, shape (n,)
        Along the camera's z axis.
    triangle, weights : array, shape (n,) and (n, 3)
        What they met, and the weights of its corners there.
    """

    def __init__(self, view: View, wanted: np.ndarray):
        trace, pixels = view.trace, np.flatnonzero(wanted.ravel() & (view.trace.surface >= 0))
        surface = trace.surface.take(pixels)
        self.view, self.pixels = view, pixels.take(np.argsort(surface, kind="stable"))
        n_each = np.bincount(surface)
        ends = np.cumsum(n_each)
        numbers = np.flatnonzero(n_each).tolist()
        self.parts = [(number, slice(ends[number] - n_each[number], ends[number])) for number in numbers]
        self.depth_m = trace.depth_m.take(self.pixels)
        self.directions = pick(view.directions.reshape(3, -1), self.pixels)
        self.offsets_m = self.depth_m * self.directions
        self.triangle = trace.triangle.take(self.pixels)
        self.weights = np.empty((len(pixels), 3), np.float32)
        self.weights[:, 1:] = trace.barycentric.take(self.pixels, axis=0)
        np.subtract(1 - self.weights[:, 1], self.weights[:, 2], out=self.weights[:, 0])

    @property
    def positions_m(self) -> np.ndarray:
        """Of what is seen, world frame, (3, n)."""
        return self.offsets_m + self.view.centre_m[:, None]

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
