"""Random streams of keypoints, from plausible to absurd, and what may never come of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hicp_lib.robot.controller import Controller, Settings
from hicp_lib.robot.home import HOME_M
from hicp_lib.robot.kinematics import ICub
from hicp_lib.robot.loop import STOPPED, AvoidanceLoop, Perception
from hicp_lib.robot.posture import Posture

CYCLE_S = 0.02
CABLE_TOLERANCE_RAD = 1e-6  # the solver's


def random_stream(rng: np.random.Generator, n_cycles: int) -> Iterator[tuple[float, Perception | None]]:
    """Times of cycles, and what is perceived in them: people move about, and every kind of fault happens."""
    n_people = int(rng.choice([0, 1, 2, 5, 50], p=[0.1, 0.4, 0.3, 0.15, 0.05]))
    people = rng.normal((-0.5, 0, 0.1), 0.3, (n_people, 1, 3)) + rng.normal(0, 0.2, (n_people, 136, 3))
    walk = rng.normal(0, 1.0, (n_people, 1, 3))
    every, faults = int(rng.integers(1, 8)), rng.uniform(0, 1, 8) < 0.3
    for k in range(n_cycles):
        people = people + CYCLE_S * walk + rng.normal(0, 0.005, people.shape)
        now_s = k * CYCLE_S
        seen = k % every == 0 and not (faults[0] and rng.uniform() < 0.5)  # dropouts of whole frames
        yield now_s, _faulty(rng, now_s, people, faults) if seen else None


def _faulty(rng: np.random.Generator, now_s: float, people: np.ndarray, faults: np.ndarray) -> Perception:
    _, not_a_number, jumps, inside, odd_scores, odd_times, huge, invented = faults
    points, scores = people.copy(), rng.uniform(0, 1, people.shape[:2])
    some = rng.uniform(size=points.shape) < 0.1
    if not_a_number:
        points[some] = np.nan
    if jumps:
        points += rng.normal(0, 1, (len(points), 1, 3)) * (rng.uniform() < 0.3)
    if inside:
        points = np.where(rng.uniform(size=scores.shape)[..., None] < 0.5, 0.05 * points, points)
    if odd_scores:
        scores = np.where(some[..., 0], rng.choice([np.nan, np.inf, -np.inf, -3, 7], scores.shape), scores)
    if huge:
        points[some] = rng.choice([np.inf, -np.inf, 1e300, -1e300, 1e6])
    if invented and len(points):
        points, scores = points[rng.permutation(len(points))[1:]], scores[1:]
    if odd_times:
        now_s = rng.choice([now_s, now_s - 0.1, now_s + 5, np.nan, np.inf, -np.inf])
    return Perception(float(now_s), points, scores)


def random_posture(rng: np.random.Generator, icub: ICub, home: Posture) -> Posture:
    """The left arm anywhere its limits and cables allow."""
    chain = icub.chains["left"]
    while True:
        q = rng.uniform(*chain.limits_rad.T)
        length = chain.cables @ q
        if (length >= chain.cables_lower_rad).all() and (length <= chain.cables_upper_rad).all():
            return home.moved("left", q)


def first_violation(rng: np.random.Generator, icub: ICub, home: Posture, n_cycles: int) -> str | None:
    """Drive the robot by one random stream; says what was violated first, or nothing."""
    settings = Settings(gain=float(rng.uniform(0.2, 20)), fastest_rad_s=float(rng.uniform(0.1, 3)))
    controller = Controller(icub, np.array(HOME_M["left"]), home.angles("left"), settings=settings)
    loop = AvoidanceLoop(controller)
    posture = random_posture(rng, icub, home)
    for now_s, perception in random_stream(rng, n_cycles):
        command, threat = loop.cycle(now_s, posture, perception)
        posture = posture.moved("left", posture.angles("left") + CYCLE_S * command.velocities_rad_s)
        problems = {
            "activation not finite": not np.isfinite(threat.activations).all(),
            "stopped, but moving": command.status == STOPPED and command.velocities_rad_s.any(),
            "stopped without a reason": (command.status == STOPPED) != bool(command.reason),
            "no solution": "bounds" in command.reason,
        } | _violated(controller, posture.angles("left"), command.velocities_rad_s)
        if any(problems.values()):
            return f"{now_s:.2f} s: " + ", ".join(name for name, present in problems.items() if present)
    return None


def _violated(controller: Controller, q: np.ndarray, velocities: np.ndarray) -> dict[str, bool]:
    chain = controller.icub.chains[controller.side]
    low, high = chain.limits_rad.T
    length = chain.cables @ q
    return {
        "velocity not finite": not np.isfinite(velocities).all(),
        "too fast": bool((np.abs(velocities) > controller.settings.fastest_rad_s + 1e-12).any()),
        "joint limit": bool((q < low - 1e-12).any() or (q > high + 1e-12).any()),
        "cable": bool(
            (length < chain.cables_lower_rad - CABLE_TOLERANCE_RAD).any()
            or (length > chain.cables_upper_rad + CABLE_TOLERANCE_RAD).any()
        ),
    }
