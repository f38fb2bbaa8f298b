"""What the tracker believes, step by step."""

from __future__ import annotations

import numpy as np
import pytest

from hicp_lib.core.keypoints import INDEX
from hicp_lib.robot.tracking import KeypointTracker, Trust

WRIST, ELBOW = INDEX["left_wrist"], INDEX["left_elbow"]


def person(wrist=(-0.5, 0, 0), elbow=None, score=0.9):
    points, scores = np.full((1, 136, 3), np.nan), np.zeros((1, 136))
    for keypoint, place in ((WRIST, wrist), (ELBOW, elbow)):
        if place is not None:
            points[0, keypoint], scores[0, keypoint] = place, score
    return points, scores


NOBODY = np.zeros((0, 136, 3)), np.zeros((0, 136))


def see(tracker, frames, step_s=0.03):
    """Show frames one after another; returns the time of the last."""
    start = max(tracker.latest_s + step_s, 0)
    times = start + step_s * np.arange(len(frames))
    for time_s, frame in zip(times, frames, strict=True):
        assert tracker.see(time_s, *frame, now_s=time_s)
    return times[-1]


def weight(tracker, now_s, keypoint=WRIST):
    return tracker.points(now_s)[1][:, keypoint].max(initial=0)


def test_seen_once_is_not_believed_seen_twice_is():
    tracker = KeypointTracker()
    assert weight(tracker, see(tracker, [person()])) == 0
    assert weight(tracker, see(tracker, [person()])) == 1


def test_a_person_of_one_frame_is_never_believed():
    tracker = KeypointTracker()
    see(tracker, [NOBODY, person(), NOBODY, NOBODY])
    assert all(weight(tracker, now_s) == 0 for now_s in np.arange(0.1, 1, 0.02))


@pytest.mark.parametrize(("frames_between", "believed"), [(0, True), (1, True), (2, False), (5, False)])
def test_a_second_sighting_must_come_within_two_frames(frames_between, believed):
    tracker = KeypointTracker()
    now_s = see(tracker, [person(), *frames_between * [NOBODY], person()])
    assert weight(tracker, now_s) == believed


def test_a_jump_of_one_frame_is_not_followed():
    tracker = KeypointTracker()
    now_s = see(tracker, [person(), person(), person((0.5, 0, 0)), person()])
    points, weights = tracker.points(now_s)
    np.testing.assert_allclose(points[0, WRIST], (-0.5, 0, 0))
    assert weights[0, WRIST] == 1


def test_a_jump_that_stays_is_followed_from_the_second_frame_on():
    tracker = KeypointTracker()
    now_s = see(tracker, [person(), person(), *2 * [person((0.5, 0, 0), elbow=(0.5, 0.2, 0))]])
    points, weights = tracker.points(now_s)
    believed = points[(weights > 0.99)[:, WRIST], WRIST]
    assert (0.5, 0, 0) in [tuple(point) for point in believed]


def test_lost_keypoints_are_held_then_fade():
    trust = Trust(hold_s=0.2, fade_s=0.19)
    tracker = KeypointTracker(trust)
    now_s = see(tracker, [person(), person()])
    assert weight(tracker, now_s + 0.19) == 1
    # 0.9 per period of 20 ms
    fades = [weight(tracker, now_s + 0.2 + k * 0.02) for k in range(20)]
    np.testing.assert_allclose(np.array(fades[1:]) / fades[:-1], 0.9, atol=1e-3)


def test_people_not_seen_are_forgotten_after_a_while():
    tracker = KeypointTracker()
    see(tracker, [person(), person()])
    see(tracker, 30 * [NOBODY])
    assert len(tracker.points(2.0)[0]) == 0
    assert weight(tracker, see(tracker, [person()])) == 0  # new again


@pytest.mark.parametrize(("score", "expected"), [(0.05, 0), (0.1, 0), (0.2, 0.5), (0.3, 1), (0.9, 1)])
def test_low_scores_weigh_less(score, expected):
    tracker = KeypointTracker()
    now_s = see(tracker, 2 * [person(score=score)])
    assert weight(tracker, now_s) == pytest.approx(expected, abs=1e-12)


