"""Image-space steps of the renderer: bumps from heights, and sums that do not cross edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hicp_lib.simulation.rendering.raycast import Trace, cross, dot, pick, place


@dataclass(frozen=True)
class View:
    """A grid of an image's pixels, of which n are to be shaded.

    Attributes
    ----------
    pixels : numbers of the n pixels in the grid, row by row, (n,)
    surface : what is seen, -1 at pixels that are not to be shaded, (rows, columns), int16
    depth_m, positions_m : of what is seen, (rows, columns) and (3, rows, columns)
    directions : of the n pixels' rays, (3, n)
    triangle, barycentric : what they met, (n,) and (n, 2), as in `Trace`
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
    ) -> View:
        """Some rows and columns of an image, and of these what is `wanted`, a mask (height, width).

        `trace` and `directions` (3, height, width) are the whole image's. Where nothing was hit, nothing
        is wanted.
        """
        shape = wanted.shape
        surface = np.where(wanted[part], trace.surface.reshape(shape)[part], np.int16(-1))
        pixels = np.flatnonzero(surface.ravel() >= 0)
        depth_m = np.where(surface >= 0, trace.depth_m.reshape(shape)[part], np.float32(0))
        rays = np.ascontiguousarray(directions[(slice(None), *part)])
        positions_m = depth_m * rays + centre_m.astype(np.float32)[:, None, None]
        triangle = np.ascontiguousarray(trace.triangle.reshape(shape)[part]).ravel().take(pixels)
        barycentric = np.ascontiguousarray(trace.barycentric.reshape(*shape, 2)[part]).reshape(-1, 2)
        return cls(
            pixels,
            surface,
            depth_m,
            positions_m,
            pick(rays.reshape(3, -1), pixels),
            triangle,
            barycentric.take(pixels, axis=0),
        )

    def on_grid(self, values: np.ndarray) -> np.ndarray:
        """Values of the n pixels (k, n) on the grid, (k, rows, columns), zero elsewhere."""
        grid = np.zeros((len(values), self.surface.size), np.float32)
        place(grid, self.pixels, values)
        return grid.reshape(-1, *self.surface.shape)

    def from_grid(self, grid: np.ndarray) -> np.ndarray:
        """Values of the n pixels, (k, n), from the grid's (k, rows, columns)."""
        return pick(grid.reshape(len(grid), -1), self.pixels)


def tilt_by_height(normals: np.ndarray, height_m: np.ndarray, view: View) -> None:
    """Tilt normals (3, rows, columns) in place by the slope of heights (rows, columns).

    Mikkelsen, "Bump mapping unparametrized surfaces on the GPU" (2010); pixels on the last
    row and column, without height or beside another surface keep their normals.
    """
    here, right, below = np.s_[:-1, :-1], np.s_[:-1, 1:], np.s_[1:, :-1]
    surface, depth = view.surface, view.depth_m
    step = 0.03 * depth[here]
    inner = (
        (height_m[here] != 0)
        & (surface[here] == surface[right]) & (surface[here] == surface[below])
        & (np.abs(depth[right] - depth[here]) < step) & (np.abs(depth[below] - depth[here]) < step)
    )  # fmt: skip
    n, position = normals[:, *here], view.positions_m[:, *here]
    rx = cross(view.positions_m[:, *below] - position, n)
    dx = view.positions_m[:, *right] - position
    ry = cross(n, dx)
    area = dot(dx, rx)
    rx *= height_m[right] - height_m[here]
    ry *= height_m[below] - height_m[here]
    rx += ry
    rx *= np.sign(area)
    tilted = np.abs(area) * n
    tilted -= rx
    tilted /= np.maximum(np.sqrt(dot(tilted, tilted)), np.float32(1e-20))
    np.copyto(n, tilted, where=inner)


def sum_within(
    counts: np.ndarray, surface: np.ndarray, positions_m: np.ndarray, normals: np.ndarray, rounds: int
) -> np.ndarray:
    """Sum over 4 x 4 pixels that lie on the same surface and close to its tangent plane, several times.

    Parameters
    ----------
    counts : array, shape (k, rows, columns), int16, 0 or 1
    surface : array, shape (rows, columns)
    positions_m, normals : arrays, shape (3, rows, columns)
    rounds : at most 3, lest the sums overflow
    """
    alike = {
        (axis, shift): _alike(surface, positions_m, normals, axis, shift)
        for axis in (0, 1)
        for shift in (1, 2)
    }
    for axis in (1, 0) * rounds:
        total = counts.copy()
        for shift in (1, 2):
            low, high = _apart(axis, shift)
            total[low] += counts[high] & alike[axis, shift]
            if shift == 1:
                total[high] += counts[low] & alike[axis, shift]
        counts = total
    return counts


def _alike(surface, positions_m, normals, axis: int, shift: int) -> np.ndarray:
    """All bits set where the pixel `shift` further along an axis continues a pixel's surface; int16."""
    low, high = _apart(axis, shift)
    off_plane = dot(positions_m[high] - positions_m[low], normals[low])
    same = surface[low[1:]] == surface[high[1:]]
    same &= np.abs(off_plane) < 0.012
    return -same.astype(np.int16)


def _apart(axis: int, shift: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Indices (component, row, column) of the nearer and the further pixel of all pairs along an axis."""
    whole, near, far = slice(None), slice(None, -shift), slice(shift, None)
    return (
        ((whole, near, whole), (whole, far, whole))
        if axis == 0
        else ((whole, whole, near), (whole, whole, far))
    )
