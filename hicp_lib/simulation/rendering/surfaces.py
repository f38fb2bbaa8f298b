"""What a renderer needs to know of things: surfaces, the hits of rays on them, their looks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hicp_lib.simulation.rendering.mesh import Mesh


@dataclass
class Hits:
    """Where rays met one surface: n places.

    Components come first, (3, n): numpy works several times faster on whole components
    than on rows of three.

    Attributes
    ----------
    footprint_m : how wide one pixel is at the hit, (n,)
    interpolate : gives the mesh's coords at the hits
    """

    footprint_m: np.ndarray
    interpolate: Callable[[], np.ndarray]

    @cached_property
    def coords(self) -> np.ndarray:
        """The mesh's coords, interpolated, (n_coords, n); only made for looks that ask for them."""
        return self.interpolate()


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
    """

    albedo: np.ndarray
    height_m: np.ndarray | float = 0.0
    gloss: np.ndarray | float = 0.04
    roughness: np.ndarray | float = 0.6
    softness: np.ndarray | float = 0.0
    glow: np.ndarray | float = 0.0


Material = Callable[[Hits], Look]


@dataclass(frozen=True)
class Surface:
    """A mesh with a material. `person` is whose it is (-1: nobody's), `parts` the body part per triangle."""

    mesh: Mesh
    material: Material
    person: int = -1
    parts: np.ndarray | None = None
