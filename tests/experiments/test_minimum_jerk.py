"""Movements: minimum jerk from rest to rest, the same whenever they are asked for, within anatomy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hicp_lib.experiments.minimum_jerk import Motion, Move, Posture, between, minimum_jerk
from hicp_lib.experiments.recordings.gestures import TABLE_HEIGHT_M
from hicp_lib.experiments.recordings.moving_person import moving_person
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.body.joints import pose_from_joints, within_limits
from hicp_lib.simulation.body.model import load_body
from hicp_lib.simulation.body.self_collision import collision_model, self_collision_distance_m

A = Posture({"left_elbow_flexion": 0.2}, (0.0, 1.0))
B = Posture({"left_elbow_flexion": 1.2, "neck_turn": 0.1}, (0.5, 2.0))


def elbow(posture: Posture) -> float:
    return posture.joints["left_elbow_flexion"]


def test_minimum_jerk_starts_and_ends_at_rest():
    s = np.linspace(0, 1, 2001)
    way = np.array([minimum_jerk(value) for value in s])
    velocity = np.gradient(way, s)
    acceleration = np.gradient(velocity, s)
    assert way[0] == 0 and way[-1] == 1 and way[1000] == pytest.approx(0.5)
    assert velocity.max() == pytest.approx(1.875, abs=1e-3)  # Flash and Hogan: 15/8 of the mean
    assert abs(velocity[[0, -1]]).max() < 1e-5 and abs(acceleration[[0, -1]]).max() < 0.1


@given(st.floats(0, 1))
def test_every_joint_goes_straight_from_one_posture_to_the_next(share):
    middle = between(A, B, share)
    assert elbow(middle) == pytest.approx(0.2 + share)
    assert middle.joints["neck_turn"] == pytest.approx(0.1 * share)
    np.testing.assert_allclose(middle.place_m, [0.5 * share, 1 + share])


def test_a_motion_passes_through_its_postures_and_stays_in_pauses():
    motion = Motion(A, iter([Move(1.0, B), Move(0.5, B), Move(2.0, A), Move(1.0, A)]))
    assert motion.at(-3.0) == motion.at(0.0) == A
    assert elbow(motion.at(0.5)) == pytest.approx(0.7)
    assert elbow(motion.at(1.0)) == elbow(motion.at(1.3)) == pytest.approx(1.2)
    assert elbow(motion.at(2.5)) == pytest.approx(0.7) and elbow(motion.at(3.6)) == pytest.approx(0.2)


def test_a_pause_is_known_by_when_it_began():
    motion = Motion(A, iter([Move(1.0, A), Move(1.0, B), Move(0.5, B), Move(0.5, B), Move(2.0, A)]))
    for time_s, since_s in (
        (-3.0, 0.0),
        (0.9, 0.0),
        (1.5, 1.5),
        (2.0, 2.0),
        (2.4, 2.0),
        (2.9, 2.0),
        (3.5, 3.5),
    ):
        assert motion.still_since_s(time_s) == since_s
        assert motion.at(since_s) == motion.at(time_s)


def test_whoever_keeps_still_is_posed_once_and_whoever_moves_is_not(scene):
    still_s = next(t for t in np.arange(0, 9, 0.05) if scene.motion.at(t) == scene.motion.at(t + 0.1))
    assert scene.person_at(still_s) is scene.person_at(still_s + 0.1)
    moves_s = next(t for t in np.arange(0, 9, 0.05) if scene.motion.at(t) != scene.motion.at(t + 0.1))
    first, then = (scene.person_at(t).vertices_m for t in (moves_s, moves_s + 0.1))
    assert not np.array_equal(first, then)


@pytest.fixture(scope="module")
def subject():
    """Somebody who stands at a table."""
    people = (Subject(number=number) for number in range(20))
    return next(person for person in people if moving_person(person).table is not None)


@pytest.fixture(scope="module")
def scene(subject):
    return moving_person(subject)


def test_a_motion_is_the_same_in_whatever_order_it_is_asked_for(scene, subject):
    late = scene.motion.at(9.3)
    assert moving_person.__wrapped__(subject).motion.at(9.3) == late  # not the one that is kept
    other = moving_person(Subject(1)).motion.at(9.3)
    assert other.joints != late.joints


def test_the_person_stays_within_anatomy_and_does_not_jump(scene):
    body, person = load_body(), collision_model(load_body(), scene.appearance.shape)
    before = None
    for time_s in np.arange(0, 12, 0.1):
        posture = scene.motion.at(time_s)
        assert within_limits(posture.joints)
        assert self_collision_distance_m(body, person, pose_from_joints(posture.joints)) > -0.05
        wrists = scene.person_at(time_s).keypoints_m[[9, 10]]
        if before is not None:
            assert np.linalg.norm(wrists - before, axis=1).max() < 0.45  # metres in a tenth of a second
        before = wrists


def test_the_table_is_touched_and_not_run_through(scene):
    top = scene.table.mesh.vertices_m
    low, high = top.min(axis=0), top.max(axis=0)
    lowest = []
    for time_s in np.arange(0, 25, 0.2):  # a round of gestures
        hands = scene.person_at(time_s).keypoints_m[94:136]
        above = hands[((hands > low) & (hands < high))[:, :2].all(axis=1), 2]
        lowest.append(above.min(initial=np.inf))
    assert TABLE_HEIGHT_M - 0.005 < min(lowest) < TABLE_HEIGHT_M + 0.06
