"""Image-space steps of the renderer: bumps from heights, and sums that do not cross edges."""

from itertools import product

import numpy as np

from hicp_lib.simulation.rendering.gbuffer import GBuffer
from hicp_lib.simulation.rendering.raycast import DEPTH_STEP, cross, dot

_OFF_PLANE_M = 0.012  # from the tangent plane of a pixel's surface: further away counts as another surface


def tilt_by_height(normals: np.ndarray, height_m: np.ndarray, gbuffer: GBuffer) -> np.ndarray:
    """Normals tilted by the slope of bumps.

    Mikkelsen, "Bump mapping unparametrized surfaces on the GPU" (2010); pixels on the last
    row and column, without height or beside another surface keep their normals.

    Parameters
    ----------
    normals : array, shape (3, n)
    height_m : array, shape (n,)
        Of the bumps.
    gbuffer : GBuffer
        Of the same pixels.

    Returns
    -------
    array, shape (3, n)
    """
    trace, (rows, columns), pixels = gbuffer.view.trace, gbuffer.view.shape, gbuffer.pixels
    heights = np.zeros(rows * columns, np.float32)
    heights[pixels] = height_m
    step_m, slopes, beside = DEPTH_STEP * gbuffer.depth_m, [], []
    inner = (height_m != 0) & (pixels < (rows - 1) * columns) & (pixels % columns < columns - 1)
    for near in (pixels + 1, pixels + columns):
        inner &= trace.surface.take(near, mode="clip") == trace.surface.take(pixels)
        inner &= np.abs(trace.depth_m.take(near, mode="clip") - gbuffer.depth_m) < step_m
        slopes.append(heights.take(near, mode="clip") - height_m)
        beside.append(gbuffer.view.offsets_m(near) - gbuffer.offsets_m)
    (right, below), (rise_right, rise_below) = beside, slopes
    area = dot(right, cross(below, normals))
    tilted = np.abs(area) * normals
    tilted -= np.sign(area) * cross(rise_right * below - rise_below * right, normals)
    tilted /= np.maximum(np.sqrt(dot(tilted, tilted)), np.float32(1e-20))
    return np.where(inner, tilted, normals)


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
