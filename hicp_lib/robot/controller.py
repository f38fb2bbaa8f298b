"""The reactive controller: one hand holds a target position (its *post*), and all joints avoid obstacles.

Every 20 ms a quadratic program chooses the velocities of the ten joints of torso and arm: the hand is
attracted to its post and the joints to a rest posture, smoothly, within the bounds of `velocity_bounds` and
those of the shoulder's cables. After Nguyen et al. (2018), with the costs of the version the authors used in
2022 (robotology/react-control); solved by DAQP. This is not a safety function.
"""

from dataclasses import dataclass, field

import numpy as np
from qpsolvers import Problem, solve_problem

from hicp_lib.robot.kinematics import ARM_JOINTS, ICub
from hicp_lib.robot.peripersonal_space import Obstacle
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.velocity_bounds import guarded_bounds, pushes, shape_bounds


class NoSolution(Exception):
    """There are no velocities that satisfy all bounds; the message says why."""


@dataclass(frozen=True, eq=False)
class Settings:
    """Parameters of the controller; `PUBLISHED` has the published values.

    Attributes
    ----------
    period_s : float
        Time between two commands.
    fastest_rad_s : float
        Maximum speed of every joint (30 degrees per second in 2022, 20 in 2018).
    retreat_rad_s : float
        Velocity `v_a` of the retreat per metre of lever arm (50 degrees per second).
    gain : float
        Factor on it (published: 0.5 for vision, 1.5 for touch; ours acts on smaller magnitudes, see
        `neutral`).
    onset, neutral : float
        Magnitudes from which an obstacle slows joints that turn towards it, and from which it pushes them
        back (ours; published: the push starts at 0.2, at full strength).
    guard : float
        Fraction of a joint's range in which it slows down towards its limit.
    post_weight, rest_weight, smooth_weight : float
        Weights of the hand's velocity error (m/s)^2, of the joints' velocity error towards rest (rad/s)^2,
        and of changes of velocity (rad/s)^2.
    approach_s : float
        Time in which the hand is to reach its post ... (ours)
    approach_m_s : float
        ... but no faster than this (ours).
    rest_s : float
        Time in which the joints are to reach rest; with `rest_weight` (published: 0.01) chosen so that they
        do not oscillate (ours).

    Examples
    --------
    >>> Settings(gain=2.0).period_s
    0.02
    """

    period_s: float = 0.02
    fastest_rad_s: float = np.deg2rad(30.0)
    retreat_rad_s: float = np.deg2rad(50.0)
    gain: float = 10.0
    onset: float = 0.1
    neutral: float = 0.2
    guard: float = 0.025
    post_weight: float = 10.0
    rest_weight: float = 0.1
    smooth_weight: float = 1.0
    approach_s: float = 0.3
    approach_m_s: float = 0.3
    rest_s: float = 1.0


PUBLISHED = Settings(gain=0.5, onset=0.2, neutral=0.0, rest_weight=0.01, rest_s=0.3)
"""The parameters of Nguyen et al. (2018), with the joint speed of 2022."""


