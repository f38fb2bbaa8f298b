"""Bounds against their formulas; the controller against what it promises."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from qpsolvers import Solution

from hicp_lib.robot.controller import PUBLISHED, Controller, NoSolution, Settings
from hicp_lib.robot.home import HOME_M
from hicp_lib.robot.kinematics import ARM_JOINTS
from hicp_lib.robot.peripersonal_space import Obstacle
from hicp_lib.robot.velocity_bounds import guarded_bounds, pushes, shape_bounds

LIMITS = np.array([[-1.0, 1.0], [0.0, 2.0]])
PERIOD_S = 0.02


@pytest.fixture
def controller(icub, home):
    return Controller(icub, np.array(HOME_M["left"]), home.angles("left"))


def palm(icub, posture):
    return icub.chains["left"].T_root_link("hand", posture.angles("left"))


def in_front_of(part="left_hand", magnitude=1.0, normal=(0, 0, -1)):
    return Obstacle(part, np.zeros(3), np.array(normal, dtype=float), magnitude)


def run(controller, posture, obstacles, n):
    """n cycles; returns the last posture."""
    for _ in range(n):
        q = posture.angles("left") + PERIOD_S * controller.velocities(posture, obstacles)
        posture = posture.moved("left", q)
    return posture


def test_guard_slows_joints_near_their_limits():
    low, high = guarded_bounds(np.array([0.0, 1.975]), LIMITS, 0.5, 0.025, PERIOD_S)
    np.testing.assert_allclose([low[0], high[0]], [-0.5, 0.5])
    # Half way through the guard, 25 mrad before the limit: half as fast, towards the limit only.
    assert high[1] == pytest.approx(0.25) and low[1] == pytest.approx(-0.5)


@settings(deadline=None)
@given(st.floats(-1.5, 1.5), st.floats(0.1, 3))
def test_limits_are_never_crossed_and_joints_outside_come_back(q, fastest):
    limits = LIMITS[:1]
    low, high = guarded_bounds(np.array([q]), limits, fastest, 0.025, PERIOD_S)
    assert -fastest <= low[0] <= high[0] <= fastest
    if -1 <= q <= 1:
        assert q + PERIOD_S * low[0] >= -1 - 1e-12 and q + PERIOD_S * high[0] <= 1 + 1e-12
        assert low[0] <= 0 <= high[0]
    elif q > 1:
        assert high[0] == pytest.approx(-min(fastest, (q - 1) / PERIOD_S))


def test_an_obstacle_pushes_away():
    # A lever of 0.3 m, magnitude 1: 15 degrees per second, as the published constants give.
    jacobian = np.array([[0.3], [0.0], [0.0]])
    velocity = pushes(jacobian, np.array([1.0, 0, 0]), np.deg2rad(50))
    np.testing.assert_allclose(np.rad2deg(velocity), [-15])


def shaped(*obstacles, onset=PUBLISHED.onset, neutral=PUBLISHED.neutral):
    """Bounds of one joint that may turn at -0.5 to 0.5 rad/s; obstacles are (push, magnitude)."""
    obstacles = [(np.array([push]), magnitude) for push, magnitude in obstacles]
    bounds = shape_bounds(np.array([-0.5]), np.array([0.5]), obstacles, onset, neutral)
    return pytest.approx([float(bound[0]) for bound in bounds])


def test_bounds_as_published_for_one_joint():
    assert shaped() == [-0.5, 0.5]
    assert shaped((0.4, 0.5)) == [0.2, 0.5]
    assert shaped((-0.4, 0.5)) == [-0.5, -0.2]
    assert shaped((9.0, 1.0)) == [0.5, 0.5]
    assert shaped((0.1, 1.0), (0.3, 1.0)) == [0.3, 0.5]
    assert shaped((0.3, 1.0), (0.1, 1.0)) == [0.3, 0.5]
    # Contradicting ones: the later moves both bounds.
    assert shaped((0.2, 1.0), (-0.1, 1.0)) == [-0.1, -0.1]
    assert shaped((-0.1, 1.0), (0.2, 1.0)) == [0.2, 0.2]
    # A joint the obstacle does not push (beyond the threatened part) stays free.
    assert shaped((0.0, 1.0)) == [-0.5, 0.5]


def test_bounds_tighten_before_they_push():
    def at(magnitude):
        return shaped((2.0, magnitude), onset=0.1, neutral=0.2)

    assert at(0.05) == [-0.5, 0.5]
    assert at(0.1) == [-0.5, 0.5]
    assert at(0.15) == [-0.25, 0.5]
    assert at(0.2) == [0.0, 0.5]
    assert at(0.3) == [0.2, 0.5]


@settings(deadline=None)
@given(st.lists(st.tuples(st.lists(st.floats(-5, 5), min_size=3, max_size=3), st.floats(0, 2)), max_size=5))
def test_shaped_bounds_stay_within_those_given(obstacles):
    low, high = np.array([-0.5, 0.0, -0.1]), np.array([0.5, 0.3, -0.05])
    obstacles = [(np.array(push), magnitude) for push, magnitude in obstacles]
    shaped_low, shaped_high = shape_bounds(low, high, obstacles, onset=0.1, neutral=0.2)
    assert (low <= shaped_low).all() and (shaped_low <= shaped_high).all() and (shaped_high <= high).all()


def test_home_is_at_the_post_and_kept(icub, home, controller):
    np.testing.assert_allclose(palm(icub, home)[:3, 3], HOME_M["left"], atol=1e-3)
    later = run(controller, home, [], 50)
    np.testing.assert_allclose(palm(icub, later)[:3, 3], HOME_M["left"], atol=1e-3)


def test_hand_returns_to_its_post_within_two_seconds(icub, home, controller):
    away = home.moved("left", home.angles("left") + 0.2)
    assert np.linalg.norm(palm(icub, away)[:3, 3] - HOME_M["left"]) > 0.05
    back = run(controller, away, [], 100)
    assert np.linalg.norm(palm(icub, back)[:3, 3] - HOME_M["left"]) < 0.02


@pytest.mark.parametrize("part", ["left_hand", "left_forearm", "left_upper_arm", "torso", "right_hand"])
def test_threatened_parts_move_away(icub, home, controller, part):
    chain, link = icub.parts[part]

    def place(posture):
        return icub.chains[chain].T_root_link(link, posture.angles(chain))

    normal = {"left_hand": (0, 0, -1), "torso": (1, 0, 0)}.get(part, (0, 0, 1))
    later = run(controller, home, [in_front_of(part, normal=normal)], 10)
    moved = place(later)[:3, 3] - place(home)[:3, 3]
    assert moved @ (place(home)[:3, :3] @ normal) < -1e-4


def test_joints_beyond_the_threatened_part_are_not_pushed(controller, home):
    pushed = controller._pushes(home, in_front_of("left_forearm"))
    assert (pushed[-2:] == 0).all() and (np.abs(pushed[:-2]) > 1e-6).any()
    assert (controller._pushes(home, in_front_of("left_upper_arm"))[-4:] == 0).all()
    assert (controller._pushes(home, in_front_of("right_forearm"))[3:] == 0).all()


angles = st.lists(st.floats(0, 1), min_size=10, max_size=10)
normals = st.lists(st.floats(-1, 1), min_size=3, max_size=3)


@settings(max_examples=40, deadline=None)
@given(angles, normals, normals, st.floats(0.1, 2), st.floats(0.5, 20))
def test_limits_and_cables_hold_wherever_the_arm_is(icub, home, where, n_hand, n_arm, magnitude, gain):
    """A cycle from any angles within the limits; the cables hold if they held before."""
    chain = icub.chains["left"]
    low, high = chain.limits_rad.T
    q = low + np.array(where) * (high - low)
    controller = Controller(icub, np.array(HOME_M["left"]), home.angles("left"), settings=Settings(gain=gain))
    threats = [in_front_of("left_hand", magnitude, n_hand), in_front_of("left_upper_arm", magnitude, n_arm)]
    velocities = controller.velocities(home.moved("left", q), threats)
    after = q + PERIOD_S * velocities
    assert (np.abs(velocities) <= controller.settings.fastest_rad_s + 1e-12).all()
    assert (after >= low - 1e-12).all() and (after <= high + 1e-12).all()
    for side in (1, -1):
        bound = chain.cables_upper_rad if side > 0 else -chain.cables_lower_rad
        before, now = side * chain.cables @ q, side * chain.cables @ after
        assert (now <= np.maximum(bound, before) + 1e-6).all()


def test_unknown_angles_have_no_solution(home, controller):
    with pytest.raises(NoSolution, match="joint angles are not finite"):
        controller.velocities(home.moved("left", np.full(10, np.nan)), [])


def test_no_solution_is_said_and_the_next_cycle_starts_from_rest(home, controller, monkeypatch):
    away = home.moved("left", home.angles("left") + 0.2)
    from_rest = controller.velocities(away, [])
    with monkeypatch.context() as patched:
        patched.setattr("hicp_lib.robot.controller.solve_problem", lambda *_, **__: Solution(None))
        with pytest.raises(NoSolution, match="no velocities satisfy the bounds"):
            controller.velocities(away, [])
    np.testing.assert_array_equal(controller.velocities(away, []), from_rest)


def test_joints_outside_their_limits_come_back(icub, home, controller):
    """Also where coming back would pull a cable: as fast as the cables allow."""
    q = home.angles("left")
    for joint, angle_deg in (("shoulder_roll", -60), ("shoulder_pitch", 60), ("shoulder_yaw", -60)):
        q[ARM_JOINTS.index(joint)] = np.deg2rad(angle_deg)
    low, high = icub.chains["left"].limits_rad.T
    before = np.maximum(low - q, q - high).max()
    q = run(controller, home.moved("left", q), [], 100).angles("left")
    assert np.maximum(low - q, q - high).max() < 0.5 * before


def test_the_controller_has_these_numbers():
    """Those published are said to be; the others are what the study's avoidance was tuned to."""
    ours, published = Settings(), PUBLISHED
    assert (ours.period_s, ours.guard) == (published.period_s, published.guard) == (0.02, 0.025)
    assert np.rad2deg([ours.fastest_rad_s, ours.retreat_rad_s]) == pytest.approx([30, 50])
    assert (published.gain, published.onset, published.neutral) == (0.5, 0.2, 0.0)
    assert (ours.gain, ours.onset, ours.neutral) == (10.0, 0.1, 0.2)
    assert (
        (ours.post_weight, ours.smooth_weight) == (published.post_weight, published.smooth_weight) == (10, 1)
    )
    assert (published.rest_weight, published.rest_s) == (0.01, 0.3)
    assert (ours.rest_weight, ours.rest_s, ours.approach_s, ours.approach_m_s) == (0.1, 1.0, 0.3, 0.3)


