"""Rays against surfaces, through Open3D's RaycastingScene."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType

import cv2
import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from hicp_lib.core.environment import with_variables
from hicp_lib.simulation.rendering.camera import join_rays
from hicp_lib.simulation.rendering.surfaces import Surface


@contextmanager
def _without_dash() -> Iterator[None]:
    """Half of the time of Open3D's import is Dash's, for plots in a browser, which do not start then."""
    stand_in = ModuleType("dash")
    stand_in.__dict__.update(html=None, dcc=None, Dash=None)
    used = sys.modules.setdefault("dash", stand_in)
    try:
        yield
    finally:
        if used is stand_in:
            del sys.modules["dash"]


# Otherwise Open3D starts its web viewer in every notebook that renders.
with with_variables(OPEN3D_DISABLE_WEB_VISUALIZER="true"), _without_dash():
    import open3d as o3d

DEPTH_STEP = 0.03  # relative difference in depth beyond which neighbours are on different surfaces
N_THREADS = 1  # frames are rendered in parallel by processes; one scene takes calls from one thread only


@dataclass(frozen=True)
class Trace:
    """The first thing each of n rays met.

    Attributes
    ----------
    depth_m : array, shape (n,), dtype float32
        The ray parameter; infinite: nothing was hit.
    triangle : array, shape (n,), dtype int32
        Number of the triangle in the whole scene; -1: nothing.
    surface : array, shape (n,), dtype int16
        Number of the surface; -1: nothing.
    barycentric : array, shape (n, 2), dtype float32
        Weights of the triangle's second and third corner.
    """

    depth_m: np.ndarray
    triangle: np.ndarray
    surface: np.ndarray
    barycentric: np.ndarray


class RayScene:
    """Surfaces that rays can be cast at.

    Parameters
    ----------
    surfaces : list of Surface

    Examples
    --------
    >>> from hicp_lib.simulation.appearance.materials import plain
    >>> from hicp_lib.simulation.rendering.mesh import box
    >>> scene = RayScene([Surface(box([-1, 2, -1], [1, 3, 1]), plain(np.zeros(3)))])
    >>> rays = np.array([[0, 0, 0, 0, 1, 0], [0, 0, 0, 0, -1, 0]], np.float32)
    >>> scene.trace(rays).depth_m.round(3).tolist(), scene.trace(rays).surface.tolist()
    ([2.0, inf], [0, -1])
    """

    def __init__(self, surfaces: list[Surface]):
        self.surfaces = surfaces
        n_triangles = [len(s.mesh.triangles) for s in surfaces]
        self.first_triangle = np.cumsum([0, *n_triangles])
        first_vertex = np.cumsum([0, *(len(s.mesh.vertices_m) for s in surfaces)])
        # One more for "no triangle", -1.
        self.surface_of_triangle = np.append(
            np.repeat(np.arange(len(surfaces), dtype=np.int16), n_triangles), np.int16(-1)
        )
        self.vertices_m = np.concatenate([s.mesh.vertices_m for s in surfaces], dtype=np.float32)
        self.triangles = np.concatenate(
            [s.mesh.triangles + first for s, first in zip(surfaces, first_vertex, strict=False)]
        ).astype(np.uint32)
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=N_THREADS)
        self._scene.add_triangles(_tensor(self.vertices_m), _tensor(self.triangles))

    @cached_property
    def normals(self) -> np.ndarray:
        """Of all vertices, (n_vertices, 3)."""
        return np.concatenate([s.mesh.normals for s in self.surfaces], dtype=np.float32)

    @cached_property
    def face_normals(self) -> np.ndarray:
        """Unit normals of all triangles, (3, n_triangles)."""
        vertices_m = np.ascontiguousarray(self.vertices_m.T)
        a, b, c = (pick(vertices_m, corners) for corners in self.triangles.T.astype(np.intp))
        face = cross(b - a, c - a)
        face /= np.maximum(np.sqrt(dot(face, face)), np.float32(1e-20))
        return face

    @cached_property
    def owners(self) -> np.ndarray:
        """The person each surface belongs to, -1 for none and (last) for surface -1; int16."""
        return np.array([s.person for s in self.surfaces] + [-1], np.int16)

    @cached_property
    def parts(self) -> np.ndarray:
        """The body part of each triangle, -1 for none and (last) for triangle -1; int16."""
        parts = [np.full(len(s.mesh.triangles), -1) if s.parts is None else s.parts for s in self.surfaces]
        return np.concatenate([*parts, [-1]], dtype=np.int16)

    def trace(self, rays: np.ndarray) -> Trace:
        """Cast rays, shape (n, 6), float32; their direction's length sets the unit of `depth_m`."""
        answer = self._scene.cast_rays(_tensor(rays), nthreads=N_THREADS)
        triangle = answer["primitive_ids"].numpy().view(np.int32)  # Open3D's "nothing" is -1 then
        return Trace(
            answer["t_hit"].numpy(),
            triangle,
            self.surface_of_triangle.take(triangle, mode="wrap"),
            answer["primitive_uvs"].numpy(),
        )

    def occluded(self, rays: np.ndarray, end: float = 1.0) -> np.ndarray:
        """Whether rays (n, 6) hit something before ``origin + end * direction``, shape (n,), bool."""
        return self._scene.test_occlusions(_tensor(rays), tnear=0.0, tfar=end, nthreads=N_THREADS).numpy()


def _tensor(values: np.ndarray) -> o3d.core.Tensor:
    return o3d.core.Tensor.from_numpy(np.ascontiguousarray(values))  # no copy is made


