"""Rotation matrices from rotation vectors, axes, directions and quaternions."""

from collections.abc import Iterable
from math import cos, sin, sqrt

import numpy as np

_PARALLEL = 1e-9  # sine of the angle below which directions count as parallel


def rotations_from_vectors(vectors: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) of rotation vectors (n, 3) in radians (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = (vectors / np.where(angle[:, 0] > 0, angle[:, 0], 1)).T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def rotation(vector: Iterable[float]) -> np.ndarray:
    """Rotation matrix (3, 3) of one rotation vector (3,) in radians."""
    # Written out, since a pose needs thousands of single rotations, and arrays of three are slow.
    x, y, z = map(float, vector)
    angle = sqrt(x * x + y * y + z * z)
    if angle == 0:
        return np.eye(3)
    s, c = sin(angle) / angle, (1 - cos(angle)) / angle**2
    return np.array(
        [
            [1 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y],
            [c * x * y + s * z, 1 - c * (x * x + z * z), c * y * z - s * x],
            [c * x * z - s * y, c * y * z + s * x, 1 - c * (x * x + y * y)],
        ]
    )


def about(axis: int, angle_rad: float) -> np.ndarray:
    """Rotation (3, 3) about a coordinate axis: 0, 1 or 2 for x, y or z.

    Examples
    --------
    >>> about(2, np.pi / 2).round(9) @ [1, 0, 0]
    array([0., 1., 0.])
    """
    c, s = cos(angle_rad), sin(angle_rad)
    if axis == 0:
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]] if axis == 1 else [[c, -s, 0], [s, c, 0], [0, 0, 1]])


def between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The smallest rotation from unit vector `a` to unit vector `b`."""
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis)
    if sine < _PARALLEL:
        return np.eye(3) if a @ b > 0 else rotation(np.pi * np.cross(a, np.eye(3)[np.argmin(np.abs(a))]))
    return rotation(axis / sine * np.arctan2(sine, a @ b))


def matrices_from_quaternions(quaternions: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) of quaternions (n, 4), which need not have length 1."""
    x, y, z, w = (quaternions / np.sqrt((quaternions**2).sum(axis=1, keepdims=True))).T
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    xy, xz, yz, xw, yw, zw = x * y, x * z, y * z, x * w, y * w, z * w
    rows = [xx - yy - zz + ww, 2 * (xy - zw), 2 * (xz + yw),
            2 * (xy + zw), -xx + yy - zz + ww, 2 * (yz - xw),
            2 * (xz - yw), 2 * (yz + xw), -xx - yy + zz + ww]  # fmt: skip
    return np.stack(rows, axis=1).reshape(-1, 3, 3)


def quaternions_from_matrices(rotations: np.ndarray) -> np.ndarray:
    """Unit quaternions (n, 4) of rotation matrices (n, 3, 3); w is not negative.

    Each is computed from its largest component, so that none is divided by a small number.
    """
    m = np.moveaxis(rotations, 0, 2)
    xx, yy, zz = m[0, 0], m[1, 1], m[2, 2]
    xw, yw, zw = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    xy, xz, yz = m[1, 0] + m[0, 1], m[2, 0] + m[0, 2], m[2, 1] + m[1, 2]
    trace = xx + yy + zz
    by_largest = np.array([[1 - trace + 2 * xx, xy, xz, xw], [xy, 1 - trace + 2 * yy, yz, yw],
                           [xz, yz, 1 - trace + 2 * zz, zw], [xw, yw, zw, 1 + trace]])  # fmt: skip
    largest = np.argmax([xx, yy, zz, trace], axis=0)
    found = by_largest[largest, :, np.arange(len(rotations))]
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    return np.where(found[:, 3:] < 0, -found, found)
