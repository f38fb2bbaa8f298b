"""Rotation matrices and unit quaternions (x, y, z, w)."""

import numpy as np


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
