"""Velocity bounds of each joint, from joint limits and from obstacles that push joints away.

After the reactive controller of Nguyen et al. (2018) and its published code (robotology/react-control): an
obstacle does not add a motion; it narrows the velocity bounds until the joints move away. Tightening the
bounds before they push is our addition, similar to the authors' later controller (HARMONIOUS, 2023).
"""

from collections.abc import Iterable

import numpy as np

_STEEPNESS = 10  # steepness of the transition from full speed to none, over the guard


def guarded_bounds(
    q_rad: np.ndarray, limits_rad: np.ndarray, fastest_rad_s: float, guard: float, period_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Velocities that slow down towards the joint limits and never cross them.

    Within `guard` (a fraction of the joint's range) of a limit the bound towards it is scaled by
    `(1 + tanh(10 (x - 1/2))) / 2`, where x goes from 0 at the limit to 1 at the guard's end. A joint
    outside its limits is brought back, no faster than `fastest_rad_s`.

    Parameters
    ----------
    q_rad : array, shape (n,)
    limits_rad : array, shape (n, 2)
    fastest_rad_s : float
    guard : float
    period_s : float
        Time between two commands.

    Returns
    -------
    lowest, highest : array, shape (n,)
        rad/s.

    Examples
    --------
    A joint in the middle of its range, and one halfway through the guard at its upper limit:

    >>> limits_rad = np.array([[-1.0, 1.0], [-1.0, 1.0]])
    >>> lowest, highest = guarded_bounds(np.array([0.0, 0.95]), limits_rad, 0.5, 0.05, 0.02)
    >>> highest.round(3)
    array([0.5 , 0.25])
    """
    width = guard * (limits_rad[:, 1] - limits_rad[:, 0])
    room = np.stack([q_rad - limits_rad[:, 0], limits_rad[:, 1] - q_rad])
    slowed = fastest_rad_s * 0.5 * (1 + np.tanh(_STEEPNESS * (room / width - 0.5)))
    # Bound by the limit itself: one period at that velocity ends at it.
    towards = np.maximum(np.minimum(slowed, room / period_s), -fastest_rad_s)
    return -towards[0], towards[1]


def pushes(jacobian: np.ndarray, normal: np.ndarray, gain_rad_s: float) -> np.ndarray:
    """Joint velocities that move a point of the skin back from an obstacle: `-J^T n` times the gain.

    Parameters
    ----------
    jacobian : array, shape (3, n)
        Of the point, root frame.
    normal : array, shape (3,)
        Towards the obstacle, root frame.
    gain_rad_s : float
        For a lever arm of one metre.

    Returns
    -------
    array, shape (n,)
        rad/s.

    Examples
    --------
    >>> pushes(np.array([[0.3], [0.0], [0.0]]), np.array([1.0, 0.0, 0.0]), 2.0)
    array([-0.6])
    """
    return -gain_rad_s * (jacobian.T @ normal)


def shape_bounds(
    lowest: np.ndarray,
    highest: np.ndarray,
    obstacles: Iterable[tuple[np.ndarray, float]],
    onset: float,
    neutral: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds that make every joint avoid obstacles, as far as the given bounds allow.

    Obstacles are applied one after another. One that pushes a joint forward raises its lower bound (and the
    upper one if that is lower); one that pushes it back lowers the upper bound in the same way: to the push
    times the magnitude above `neutral`. From magnitude `onset` on, joints may turn towards the obstacle only
    at decreasing speed, and from `neutral` on not at all. In the published form (`neutral` 0, from 0.2 on)
    the push starts with a step: at that distance the arm oscillates between retreat and return.

    Parameters
    ----------
    lowest, highest : array, shape (n,)
        rad/s, before.
    obstacles : iterable of tuple
        For each, the velocities (n,) of its push (see `pushes`), and its magnitude.
    onset, neutral : float
        Magnitudes.

    Returns
    -------
    lowest, highest : array, shape (n,)
        rad/s.

    Examples
    --------
    >>> low, high = np.array([-0.5]), np.array([0.5])
    >>> shape_bounds(low, high, [(np.array([0.4]), 0.7)], onset=0.1, neutral=0.2)
    (array([0.2]), array([0.5]))
    """
    low, high = lowest.copy(), highest.copy()
    for push, magnitude in obstacles:
        forward, back = push > 0, push < 0
        if magnitude >= neutral:
            bound = push * (magnitude - neutral)
        else:
            bound = np.where(forward, lowest, highest) * min((neutral - magnitude) / (neutral - onset), 1.0)
        bound = np.clip(bound, lowest, highest)
        low = np.where(forward, np.maximum(low, bound), low)
        high = np.where(back, np.minimum(high, bound), np.maximum(high, low))
        low = np.where(back, np.minimum(low, high), low)
    return low, high
