"""What a renderer needs to know of things: surfaces, the hits of rays on them, their looks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hicp_lib.simulation.mesh import Mesh


@dataclass(frozen=True)
class Hits:
    """Where rays met one surface: n places.

    Components come first, (3, n): numpy works several times faster on whole components
    than on rows of three.

    Attributes
    ----------
    positions_m : world frame, (3, n)
    normals : unit, towards the camera's side, (3, n)
    coords : the mesh's coords, interpolated, (n_coords, n)
    triangles : index of the triangle within the surface's mesh, (n,)
    footprint_m : how wide one pixel is at the hit, (n,)
    """

    positions_m: np.ndarray
    normals: np.ndarray
    coords: np.ndarray
    triangles: np.ndarray
    footprint_m: np.ndarray


@dataclass
class Look:
    """How a surface looks where it was hit.

    Attributes
    ----------
    albedo : linear RGB, (3, n), or (3, 1) where it is the same all over
    height_m : bump height that tilts the normal, (n,) or 0
    gloss : strength of the highlight, (n,) or a number; 0.04 is a dielectric's
    roughness : of the highlight, (n,) or a number in (0, 1]
    softness : how far light creeps past the terminator, as in skin, (n,) or a number
    glow : light given off, linear RGB, (3, n), (3, 1) or 0
    normals : replaces the interpolated normals, (3, n), unit
    """

    albedo: np.ndarray
    height_m: np.ndarray | float = 0.0
    gloss: np.ndarray | float = 0.04
    roughness: np.ndarray | float = 0.6
    softness: np.ndarray | float = 0.0
    glow: np.ndarray | float = 0.0
    normals: np.ndarray | None = None


Material = Callable[[Hits], Look]


@dataclass(frozen=True)
class Surface:
    """A mesh with a material. `person` is whose it is (-1: nobody's), `parts` the body part per triangle."""

    mesh: Mesh
    material: Material
    person: int = -1
    parts: np.ndarray | None = None
