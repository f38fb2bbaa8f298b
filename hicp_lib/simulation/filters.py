"""Image-space steps of the renderer: bumps from heights, and sums that do not cross edges."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from hicp_lib.simulation.raycast import Trace, dot, part_of_image


@dataclass(frozen=True)
class View:
    """A grid of pixels to be shaded together: their rays (n, 6), what these met, and which are wanted.

    `wanted` has the grid's shape (rows, columns); n = rows * columns.
    """

    wanted: np.ndarray
    rays: np.ndarray
    trace: Trace

    @classmethod
    def of(cls, trace: Trace, rays: np.ndarray, pixels: tuple[slice, slice], wanted: np.ndarray) -> View:
        """The view of some rows and columns of an image; `wanted` has the whole image's shape.

        Where nothing was hit, nothing is wanted.
        """
        met = trace.part(wanted.shape, pixels)
        chosen = wanted[pixels]
        return cls(
            chosen & (met.surface >= 0).reshape(chosen.shape), part_of_image(rays, wanted.shape, pixels), met
        )


@dataclass
class Looks:
    """How things look at a view's wanted pixels, surface by surface; components first, (3, n) or (n,).

    `pixels` are their numbers in the view's grid. For the others see `surfaces.Look`.
    """

    pixels: np.ndarray
    positions_m: np.ndarray
    normals: np.ndarray
    albedo: np.ndarray
    glow: np.ndarray
    height_m: np.ndarray
    gloss: np.ndarray
    roughness: np.ndarray
    softness: np.ndarray

    @classmethod
    def empty(cls, pixels: np.ndarray) -> Looks:
        """Black, flat and matt all over."""
        n = len(pixels)
        vectors = [np.zeros((3, n), np.float32) for _ in range(4)]
        return cls(pixels, *vectors, *(np.zeros(n, np.float32) for _ in range(4)))

    def part(self, block: slice) -> Looks:
        """Some of the pixels."""
        return Looks(*(getattr(self, field.name)[..., block] for field in fields(self)))

    def on_grid(self, name: str, view: View) -> np.ndarray:
        """One of the arrays for all of the view's pixels in order, zero where nothing is wanted."""
        values = getattr(self, name)
        grid = np.zeros((*values.shape[:-1], view.wanted.size), np.float32)
        grid[..., self.pixels] = values
        return grid


def tilt_by_height(normals: np.ndarray, positions_m: np.ndarray, height_m: np.ndarray, view: View) -> None:
    """Tilt a view's normals (3, n) in place by the slope of heights (n,), from differences between pixels.

    Mikkelsen, "Bump mapping unparametrized surfaces on the GPU" (2010); pixels on the last
    row and column, or beside another surface, keep their normals.
    """
    shape = view.wanted.shape
    height = height_m.reshape(shape)
    surface, depth = view.trace.surface.reshape(shape), view.trace.depth_m.reshape(shape)
    here, corner = slice(None, -1), (slice(None, -1), slice(None, -1))
    with np.errstate(invalid="ignore"):
        inner = (
            (height[corner] != 0)
            & (surface[corner] == surface[here, 1:]) & (surface[corner] == surface[1:, here])
            & (np.abs(depth[here, 1:] - depth[corner]) < 0.03 * depth[corner])
            & (np.abs(depth[1:, here] - depth[corner]) < 0.03 * depth[corner])
        )  # fmt: skip
    r, c = np.nonzero(inner)
    at = r * shape[1] + c
    right, below = at + 1, at + shape[1]
    n = normals[:, at]
    position = positions_m[:, at]
    dx, dy = positions_m[:, right] - position, positions_m[:, below] - position
    hx, hy = height_m[right] - height_m[at], height_m[below] - height_m[at]
    rx, ry = _cross(dy, n), _cross(n, dx)
    area = dot(dx, rx)
    tilted = np.abs(area) * n - np.sign(area) * (hx * rx + hy * ry)
    normals[:, at] = tilted / np.maximum(np.sqrt(dot(tilted, tilted)), 1e-20)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def sum_within(
    sums: np.ndarray, surface: np.ndarray, positions_m: np.ndarray, normals: np.ndarray, rounds: int
) -> np.ndarray:
    """Sum over 4 x 4 pixels that lie on the same surface and close to its tangent plane, several times.

    Parameters
    ----------
    sums : array, shape (k, height, width)
    surface : array, shape (height, width)
    positions_m, normals : arrays, shape (3, height, width)
    """
    alike = {
        (axis, shift): _alike(surface, positions_m, normals, axis, shift)
        for axis in (0, 1)
        for shift in (1, 2)
    }
    for axis in (1, 0) * rounds:
        total = sums.copy()
        for shift in (1, 2):
            low, high = _apart(axis, shift)
            total[low] += sums[high] * alike[axis, shift]
            if shift == 1:
                total[high] += sums[low] * alike[axis, shift]
        sums = total
    return sums


def _alike(surface, positions_m, normals, axis: int, shift: int) -> np.ndarray:
    """1 where the pixel `shift` further along an axis continues a pixel's surface, else 0; float32."""
    low, high = _apart(axis, shift)
    off_plane = dot(positions_m[high] - positions_m[low], normals[low])
    return ((surface[low[1:]] == surface[high[1:]]) & (np.abs(off_plane) < 0.012)).astype(np.float32)


def _apart(axis: int, shift: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Indices (component, row, column) of the nearer and the further pixel of all pairs along an axis."""
    whole, near, far = slice(None), slice(None, -shift), slice(shift, None)
    return (
        ((whole, near, whole), (whole, far, whole))
        if axis == 0
        else ((whole, whole, near), (whole, whole, far))
    )
