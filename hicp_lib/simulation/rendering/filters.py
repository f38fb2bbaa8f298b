"""Image-space steps of the renderer: bumps from heights, and sums that do not cross edges."""

from itertools import product

import numpy as np

from hicp_lib.simulation.rendering.gbuffer import GBuffer
from hicp_lib.simulation.rendering.raycast import DEPTH_STEP, cross, dot

_OFF_PLANE_M = 0.012  # from the tangent plane of a pixel's surface: further away counts as another surface


def tilt_by_height(normals: np.ndarray, height_m: np.ndarray, gbuffer: GBuffer) -> None:
    """Tilt normals by the slope of bumps.

    Mikkelsen, "Bump mapping unparametrized surfaces on the GPU" (2010); pixels on the last
    row and column, without height or beside another surface keep their normals.

    Parameters
    ----------
    normals : array, shape (3, rows, columns)
        Changed in place.
    height_m : array, shape (rows, columns)
        Of the bumps.
    gbuffer : GBuffer
        Of the same rows and columns.
    """
    here, right, below = np.s_[:-1, :-1], np.s_[:-1, 1:], np.s_[1:, :-1]
    surface, depth = gbuffer.surface, gbuffer.depth_m
    step = DEPTH_STEP * depth[here]
    inner = (
        (height_m[here] != 0)
        & (surface[here] == surface[right]) & (surface[here] == surface[below])
        & (np.abs(depth[right] - depth[here]) < step) & (np.abs(depth[below] - depth[here]) < step)
    )  # fmt: skip
    n, position = normals[:, *here], gbuffer.positions_m[:, *here]
    rx = cross(gbuffer.positions_m[:, *below] - position, n)
    dx = gbuffer.positions_m[:, *right] - position
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
    counts : array, shape (k, rows, columns), dtype int16
        0 or 1.
    surface : array of int, shape (rows, columns)
    positions_m, normals : array, shape (3, rows, columns)
    rounds : int
        At most 3, so that sums do not overflow.

    Returns
    -------
    array, shape (k, rows, columns), dtype int16
    """
    pairs = product((0, 1), (1, 2))
    alike = {pair: _alike(surface, positions_m, normals, *pair) for pair in pairs}
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
    same &= np.abs(off_plane) < _OFF_PLANE_M
    return -same.astype(np.int16)


def _apart(axis: int, shift: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Indices (component, row, column) of the nearer and the further pixel of all pairs along an axis."""
    near, far = (slice(None, -shift), slice(shift, None))
    return (np.s_[:, near], np.s_[:, far]) if axis == 0 else (np.s_[:, :, near], np.s_[:, :, far])
