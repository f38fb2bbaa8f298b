"""Triangle meshes: normals, cuts, hems and the simple solids furniture is made of."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from hicp_lib.core.rotations import about


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh ready to be shaded.

    Attributes
    ----------
    vertices_m : array, shape (n_vertices, 3)
        World frame.
    triangles : array, shape (n_triangles, 3), dtype int32
    normals : array, shape (n_vertices, 3)
        Unit vectors.
    coords : array, shape (n_vertices, n_coords)
        Coordinates for looking up patterns, interpolated over each triangle. Their meaning depends on the
        material: texture coordinates, rest-pose positions, ...
    """

    vertices_m: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    coords: np.ndarray


def vertex_normals(vertices_m: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Area-weighted unit vertex normals, shape (n_vertices, 3), float32."""
    flat = np.ascontiguousarray(triangles.T, np.intp).ravel()
    # Operations on whole components are several times faster than on rows of three.
    a, b, c = np.moveaxis(np.ascontiguousarray(vertices_m.T).take(flat, axis=1).reshape(3, 3, -1), 1, 0)
    (ux, uy, uz), (vx, vy, vz) = b - a, c - a
    normals = np.empty(vertices_m.shape, np.float32)
    for axis, face in enumerate((uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx)):
        normals[:, axis] = np.bincount(flat, np.tile(face, 3), len(vertices_m))
    return unit(normals)


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) scaled to length one; zero vectors stay zero."""
    length = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
    return vectors / np.maximum(length, 1e-12)[..., None]


@dataclass(frozen=True)
class Cut:
    """Part of a mesh as a linear function of the whole mesh's vertices.

    New vertex k is ``(1 - t[k]) * vertices[i[k]] + t[k] * vertices[j[k]]``, so a cut made once
    in the rest pose follows every pose.

    Attributes
    ----------
    i, j : array of int, shape (n,)
    t : array, shape (n,), dtype float32
    triangles : array, shape (n_triangles, 3), dtype int32
    source : array of int, shape (n_triangles,)
        The triangle that each new one came from.
    """

    i: np.ndarray
    j: np.ndarray
    t: np.ndarray
    triangles: np.ndarray
    source: np.ndarray

    def apply(self, values: np.ndarray) -> np.ndarray:
        """Values per vertex of the whole mesh (n, ...) to values per vertex of the part."""
        t = self.t.reshape(-1, *[1] * (values.ndim - 1)).astype(values.dtype)
        return values[self.i] * (1 - t) + values[self.j] * t


# Corners of what is left of a triangle, by how many of its own are inside, as edges between them; the odd
# corner out is number 0.
_LEFT = {3: [((0, 0), (1, 1), (2, 2))], 1: [((0, 0), (0, 1), (0, 2))],
         2: [((0, 1), (1, 1), (2, 2)), ((0, 1), (2, 2), (0, 2))]}  # fmt: skip


def cut(triangles: np.ndarray, field: np.ndarray) -> Cut:
    """The part of a mesh where `field` (one value per vertex) is positive, cut along its zero line."""
    inside = field > 0
    count = inside[triangles].sum(axis=1)
    source, corners = [], []  # each corner is an edge (i, j); i == j is a vertex
    for n_inside, pieces in _LEFT.items():
        rows = np.flatnonzero(count == n_inside)
        odd = np.argmax(inside[triangles[rows]] == (n_inside == 1), axis=1)
        turned = np.take_along_axis(triangles[rows], (odd[:, None] + np.arange(3)) % 3, axis=1)
        corners += [turned[:, np.array(piece)] for piece in pieces]
        source += [rows] * len(pieces)
    edges = np.sort(np.concatenate(corners), axis=-1)
    n = len(field)
    keys = edges[..., 0].astype(np.int64) * n + edges[..., 1]
    unique, numbers = np.unique(keys, return_inverse=True)
    i, j = np.divmod(unique, n)
    gap = field[i] - field[j]
    t = np.where(i == j, 0.0, field[i] / np.where(gap == 0, 1.0, gap))
    return Cut(i, j, t.astype(np.float32), numbers.astype(np.int32), np.concatenate(source))


def smoothing(triangles: np.ndarray, n_vertices: int) -> sparse.csr_array:
    """A smoothing step as a matrix: vertices move most of the way to the mean of their neighbours.

    Those on the boundary move along it, to the mean of their neighbours there: hems become smooth curves.

    Parameters
    ----------
    triangles : array of int, shape (n, 3)
        Each vertex belongs to one.
    n_vertices : int

    Returns
    -------
    array, shape (n_vertices, n_vertices), dtype float32
        Sparse.
    """
    pairs, rim = _directed_edges(triangles), boundary_edges(triangles)
    ends = np.concatenate([pairs, pairs[:, ::-1]])
    inner = ~np.isin(ends[:, 0], rim)
    ends = np.concatenate([ends[inner], rim, rim[:, ::-1]]).T
    shape = (n_vertices, n_vertices)
    mean = sparse.coo_array((np.ones(len(ends[0]), np.float32), ends), shape=shape).tocsr()
    count = np.diff(mean.indptr)
    mean.data = np.float32(0.6) / np.repeat(count, count).astype(np.float32)
    return sparse.csr_array(np.float32(0.4) * sparse.eye_array(n_vertices, dtype=np.float32) + mean)


def boundary_edges(triangles: np.ndarray) -> np.ndarray:
    """Directed edges (n, 2) that belong to one triangle only."""
    edges = _directed_edges(triangles)
    low, high = np.sort(edges.astype(np.int64), axis=1).T
    _, inverse, count = np.unique(low * (high.max() + 1) + high, return_inverse=True, return_counts=True)
    return edges[count[inverse] == 1].astype(np.int32)


def _directed_edges(triangles: np.ndarray) -> np.ndarray:
    return np.concatenate([triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])


def concatenate(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one."""
    offsets = np.cumsum([0] + [len(m.vertices_m) for m in meshes[:-1]])
    return Mesh(
        np.concatenate([m.vertices_m for m in meshes]),
        np.concatenate([m.triangles + o for m, o in zip(meshes, offsets, strict=True)]),
        np.concatenate([m.normals for m in meshes]),
        np.concatenate([m.coords for m in meshes]),
    )


QUAD = np.array([[0, 1, 2], [0, 2, 3]])
"""Triangles of four corners that go around."""


def quad(corner_m: ArrayLike, u_m: ArrayLike, v_m: ArrayLike) -> Mesh:
    """A parallelogram, which faces cross(u, v).

    Parameters
    ----------
    corner_m, u_m, v_m : array, shape (3,)
        A corner, and the two edges from there.

    Returns
    -------
    Mesh
        Its coords are metres along `u_m` and `v_m`.
    """
    corner, u, v = (np.asarray(x, np.float32) for x in (corner_m, u_m, v_m))
    vertices = corner + np.array([0 * u, u, u + v, v])
    lu, lv = math.hypot(*u.tolist()), math.hypot(*v.tolist())
    coords = np.array([[0, 0], [lu, 0], [lu, lv], [0, lv]], np.float32)
    normal = np.cross(u.astype(float), v.astype(float))
    normals = np.repeat(unit(normal)[None].astype(np.float32), 4, axis=0)
    return Mesh(vertices, QUAD.astype(np.int32), normals, coords)


# Corners (24, 3), normals (24, 3) and triangles (12, 3) of a unit cube, and which of the corners' numbers are
# u and v. A face's corners go around in the order in which it looks outwards.
_FACES = [(axis, side) for axis in range(3) for side in (0, 1)]
_SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
_CUBE = (
    np.concatenate([np.insert(_SQUARE[:: 1 if sum(f) % 2 else -1], *f, axis=1) for f in _FACES]),
    np.repeat([(2 * side - 1) * np.eye(3, dtype=np.float32)[axis] for axis, side in _FACES], 4, axis=0),
    (4 * np.arange(6, dtype=np.int32)[:, None, None] + QUAD.astype(np.int32)).reshape(-1, 3),
    3 * np.arange(24)[:, None] + np.repeat([[1, 2], [0, 2], [0, 1]], 8, axis=0),
)


def box(low_m: ArrayLike, high_m: ArrayLike, yaw_rad: float = 0.0) -> Mesh:
    """A box between two corners, turned about the vertical through its centre.

    Parameters
    ----------
    low_m, high_m : array, shape (3,)
    yaw_rad : float, optional

    Returns
    -------
    Mesh
        Its coords are metres along each face.

    Examples
    --------
    >>> cube = box([0, 0, 0], [1, 1, 1])
    >>> cube.vertices_m.shape, cube.triangles.shape
    ((24, 3), (12, 3))
    """
    spans = np.array([[low_m, high_m]], np.float32)
    return turned(boxes(spans), yaw_rad, spans[0].sum(axis=0) / 2)


def boxes(spans_m: ArrayLike) -> Mesh:
    """Boxes between pairs of corners, (n, 2, 3), as one mesh; coords in metres."""
    lows, highs = np.asarray(spans_m, np.float32).swapaxes(0, 1)
    corners, normals, triangles, uv = _CUBE
    scaled = corners * (highs - lows)[:, None]
    coords = np.take(scaled.reshape(-1, corners.size), uv, axis=1)
    all_triangles = triangles + 24 * np.arange(len(lows), dtype=np.int32)[:, None, None]
    return Mesh(
        (scaled + lows[:, None]).reshape(-1, 3),
        all_triangles.reshape(-1, 3),
        np.tile(normals, (len(lows), 1)),
        coords.reshape(-1, 2),
    )


def turned(mesh: Mesh, yaw_rad: float, about_m: ArrayLike) -> Mesh:
    """The mesh turned about a vertical axis.

    Parameters
    ----------
    mesh : Mesh
    yaw_rad : float
    about_m : array, shape (3,)
        A point of the axis.

    Returns
    -------
    Mesh
    """
    if yaw_rad == 0:
        return mesh
    R, middle = about(2, yaw_rad).astype(np.float32), np.asarray(about_m, np.float32)
    vertices_m = (mesh.vertices_m - middle) @ R.T + middle
    return replace(mesh, vertices_m=vertices_m, normals=mesh.normals @ R.T)


def lathe(profile_m: np.ndarray | Sequence[Sequence[float]], centre_m: ArrayLike, n_sides: int = 24) -> Mesh:
    """A solid of revolution about the vertical.

    Parameters
    ----------
    profile_m : array, shape (n, 2)
        Radius and height, from the bottom up.
    centre_m : array, shape (3,)
        Where its axis meets height 0.
    n_sides : int, optional

    Returns
    -------
    Mesh
        Its coords are metres around and the height.

    Examples
    --------
    >>> pot = lathe([[0.1, 0.0], [0.2, 0.3]], [0, 0, 1])
    >>> pot.vertices_m.shape, pot.vertices_m[:, 2].min().round(3)
    ((50, 3), np.float32(1.0))
    """
    profile = np.asarray(profile_m, np.float32)
    angle = np.linspace(0, 2 * np.pi, n_sides + 1, dtype=np.float32)
    radius, height = profile.T
    x, y = np.cos(angle)[:, None] * radius, np.sin(angle)[:, None] * radius
    vertices = np.stack([x, y, np.broadcast_to(height, x.shape)], axis=-1)
    coords = np.stack([np.broadcast_to(angle[:, None] * radius.max(), x.shape), vertices[..., 2]], axis=-1)
    mesh = closed_grid(vertices, coords, axis=0)
    return replace(mesh, vertices_m=mesh.vertices_m + np.asarray(centre_m, np.float32))


def closed_grid(vertices_m: np.ndarray, coords: np.ndarray, axis: int) -> Mesh:
    """A grid of vertices as a tube without a seam.

    Parameters
    ----------
    vertices_m : array, shape (n_rows, n_columns, 3), dtype float32
    coords : array, shape (n_rows, n_columns, n_coords)
    axis : int
        The first and last row (0) or column (1) coincide.

    Returns
    -------
    Mesh
    """
    triangles, flat = grid_triangles(*vertices_m.shape[:2]), vertices_m.reshape(-1, 3)
    normals = vertex_normals(flat, triangles)
    across = np.moveaxis(normals.reshape(vertices_m.shape), axis, 0)
    across[0] = across[-1] = unit(across[0] + across[-1])
    return Mesh(flat, triangles, normals, coords.reshape(len(flat), -1))


def grid_triangles(n_rows: int, n_columns: int) -> np.ndarray:
    """Triangles (int32) that join a row-major grid of vertices."""
    index = np.arange(n_rows * n_columns).reshape(n_rows, n_columns)
    a, b, c, d = (x.ravel() for x in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]).astype(np.int32)