def test_people_keep_their_rows_apart_whatever_their_order():
    tracker = KeypointTracker()
    one, other = person((-0.5, 0.3, 0)), person((-0.5, -0.3, 0))

    def both(a, b):
        return tuple(np.concatenate(pair) for pair in zip(a, b, strict=True))

    now_s = see(tracker, [both(one, other), both(other, one), both(one, other)])
    points, weights = tracker.points(now_s)
    assert len(points) == 2 and (weights[:, WRIST] == 1).all()
    assert sorted(points[:, WRIST, 1]) == [-0.3, 0.3]


def test_of_a_crowd_the_nearest_are_followed():
    tracker = KeypointTracker(Trust(max_people=2))
    crowd = [person((-distance, 0, 0)) for distance in (3, 1, 2, 4)]
    frame = tuple(np.concatenate(arrays) for arrays in zip(*crowd, strict=True))
    points, _ = tracker.points(see(tracker, [frame, frame]))
    assert sorted(points[:, WRIST, 0]) == [-2, -1]


@pytest.mark.parametrize("time_s", [np.nan, np.inf, -np.inf, 0.03, 0.01, 5.0])
def test_old_and_future_frames_are_left_out(time_s):
    tracker = KeypointTracker()
    now_s = see(tracker, [person(), person()])
    assert not tracker.see(time_s, *person((0.5, 0, 0)), now_s=now_s)
    assert tracker.latest_s == now_s and weight(tracker, now_s) == 1


@pytest.mark.parametrize("place", [(np.nan, 0, 0), (np.inf, 0, 0), (1e200, 0, 0), (0, -30, 0)])
def test_impossible_places_are_no_sightings(place):
    tracker = KeypointTracker()
    now_s = see(tracker, 3 * [person(place)])
    assert len(tracker.points(now_s)[0]) == 0


@pytest.mark.parametrize(("distance_m", "is_seen"), [(19.99, True), (20.0, False), (20.01, False)])
def test_what_is_twenty_metres_away_is_no_sighting(distance_m, is_seen):
    tracker = KeypointTracker()
    see(tracker, 2 * [person((0, 0, distance_m))])
    assert (len(tracker.points(0.03)[0]) == 1) == is_seen


@pytest.mark.parametrize(("step_m", "same"), [(0.23, True), (0.25, False)])
def test_a_keypoint_moves_a_little_and_as_fast_as_people_do(step_m, same):
    """0.15 m and 3 m/s: 0.24 m in 30 ms."""
    tracker = KeypointTracker()
    now_s = see(tracker, [person((0, 0, 0)), person((step_m, 0, 0))])
    assert weight(tracker, now_s) == same


@pytest.mark.parametrize(("pause_s", "remembered"), [(0.58, True), (0.62, False)])
def test_what_was_believed_is_remembered_for_its_time(pause_s, remembered):
    tracker = KeypointTracker()
    now_s = see(tracker, 2 * [person()])
    tracker.see(now_s + pause_s, *person(), now_s=now_s + pause_s)
    assert weight(tracker, now_s + pause_s) == remembered


def test_by_default_eight_people_are_followed():
    tracker = KeypointTracker()
    crowd = [person((0, 0, 1.0 + distance)) for distance in range(10)]
    frame = tuple(np.concatenate(arrays) for arrays in zip(*crowd, strict=True))
    points, _ = tracker.points(see(tracker, [frame, frame]))
    assert sorted(points[:, WRIST, 2]) == list(range(1, 9))


def test_scores_that_are_no_numbers_count_for_nothing():
    tracker = KeypointTracker()
    for score in (np.nan, np.inf, -np.inf):
        now_s = see(tracker, 2 * [person(score=score)])
        assert weight(tracker, now_s) == 0


def test_by_default_sightings_hold_two_tenths_of_a_second_and_fade_in_as_much():
    """To 1/e in 0.19 s: a tenth less in every period of 20 ms."""
    tracker = KeypointTracker()
    now_s = see(tracker, [person(), person()])
    assert weight(tracker, now_s + 0.199) == 1 > weight(tracker, now_s + 0.201)
    assert weight(tracker, now_s + 0.39) == pytest.approx(np.exp(-1))


def test_before_the_first_frame_there_is_nobody():
    assert KeypointTracker().points(0.0)[0].shape == (0, 136, 3)


def test_twice_as_many_people_are_remembered_as_are_followed():
    tracker = KeypointTracker(Trust(max_people=1))
    see(tracker, [person((0, 0, 1.0 + distance)) for distance in range(5)])
    assert sorted(tracker._memory["seen_m"][:, WRIST, 2]) == [3, 4, 5]  # two, and the newest
