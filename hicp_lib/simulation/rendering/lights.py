"""Lights, and their reflection by surfaces.

Area lights are sampled once per pixel on a repeating 4 x 4 pattern of positions, so that a
filter over 4 x 4 pixels which respects edges removes the noise and leaves soft shadows (interleaved
sampling: Keller and Heidrich, 2001). Highlights are Cook-Torrance with the GGX distribution
(Walter et al., 2007), in Karis's approximation of the masking term (2013).
Vectors have their components first, (3, n).
"""

from dataclasses import dataclass

import numpy as np

from hicp_lib.core.memo import memoised
from hicp_lib.simulation.rendering.gbuffer import Shading
from hicp_lib.simulation.rendering.raycast import dot
from hicp_lib.simulation.rendering.surfaces import column


@dataclass(frozen=True)
class Light:
    """A rectangular light.

    Attributes
    ----------
    centre_m, half_u_m, half_v_m : array, shape (3,)
        The corners are centre +- half_u +- half_v.
    power : array, shape (3,)
        Linear RGB: irradiance at one metre, seen face on.
    direction : array or None, shape (3,)
        Unit vector, where a one-sided light (a window) shines; None for one that shines all around.
    """

    centre_m: np.ndarray
    half_u_m: np.ndarray
    half_v_m: np.ndarray
    power: np.ndarray
    direction: np.ndarray | None = None


@dataclass(frozen=True)
class Ambient:
    """Light from everywhere.

    Attributes
    ----------
    up, down, side : array, shape (3,)
        Linear RGB from above, from below, and more from one side.
    side_direction : array, shape (3,)
        Unit vector, where that side is.
    """

    up: np.ndarray
    down: np.ndarray
    side: np.ndarray
    side_direction: np.ndarray


# Bayer's matrix: neighbours take samples that lie far apart.
_STRATA = np.array([0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5])
# Where in the square each pixel of the pattern samples, in sixteenths.
_PLACES = np.stack([_STRATA % 8 * 2 + _STRATA // 8, 5 * _STRATA % 16]).astype(np.float32)


# Shifts from one 4 x 4 pattern to the next, to the right and down. Multiples of irrational numbers cover the
# unit square evenly (Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018).
_STEPS = np.array([[0.7548777, 0.5698403], [0.8191725, 0.6710436]])


@memoised(16)
def sample_offsets(rows: int, columns: int, kind: int) -> np.ndarray:
    """Points of the unit square: 16 points of a lattice that repeat every 4 x 4 pixels, each time shifted.

    The pixels of either colour of a chessboard cover the square as well.

    Parameters
    ----------
    rows, columns : int
        Of the image.
    kind : int
        Number of the light; each has the pattern moved.

    Returns
    -------
    array, shape (2, rows * columns), dtype float32
    """
    row, column = np.mgrid[:rows, :columns].reshape(2, -1)
    moved = np.roll(_PLACES.reshape(2, 4, 4), (-kind, -3 * kind), axis=(1, 2)).reshape(2, 16)
    shift = _STEPS @ np.stack([column // 4, row // 4]) % 1
    return ((moved.take(row % 4 * 4 + column % 4, axis=1) + shift) / 16).astype(np.float32)


def diffuse_and_highlight(
    light: Light,
    positions_m: np.ndarray,
    view: np.ndarray,
    shading: Shading,
) -> tuple[np.ndarray, np.ndarray]:
    """Unshadowed light reflected at each of n points.

    Softness lets red light creep past the terminator further than green and blue, which is what
    makes skin look like skin.

    Parameters
    ----------
    light : Light
    positions_m : array, shape (3, n)
    view : array, shape (3, n)
        Unit vectors to the camera.
    shading : Shading
        Of the points.

    Returns
    -------
    diffuse : array, shape (3, n)
        Light that the albedo is to be multiplied with.
    highlight : array, shape (3, n)
        Reflected light.
    """
    to_light = column(light.centre_m) - positions_m
    strength = 1 / dot(to_light, to_light)
    to_light *= np.sqrt(strength)
    if light.direction is not None:
        strength *= np.clip(-dot(to_light, light.direction.astype(np.float32)), 0, 1)
    n_l = dot(shading.normals, to_light)
    power = column(light.power)
    lit = np.clip(n_l, 0, 1) * strength
    soft = shading.softness.any()
    diffuse = _creeping(n_l, shading.softness) * (strength * power) if soft else lit * power
    half = to_light
    half += view
    half /= np.maximum(np.sqrt(dot(half, half)), np.float32(1e-6))
    lit *= shading.gloss
    lit *= _mirrored(np.clip(dot(shading.normals, half), 0, 1), dot(view, half), shading.roughness)
    return diffuse, lit * power


def _creeping(n_l: np.ndarray, softness: np.ndarray) -> np.ndarray:
    """Diffuse light by the cosine `n_l` of its angle, which reaches furthest for red, (3, n)."""
    wrap = softness * column([0.40, 0.16, 0.10])
    creeping = n_l + wrap
    wrap += 1
    wrap *= wrap
    creeping /= wrap
    return np.maximum(creeping, 0, out=creeping)


def _mirrored(n_h: np.ndarray, v_h: np.ndarray, roughness: np.ndarray) -> np.ndarray:
    """GGX's distribution times masking, by the half vector's cosines with normal and view."""
    a2 = roughness * roughness
    a2 *= a2
    n_h *= n_h
    n_h *= a2 - 1
    n_h += 1
    n_h *= n_h
    v_h *= v_h
    v_h *= 4 * (roughness + np.float32(0.5))
    n_h *= np.maximum(v_h, np.float32(0.1))
    a2 /= n_h
    return np.minimum(a2, 60, out=a2)


def ambient_light(ambient: Ambient, normals: np.ndarray) -> np.ndarray:
    """Diffuse light from all around by normal, (3, n)."""
    up = 0.5 + 0.5 * normals[2]
    lo, hi, extra = map(column, (ambient.down, ambient.up, ambient.side))
    side = np.clip(dot(normals, ambient.side_direction.astype(np.float32)), 0, 1)
    return lo + up * (hi - lo) + side * extra
