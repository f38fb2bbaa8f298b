"""The loop: what comes in, however odd, and what goes out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.core.keypoints import INDEX
from hicp_lib.robot.controller import PUBLISHED, Controller, Settings
from hicp_lib.robot.home import HOME_M, home_posture
from hicp_lib.robot.loop import AVOIDING, FREE, STOPPED, AvoidanceLoop, Perception, Threat
from hicp_lib.robot.peripersonal_space import Obstacle
from tests.robot.keypoint_streams import first_violation

PERIOD_S = 0.02
POST = np.array(HOME_M["left"])


@pytest.fixture
def make_loop(icub, home):
    def make(**options):
        return AvoidanceLoop(Controller(icub, POST, home.angles("left")), **options)

    return make


def wrist_at(place, time_s, score=0.9):
    points, scores = np.full((1, 136, 3), np.nan), np.zeros((1, 136))
    points[0, INDEX["left_wrist"]], scores[0, INDEX["left_wrist"]] = place, score
    return Perception(time_s, points, scores)


def nobody(time_s):
    return Perception(time_s, np.zeros((0, 136, 3)), np.zeros((0, 136)))


def reach(icub, home, loop, seconds=3.0, speed=0.4):
    """A wrist comes to the palm along its normal and stays; distances of the skin to it, and the posture."""
    T = icub.chains["left"].T_root_link("hand", home.angles("left"))
    posture, distances, statuses = home, [], set()
    for k in range(int(seconds / PERIOD_S)):
        wrist = POST - T[:3, 2] * max(0.6 - speed * k * PERIOD_S, 0.02)
        command, _ = loop.cycle(k * PERIOD_S, posture, wrist_at(wrist, k * PERIOD_S))
        posture = posture.moved("left", posture.angles("left") + PERIOD_S * command.velocities_rad_s)
        positions, _ = loop.skin.in_root(icub, posture)
        distances.append(np.linalg.norm(positions - wrist, axis=1).min())
        statuses.add(command.status)
    return np.array(distances), posture, statuses


def test_hand_gives_way_and_does_not_without_avoidance(icub, home, make_loop):
    with_avoidance, _, statuses = reach(icub, home, make_loop())
    without, posture, _ = reach(icub, home, make_loop(avoids=False))
    assert statuses == {FREE, AVOIDING}
    assert with_avoidance.min() > 2 * without.min() and with_avoidance.min() > 0.03
    hand = icub.chains["left"].T_root_link("hand", posture.angles("left"))[:3, 3]
    np.testing.assert_allclose(hand, POST, atol=2e-3)


def test_hand_comes_back_when_the_person_leaves(icub, home, make_loop):
    loop = make_loop()
    _, posture, _ = reach(icub, home, loop)
    hand = icub.chains["left"].T_root_link("hand", posture.angles("left"))[:3, 3]
    assert np.linalg.norm(hand - POST) > 0.05
    for k in range(100):
        now_s = 3.0 + k * PERIOD_S
        command, _ = loop.cycle(now_s, posture, nobody(now_s))
        posture = posture.moved("left", posture.angles("left") + PERIOD_S * command.velocities_rad_s)
    hand = icub.chains["left"].T_root_link("hand", posture.angles("left"))[:3, 3]
    assert np.linalg.norm(hand - POST) < 0.02


def test_arm_does_not_tremble_where_it_begins_to_give_way(icub, home):
    """Somebody's wrist rests near the palm's post: where a push begins with a step, velocities jump."""
    T = icub.chains["left"].T_root_link("hand", home.angles("left"))

    def roughness(settings):
        controller = Controller(icub, POST, home.angles("left"), settings=settings)
        loop, posture, velocities = AvoidanceLoop(controller), home, []
        for k in range(150):
            command, _ = loop.cycle(k * PERIOD_S, posture, wrist_at(POST - 0.12 * T[:3, 2], k * PERIOD_S))
            posture = posture.moved("left", posture.angles("left") + PERIOD_S * command.velocities_rad_s)
            velocities.append(command.velocities_rad_s)
        return np.std(np.diff(velocities[75:], axis=0))

    step = Settings(gain=3, onset=PUBLISHED.onset, neutral=PUBLISHED.neutral)  # keeps a like distance
    assert roughness(Settings()) < 0.2 * roughness(step)


def test_a_person_of_one_frame_moves_nothing(home, make_loop):
    loop, quiet = make_loop(), make_loop()
    for k in range(50):
        now_s = k * PERIOD_S
        seen = wrist_at(POST, now_s) if k == 10 else nobody(now_s)
        command, threat = loop.cycle(now_s, home, seen)
        expected, _ = quiet.cycle(now_s, home, nobody(now_s))
        assert command.status == FREE and not threat.obstacles
        np.testing.assert_array_equal(command.velocities_rad_s, expected.velocities_rad_s)


def test_threatened_taxels_are_those_near_the_keypoint(icub, home, make_loop):
    loop = make_loop()
    positions, normals = loop.skin.in_root(icub, home)
    row = loop.skin.slices["left_forearm"].start + 3
    place = positions[row] + 0.1 * normals[row]
    for now_s in (0.0, 0.03):
        _, threat = loop.cycle(now_s, home, wrist_at(place, now_s))
    assert "left_forearm" in [obstacle.part for obstacle in threat.obstacles]
    assert threat.activations[row] == pytest.approx(0.531, abs=0.01)  # of 6.5 cm, by the response table
    assert threat.activations[loop.skin.slices["right_hand"]].max() < 0.2


def test_threats_reported_without_avoidance_do_not_move_the_arm(home, make_loop):
    loop = make_loop(avoids=False)
    for now_s in (0.0, 0.03):
        command, threat = loop.cycle(now_s, home, wrist_at(POST + (-0.05, 0.1, 0), now_s))
    assert threat.obstacles and command.status == FREE


def test_without_perception_the_arm_stops_and_says_why(home, make_loop):
    loop = make_loop()
    command, _ = loop.cycle(0.0, home)
    assert command.status == STOPPED and "no perception" in command.reason
    assert loop.cycle(0.02, home, nobody(0.02))[0].status == FREE
    assert loop.cycle(1.0, home)[0].status == FREE
    command, _ = loop.cycle(1.1, home)
    assert command.status == STOPPED and (command.velocities_rad_s == 0).all()


def test_after_a_stop_the_arm_starts_from_rest(home, make_loop):
    away = home.moved("left", home.angles("left") + 0.2)
    loop = make_loop()
    first, _ = loop.cycle(0.0, away, nobody(0.0))
    second, _ = loop.cycle(0.02, away, nobody(0.02))
    assert np.linalg.norm(second.velocities_rad_s) > 1.05 * np.linalg.norm(first.velocities_rad_s)
    assert loop.cycle(1.1, away)[0].status == STOPPED
    again, _ = loop.cycle(1.12, away, nobody(1.12))
    np.testing.assert_array_equal(again.velocities_rad_s, first.velocities_rad_s)


def test_unknown_joint_angles_stop_the_arm(home, make_loop):
    lost = home.moved("left", np.full(10, np.nan))
    command, _ = make_loop().cycle(0.0, lost, nobody(0.0))
    assert command.status == STOPPED and command.reason == "joint angles are not finite"
    assert (command.velocities_rad_s == 0).all()


@pytest.mark.parametrize(
    ("points", "scores"), [((2, 136, 3), (1, 136)), ((1, 17, 3), (1, 17)), ((1, 136, 2), (1, 136))]
)
def test_perceptions_of_another_shape_are_refused(points, scores):
    with pytest.raises(ValueError, match="expected"):
        Perception(0.0, np.zeros(points), np.zeros(scores))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_stream_of_keypoints_breaks_a_bound(icub, home, seed):
    """`benchmarks/random_streams.py` runs 10,000 of them."""
    assert first_violation(np.random.default_rng(seed), icub, home, n_cycles=25) is None


def test_unreachable_posts_are_refused(icub):
    with pytest.raises(ValueError, match="choose a nearer position"):
        home_posture(icub, post_m=np.array([-3.0, 0, 0]))


def test_what_is_close_is_above_the_published_threshold():
    def threat(magnitude):
        return Threat(np.zeros(1), [Obstacle("left_hand", np.zeros(3), np.zeros(3), magnitude)])

    assert not Threat(np.zeros(1), []).is_close
    assert not threat(0.2).is_close and threat(0.2001).is_close


@pytest.mark.parametrize(("distance_m", "is_known"), [(0.25, True), (0.28, False)])
def test_obstacles_begin_where_joints_begin_to_slow_down(home, make_loop, distance_m, is_known):
    """Below the threshold of 0.2, but from a magnitude of 0.1 on."""
    loop = make_loop()
    palm = loop.controller.icub.chains["left"].T_root_link("hand", home.angles("left"))
    for now_s in (0.0, 0.03):
        _, threat = loop.cycle(now_s, home, wrist_at(POST - distance_m * palm[:3, 2], now_s))
    magnitudes = [obstacle.magnitude for obstacle in threat.obstacles if obstacle.part == "left_hand"]
    assert len(magnitudes) == is_known and all(0.1 < magnitude < 0.2 for magnitude in magnitudes)
