"""Exact distance between person and robot in the simulation, by which avoidance is evaluated.

The robot is represented by its taxels, and its arms by capsules; the person by the skin of the body model,
without clothes and hair. The robot's fingers are left out.
"""

import numpy as np
from scipy.spatial import cKDTree

from hicp_lib.robot.kinematics import ICub
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.segments import body_segments
from hicp_lib.robot.skin import read_skin

FAR_M = 0.6
"""Distances are limited to this value."""
_STEP_M = 0.01
_SOME = 32  # one in this number of vertices is checked first


def robot_spheres(icub: ICub, posture: Posture) -> tuple[np.ndarray, np.ndarray]:
    """The robot as spheres: taxels are points; upper arms, forearms and hands are rows a centimetre apart.

    Parameters
    ----------
    icub : ICub
    posture : Posture

    Returns
    -------
    centres_m : array, shape (n, 3)
        In the root frame.
    radii_m : array, shape (n,)
    """
    taxels, _ = read_skin().in_root(icub, posture)
    places, radii = [taxels], [np.zeros(len(taxels))]
    for segment in body_segments(icub, posture):
        if segment.part.endswith(("arm", "hand")):
            n = 2 + int(np.linalg.norm(segment.end_m - segment.start_m) / _STEP_M)
            places.append(np.linspace(segment.start_m, segment.end_m, n))
            radii.append(np.full(n, segment.radius_m))
    return np.concatenate(places), np.concatenate(radii)


def skin_distance_m(spheres: tuple[np.ndarray, np.ndarray], vertices_m: np.ndarray) -> float:
    """Smallest distance between robot and person in metres, at most `FAR_M`; 0 if they touch.

    To the nearest vertex of the person's mesh, which on hands is at most a few millimetres too far.

    Parameters
    ----------
    spheres : tuple of array
        See `robot_spheres`.
    vertices_m : array, shape (v, 3)
        Of the person, root frame.

    Returns
    -------
    float

    Examples
    --------
    >>> hand = np.zeros((1, 3)), np.array([0.03])
    >>> skin_distance_m(hand, np.array([[0.1, 0, 0], [0, 0.2, 0]]))
    0.07
    """
    places, radii = spheres
    # Some of the vertices give an upper bound for the others.
    some_m = _gaps_m(places, vertices_m[::_SOME], FAR_M).min()
    within_m = float(min(some_m, FAR_M) + radii.max())
    low, high = places.min(axis=0) - within_m, places.max(axis=0) + within_m
    columns = zip(vertices_m.T, low, high, strict=True)
    near = np.logical_and.reduce([(column > a) & (column < b) for column, a, b in columns])
    gaps_m = _gaps_m(vertices_m[near], places, within_m)
    return float(np.clip(np.min(gaps_m - radii), 0, FAR_M))


def _gaps_m(to_m: np.ndarray, from_m: np.ndarray, within_m: float) -> np.ndarray:
    """Distances (k,) of points `from_m` (k, 3) from the nearest of `to_m`; infinite beyond `within_m`."""
    if not len(to_m):
        return np.full(len(from_m), np.inf)
    tree = cKDTree(to_m, balanced_tree=False, compact_nodes=False)  # used once, so built quickly
    return tree.query(from_m, distance_upper_bound=within_m)[0]