def trace_image(
    scene: RayScene, centre_m: np.ndarray, directions: np.ndarray, fine: np.ndarray
) -> tuple[Trace, Trace]:
    """Trace an image's rays, directions (3, height, width), skipping pixels inside a triangle.

    Every second row and column is traced. Between four of these that hit the same triangle, depth is
    interpolated: 1 / depth is linear over a plane's image. All other pixels are traced as well.

    Parameters
    ----------
    scene : RayScene
    centre_m : array, shape (3,)
        Where the rays begin.
    directions : array, shape (3, height, width)
    fine : array of bool, shape (n_surfaces,)
        Surfaces near which every pixel is traced.

    Returns
    -------
    image : Trace
        Its rows are the image's pixels; `barycentric` is left undefined between traced ones.
    half : Trace
        Of every second row and column.
    """
    height, width = directions.shape[1:]
    every_second = np.s_[::2, ::2]
    coarse = scene.trace(join_rays(centre_m, directions[:, ::2, ::2].reshape(3, -1)))
    coarse_shape = (-(-height // 2), -(-width // 2))
    triangle = coarse.triangle.reshape(coarse_shape)
    inner = (triangle >= 0) & ~np.append(fine, False).take(coarse.surface, mode="wrap").reshape(coarse_shape)
    plain = _inside_one(triangle, inner)
    depth_m = between(1 / coarse.depth_m.reshape(coarse_shape), (height, width))
    with np.errstate(divide="ignore"):  # infinite where nothing is
        np.reciprocal(depth_m, out=depth_m)
    depth_m[every_second] = coarse.depth_m.reshape(coarse_shape)
    triangles = doubled(triangle, (height, width))
    barycentric = np.empty((height, width, 2), np.float32)
    barycentric[every_second] = coarse.barycentric.reshape(*coarse_shape, 2)
    unknown = doubled((~plain).view(np.uint8), (height, width))
    unknown[every_second] = 0
    rest = np.flatnonzero(unknown)
    traced = scene.trace(join_rays(centre_m, pick(directions.reshape(3, -1), rest)))
    depth_m.ravel()[rest], triangles.ravel()[rest] = traced.depth_m, traced.triangle
    place(barycentric.reshape(-1, 2).T, rest, traced.barycentric.T)
    surface = scene.surface_of_triangle.take(triangles.ravel(), mode="wrap")
    return Trace(depth_m.ravel(), triangles.ravel(), surface, barycentric.reshape(-1, 2)), coarse


def _inside_one(triangle: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Whether a pixel, its neighbours below and right, and all around them show one triangle.

    `triangle` are the triangles seen, `inner` where that may be so, both (rows, columns).
    """
    plain = inner.copy()
    here = triangle[:-1, :-1]
    for other in (triangle[1:, :-1], triangle[1:, 1:], triangle[:-1, 1:]):
        plain[:-1, :-1] &= here == other
    plain[-1], plain[:, -1] = False, False
    return cv2.erode(plain.view(np.uint8), np.ones((3, 3), np.uint8)).view(bool)


def doubled(values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Each place (rows, columns, ...) as two by two, cut to `shape`."""
    rows, columns = values.shape[:2]
    full = cv2.resize(values, (2 * columns, 2 * rows), interpolation=cv2.INTER_NEAREST)
    return np.ascontiguousarray(full[: shape[0], : shape[1]])


def between(values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Values at every second row and column, and the means between them, float32; `shape` is that of all."""
    full = np.zeros((2 * values.shape[0], 2 * values.shape[1]), np.float32)
    full[::2, ::2] = values
    full[::2, 1:-1:2] = (values[:, :-1] + values[:, 1:]) / 2
    full[1:-1:2, ::2] = (values[:-1] + values[1:]) / 2
    full[1:-1:2, 1:-1:2] = (values[:-1, :-1] + values[1:, 1:]) / 2
    return full[: shape[0], : shape[1]]


def interpolate(values: np.ndarray, corners: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Interpolate values per vertex within triangles.

    Parameters
    ----------
    values : array, shape (n_vertices, k)
    corners : array of int, shape (n, 3)
        Numbers of the triangles' vertices.
    weights : array, shape (n, 3), dtype float32
        Barycentric.

    Returns
    -------
    array, shape (k, n), dtype float32
    """
    # A product with a sparse matrix reads each corner's values once, in one pass.
    starts = np.arange(0, 3 * len(corners) + 1, 3, dtype=np.int32)
    entries = weights.ravel(), corners.ravel().astype(np.int32, copy=False), starts
    matrix = sparse.csr_array(entries, shape=(len(corners), len(values)))
    return np.ascontiguousarray((matrix @ values.astype(np.float32, copy=False)).T)


# Row by row and without checks, numpy copies selected elements several times faster than by indexing.


def pick(values: np.ndarray, places: np.ndarray) -> np.ndarray:
    """The same elements of every row, (..., n) to (..., len(places)); indices must be within bounds."""
    return values.take(places, axis=-1, mode="clip")


def place(values: np.ndarray, places: np.ndarray, chosen: Iterable[ArrayLike]) -> None:
    """Set the same elements of every row.

    Parameters
    ----------
    values : array, shape (k, n)
        Changed in place.
    places : array of int, shape (m,)
    chosen : array, shape (k, m)
    """
    for row, new in zip(values, chosen, strict=True):
        row[places] = new


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Dot products of vectors (3, n)."""
    result = a[0] * b[0]
    result += a[1] * b[1]
    result += a[2] * b[2]
    return result


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of vectors (3, n)."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
