"""How fast each joint may turn: joint limits, and obstacles that push joints away.

After the reactive controller of Nguyen et al. (2018) and its published code (robotology/react-control):
an obstacle does not add a motion, it narrows what the joints may do until they give way.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np


def guarded_bounds(
    q_rad: np.ndarray, limits_rad: np.ndarray, fastest_rad_s: float, guard: float, period_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Velocities that slow down towards the joint limits and never cross them.

    Within `guard` (a part of the joint's range) of a limit the bound towards it is scaled by
    `(1 + tanh(10 (x - 1/2))) / 2`, where x goes from 0 at the limit to 1 at the guard's end. A joint
    outside its limits is brought back, no faster than `fastest_rad_s`.

    Parameters
    ----------
    q_rad : (n,); limits_rad : (n, 2)

    Returns
    -------
    lowest, highest : (n,) rad/s
    """
    width = guard * (limits_rad[:, 1] - limits_rad[:, 0])
    room = np.stack([q_rad - limits_rad[:, 0], limits_rad[:, 1] - q_rad])
    slowed = fastest_rad_s * 0.5 * (1 + np.tanh(10 * (room / width - 0.5)))
    # Bound by the limit itself: one period at that velocity ends on it.
    towards = np.maximum(np.minimum(slowed, room / period_s), -fastest_rad_s)
    return -towards[0], towards[1]


def retreat_velocities(
    jacobian: np.ndarray, normal: np.ndarray, magnitude: float, gain_rad_s: float
) -> np.ndarray:
    """Joint velocities (n,) that move a point of the skin back from an obstacle: `-J^T n` times gains.

    Parameters
    ----------
    jacobian : (3, n) of the point, root frame
    normal : (3,) towards the obstacle, root frame
    magnitude : of the obstacle, dimensionless
    gain_rad_s : for a lever arm of one metre and magnitude 1
    """
    return -gain_rad_s * magnitude * (jacobian.T @ normal)


def shape_bounds(
    lowest: np.ndarray, highest: np.ndarray, retreats: Iterable[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds that make every joint at least as fast as each retreat wants, as far as they allow it.

    Obstacles come one after another. One that wants a joint to turn forward raises its lower bound (and
    the upper one where that is lower), one that wants it back lowers the upper bound likewise; never
    beyond the bounds given.

    Parameters
    ----------
    lowest, highest : (n,) rad/s
    retreats : velocities (n,), see `retreat_velocities`
    """
    low, high = lowest.copy(), highest.copy()
    for retreat in retreats:
        wanted = np.clip(retreat, lowest, highest)
        forward = retreat >= 0
        low = np.where(forward, np.maximum(low, wanted), low)
        high = np.where(forward, np.maximum(high, low), np.minimum(high, wanted))
        low = np.where(forward, low, np.minimum(low, high))
    return low, high