def test_velocities_are_the_least_squares_of_their_costs(icub, home):
    """Inside all bounds the answer is that of the normal equations, written out."""
    settings = Settings(post_weight=7.0, rest_weight=0.3, smooth_weight=2.0, approach_s=0.4, rest_s=0.8)
    q = home.angles("left")
    post, rest = np.array(HOME_M["left"]) + 0.01, q + 0.02
    controller = Controller(icub, post, rest, settings=settings)
    jacobian = icub.chains["left"].jacobian("hand", q)
    last, away = np.zeros(10), post - palm(icub, home)[:3, 3]
    for _ in range(2):
        P = 7.0 * jacobian.T @ jacobian + (0.3 + 2.0) * np.eye(10)
        c = 7.0 * jacobian.T @ (away / 0.4) + 0.3 * (rest - q) / 0.8 + 2.0 * last
        last = np.linalg.solve(P, c)
        np.testing.assert_allclose(controller.velocities(home, []), last, atol=1e-6)


def test_the_hand_comes_no_faster_than_it_may(icub, home):
    far = Settings(rest_weight=1e-9, smooth_weight=1e-9, approach_m_s=0.05)
    post = np.array(HOME_M["left"]) + (0.0, 0.0, 0.2)
    controller = Controller(icub, post, home.angles("left"), settings=far)
    velocity = icub.chains["left"].jacobian("hand", home.angles("left")) @ controller.velocities(home, [])
    assert np.linalg.norm(velocity) == pytest.approx(0.05, rel=0.02)


@pytest.mark.parametrize(("share", "slowed"), [(0.25, -2.5), (0.4, -1.0), (0.6, 1.0), (0.75, 2.5)])
def test_over_the_guard_the_bound_rises_as_a_hyperbolic_tangent(share, slowed):
    """Ten times the share of the guard beyond its middle is the tangent's argument."""
    q = np.array([-1 + share * 0.025 * 2, 2 - share * 0.025 * 2])  # which is 50 mrad wide
    low, high = guarded_bounds(q, LIMITS, 0.5, 0.025, 1e-6)
    expected = 0.25 * (1 + np.tanh(slowed))
    assert (-low[0], high[1]) == pytest.approx((expected, expected))
    assert (high[0], -low[1]) == pytest.approx((0.5, 0.5))
