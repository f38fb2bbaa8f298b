"""Rigid alignment of matched 3D points, and measures of its reliability."""

from dataclasses import dataclass

import numpy as np

from hicp_lib.core.errors import InputError

# Second over first singular value of the centred points. Below it they count as a line: one of a metre with a
# millimetre of noise does not determine the rotation about itself.
MIN_SPREAD_RATIO = 1e-3


@dataclass(frozen=True)
class RigidFit:
    """A rigid transform fitted to matched points.

    Attributes
    ----------
    T_b_a : array, shape (4, 4)
        Takes coordinates in a to coordinates in b.
    residuals_m : array, shape (n,)
        Distance of each point in b from its transformed partner.
    leave_one_out_m : array, shape (n,)
        The same with the transform fitted to all *other* points, which the point does not influence; NaN
        where the others do not determine a transform.
    spread_ratio : float
        Second over first singular value of the centred points, the smaller of those of a and b; 0 for points
        on a line.
    """

    T_b_a: np.ndarray
    residuals_m: np.ndarray
    leave_one_out_m: np.ndarray
    spread_ratio: float

    @property
    def rms_m(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residuals_m**2)))


def arun(points_a_m: np.ndarray, points_b_m: np.ndarray, about_origin: bool = False) -> RigidFit:
    """The rigid transform that takes `points_a_m` nearest to `points_b_m` in the least-squares sense.

    Arun, Huang and Blostein (PAMI 1987), with the sign of Umeyama (PAMI 1991): the best proper rotation
    also where the unconstrained solution is a reflection (coplanar points, or much noise).

    Parameters
    ----------
    points_a_m, points_b_m : array, shape (n, 3)
        Row i of one is row i of the other; n >= 3.
    about_origin : bool, optional
        Map a's origin to b's exactly, and fit the rotation only.

    Returns
    -------
    RigidFit

    Raises
    ------
    InputError
        If the points are fewer than three, not finite, or on a line (`MIN_SPREAD_RATIO`).

    Examples
    --------
    >>> corners_m = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    >>> arun(corners_m, corners_m + [0, 0, 2]).T_b_a[:3, 3].round(9)
    array([0., 0., 2.])
    """
    a, b = np.asarray(points_a_m, dtype=float), np.asarray(points_b_m, dtype=float)
    if a.shape != b.shape or a.ndim != 2 or a.shape[1] != 3:
        raise ValueError(f"matched points (n, 3) are needed, not {a.shape} and {b.shape}")
    if len(a) < 3:
        raise InputError(f"{len(a)} matched points do not fix a rigid transform; 3 off one line are needed")
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise InputError("matched points must be finite; leave out those without a position")
    ratio = min(_spread_ratio(a), _spread_ratio(b))
    if ratio < MIN_SPREAD_RATIO:
        raise InputError(
            f"the {len(a)} matched points lie on a line or in one place (singular-value ratio {ratio:.1e}, "
            f"at least {MIN_SPREAD_RATIO:.0e} is needed); add points off that line"
        )
    T_b_a = _solve(a, b, about_origin)
    return RigidFit(T_b_a, _distances(T_b_a, a, b), _leave_one_out(a, b, about_origin), ratio)


def _spread_ratio(points: np.ndarray) -> float:
    values = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(values[1] / values[0]) if values[0] > 0 else 0.0


def _solve(a: np.ndarray, b: np.ndarray, about_origin: bool) -> np.ndarray:
    mean_a, mean_b = (np.zeros(3) if about_origin else points.mean(axis=0) for points in (a, b))
    U, _, Vt = np.linalg.svd((a - mean_a).T @ (b - mean_b))
    sign = np.sign(np.linalg.det(U) * np.linalg.det(Vt))
    T = np.eye(4)
    T[:3, :3] = Vt.T @ np.diag([1.0, 1.0, sign]) @ U.T
    T[:3, 3] = mean_b - T[:3, :3] @ mean_a
    return T


def _distances(T_b_a: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.linalg.norm(a @ T_b_a[:3, :3].T + T_b_a[:3, 3] - b, axis=-1)


def _leave_one_out(a: np.ndarray, b: np.ndarray, about_origin: bool) -> np.ndarray:
    errors = np.full(len(a), np.nan)
    for i in range(len(a)):
        others = np.arange(len(a)) != i
        if others.sum() >= 3 and min(_spread_ratio(a[others]), _spread_ratio(b[others])) >= MIN_SPREAD_RATIO:
            errors[i] = _distances(_solve(a[others], b[others], about_origin), a[i], b[i])
    return errors