@dataclass(eq=False)
class Controller:
    """Computes joint velocities for torso and one arm; keeps the last ones as state.

    Attributes
    ----------
    icub : ICub
        The robot.
    post_m : array, shape (3,)
        Target position of the palm, root frame.
    rest_rad : array, shape (10,)
        Angles to which the joints are attracted.
    side : str
        "left" or "right", the arm that is controlled.
    settings : Settings

    Examples
    --------
    At its post, without obstacles, the arm stands still:

    >>> from hicp_lib.robot.home import HOME_M, home_posture
    >>> from hicp_lib.robot.kinematics import load_icub
    >>> icub = load_icub()
    >>> home = home_posture(icub)
    >>> controller = Controller(icub, np.array(HOME_M["left"]), home.angles("left"))
    >>> bool(np.abs(controller.velocities(home, [])).max() < 1e-4)
    True
    """

    icub: ICub
    post_m: np.ndarray
    rest_rad: np.ndarray
    side: str = "left"
    settings: Settings = field(default_factory=Settings)
    _last: np.ndarray = field(default_factory=lambda: np.zeros(len(ARM_JOINTS)), repr=False)

    def velocities(self, posture: Posture, obstacles: list[Obstacle]) -> np.ndarray:
        """Velocities for the next period.

        Parameters
        ----------
        posture : Posture
            The robot's current one.
        obstacles : list of Obstacle

        Returns
        -------
        array, shape (10,)
            Of `ARM_JOINTS`, rad/s.

        Raises
        ------
        NoSolution
            If the angles are not finite, or no velocities satisfy all bounds. The next call then starts from
            rest.
        """
        q, last = posture.angles(self.side), self._last
        self.stop()
        if not np.isfinite(q).all():
            raise NoSolution("joint angles are not finite")
        lowest, highest = self._bounds(posture, q, obstacles)
        chosen = solve_problem(self._problem(q, last, lowest, highest), solver="daqp").x
        if chosen is None or not np.isfinite(chosen).all():
            raise NoSolution("no velocities satisfy the bounds of joints and cables")
        # The solver satisfies bounds only within its tolerance.
        self._last = np.clip(chosen, lowest, highest)
        return self._last.copy()

    def stop(self) -> None:
        """Reset after the arm was stopped: the next velocities start from rest."""
        self._last = np.zeros(len(ARM_JOINTS))

    def _bounds(
        self, posture: Posture, q: np.ndarray, obstacles: list[Obstacle]
    ) -> tuple[np.ndarray, np.ndarray]:
        limits, settings = self.icub.chains[self.side].limits_rad, self.settings
        lowest, highest = guarded_bounds(q, limits, settings.fastest_rad_s, settings.guard, settings.period_s)
        pushed = [(self._pushes(posture, obstacle), obstacle.magnitude) for obstacle in obstacles]
        shaped = shape_bounds(lowest, highest, pushed, settings.onset, settings.neutral)
        return self._within_cables(q, *shaped)

    def _pushes(self, posture: Posture, obstacle: Obstacle) -> np.ndarray:
        """Velocities by which an obstacle pushes the controlled joints; none for another limb's obstacle."""
        chain, link = self.icub.parts[obstacle.part]
        q = posture.angles(chain)
        jacobian = self.icub.chains[chain].jacobian(link, q, obstacle.point_m)
        shared = np.zeros((3, len(ARM_JOINTS)))
        n = len(ARM_JOINTS) if chain == self.side else 3
        shared[:, :n] = jacobian[:, :n]
        normal = self.icub.chains[chain].T_root_link(link, q)[:3, :3] @ obstacle.normal
        return pushes(shared, normal, self.settings.gain * self.settings.retreat_rad_s)

    def _cable_bounds(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The cables' inequalities `rows @ velocities <= most`; outside them, at least no further out."""
        chain = self.icub.chains[self.side]
        length = chain.cables @ q
        room = np.concatenate([chain.cables_upper_rad - length, length - chain.cables_lower_rad])
        rows, finite = np.concatenate([chain.cables, -chain.cables]), np.isfinite(room)
        return rows[finite], np.maximum(room[finite], 0) / self.settings.period_s

    def _within_cables(
        self, q: np.ndarray, lowest: np.ndarray, highest: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Relax velocity bounds towards zero until they are compatible with the cables.

        Otherwise a retreat that pulls a cable would leave no feasible velocities, and stop the arm.
        """
        forced = np.clip(0, lowest, highest)
        rows, most = self._cable_bounds(q)
        pull = rows @ forced
        scale = np.min(most[pull > most] / pull[pull > most], initial=1.0)
        return np.minimum(lowest, scale * forced), np.maximum(highest, scale * forced)

    def _problem(self, q: np.ndarray, last: np.ndarray, lowest: np.ndarray, highest: np.ndarray) -> Problem:
        """Least squares in the velocities, as `1/2 x'Px + c'x` with the cables' inequalities."""
        settings, chain = self.settings, self.icub.chains[self.side]
        jacobian = chain.jacobian("hand", q)
        away = self.post_m - chain.T_root_link("hand", q)[:3, 3]
        towards = away / max(settings.approach_s, np.linalg.norm(away) / settings.approach_m_s)
        to_rest = (self.rest_rad - q) / settings.rest_s
        P = settings.post_weight * jacobian.T @ jacobian
        P[np.diag_indices_from(P)] += settings.rest_weight + settings.smooth_weight
        c = -settings.post_weight * jacobian.T @ towards
        c -= settings.rest_weight * to_rest + settings.smooth_weight * last
        rows, most = self._cable_bounds(q)
        return Problem(P, c, G=rows, h=most, lb=lowest, ub=highest)
