"""Inputs of the renderer: surfaces and their materials."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hicp_lib.simulation.rendering.mesh import Mesh


@dataclass
class Look:
    """How a surface looks where it was hit.

    Attributes
    ----------
    albedo : array, shape (3, n) or (3, 1)
        Linear RGB; one column where it is the same all over.
    height_m : float or array, shape (n,)
        Bump height that tilts the normal.
    gloss : float or array, shape (n,)
        Strength of the highlight; 0.04 is a dielectric's.
    roughness : float or array, shape (n,)
        Of the highlight, in (0, 1].
    softness : float or array, shape (n,)
        How far light extends past the terminator, as in skin.
    glow : float or array, shape (3, n) or (3, 1)
        Emitted light, linear RGB.
    """

    albedo: np.ndarray
    height_m: Any = 0.0
    gloss: Any = 0.04
    roughness: Any = 0.6
    softness: Any = 0.0
    glow: Any = 0.0


Material = Look | Callable[[np.ndarray, np.ndarray], Look]
"""One look all over, or what tells it of n places where rays met the surface: by the mesh's coords there,
interpolated, (n_coords, n), and by how wide one pixel is in metres, (n,).

Components come first, (3, n): numpy works several times faster on whole components than on rows of three."""


def column(colour: ArrayLike) -> np.ndarray:
    """A colour (3,) as a column (3, 1), float32, which goes with the components of n places."""
    return np.asarray(colour, np.float32)[:, None]


@dataclass(frozen=True)
class Surface:
    """A mesh with a material.

    Attributes
    ----------
    mesh : Mesh
    material : Look or callable
        Its appearance.
    person : int
        Index of its person; -1: none.
    parts : array or None, shape (n_triangles,), dtype int16
        Body part per triangle.
    """

    mesh: Mesh
    material: Material
    person: int = -1
    parts: np.ndarray | None = None
