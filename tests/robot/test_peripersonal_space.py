"""Responses against the published table, activations against a plain loop, obstacles against their sums."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.robot.peripersonal_space import (
    BIN_M,
    HISTOGRAM_START_M,
    NEGATIVES,
    POSITIVES,
    ReceptiveField,
    obstacles,
    response,
)
from hicp_lib.robot.skin import read_skin

TABLE = {
    0: 0.960, 0.025: 0.794, 0.05: 0.617, 0.075: 0.498, 0.10: 0.426, 0.125: 0.370, 0.15: 0.316, 0.175: 0.250,
    0.20: 0.179, 0.225: 0.121, 0.25: 0.077, 0.275: 0.042, 0.30: 0.018, 0.35: 0.001,
}  # fmt: skip


def test_response_table():
    # The table's three digits, and its maximum taken on a coarser grid.
    np.testing.assert_allclose(response(np.array(list(TABLE))), list(TABLE.values()), atol=1.3e-3)


@pytest.mark.parametrize(("activation", "distance_m"), [(0.2, 0.192), (0.4, 0.111), (0.5, 0.074)])
def test_where_activations_are_reached(activation, distance_m):
    assert response(distance_m) == pytest.approx(activation, abs=5e-3)


def test_highest_response_is_just_behind_the_skin():
    distance = np.arange(-0.1, 0.4, 1e-3)
    assert distance[response(distance).argmax()] == pytest.approx(-0.015, abs=2e-3)
    assert response(distance).max() == pytest.approx(1, abs=1e-3)


def plain_activations(field, positions, normals, points, factors):
    """The same in double precision, written out point by point."""
    result = np.zeros(len(positions))
    for i, (position, normal) in enumerate(zip(positions, normals, strict=True)):
        ways = [point - position for point in points]
        heights = [way @ normal for way in ways]
        beside = [np.linalg.norm(way - h * normal) for way, h in zip(ways, heights, strict=True)]
        inside = np.array(beside) <= field.skin_radius_m + np.tan(field.half_angle_rad) * np.abs(heights)
        distances = np.copysign([np.linalg.norm(way) for way in ways], heights) - field.point_radius_m
        result[i] = np.max(np.where(inside, factors * response(distances), 0))
    return result


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.1, 1.2), st.floats(0.01, 0.1), st.floats(0, 0.05))
def test_activations_against_a_plain_loop(seed, half_angle, skin_radius, point_radius):
    rng = np.random.default_rng(seed)
    positions, normals = rng.uniform(-0.1, 0.1, (8, 3)), rng.normal(size=(8, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points, factors = rng.uniform(-0.3, 0.3, (150, 3)), rng.choice([0, 0.3, 1, 2], 150)
    field = ReceptiveField(half_angle, skin_radius, point_radius)
    found = field.activations(positions, normals, points, factors)
    expected = plain_activations(field, positions, normals, points, factors)
    # Look-up in steps of 0.1 mm; a point on the very edge of a cone may fall on either side of it.
    assert np.mean(np.abs(found - expected) < 4e-3) >= 0.85


def test_in_front_of_one_taxel():
    field, up = ReceptiveField(), np.array([[0.0, 0, 1]])
    for distance, activation in TABLE.items():
        point = up * (distance + field.point_radius_m)
        found = field.activations(np.zeros((1, 3)), up, point, np.ones(1))
        np.testing.assert_allclose(found, activation, atol=2e-3)
    beside = np.array([[0.2, 0, 0.05]])
    assert field.activations(np.zeros((1, 3)), up, beside, np.ones(1)) == 0


def test_unknown_and_far_points_do_nothing():
    field, up = ReceptiveField(), np.array([[0.0, 0, 1]])
    points = np.array([[np.nan, 0, 0.1], [0, 0, np.inf], [0, 0, 5.0], [0, 0, 1e300]])
    assert field.activations(np.zeros((1, 3)), up, points, np.ones(4)) == 0
    assert field.activations(np.zeros((1, 3)), up, np.zeros((0, 3)), np.zeros(0)) == 0
    assert field.activations(np.zeros((1, 3)), up, [[0, 0, 0.1]], np.zeros(1)) == 0


def test_obstacles_are_weighted_by_activation():
    skin = read_skin()
    activations = np.full(len(skin), 0.19)
    rows = skin.slices["left_hand"]
    activations[rows] = [0.1, 0.8, 0.4, 0.2, 0.1]
    (obstacle,) = obstacles(skin, activations)
    positions = skin.positions_m[rows]
    np.testing.assert_allclose(obstacle.point_m, (2 * positions[1] + positions[2]) / 3, atol=1e-12)
    np.testing.assert_allclose(obstacle.normal, (0, 0, -1), atol=1e-12)
    assert (obstacle.part, obstacle.magnitude) == ("left_hand", 0.8)
    assert obstacles(skin, np.zeros(len(skin))) == []


def test_beyond_its_reach_nothing_is_activated():
    field, up = ReceptiveField(), np.array([[0.0, 0, 1]])
    assert response(field.reach_m - field.point_radius_m) == pytest.approx(1e-3, abs=1e-4)
    for distance, is_felt in ((field.reach_m - 1e-3, True), (field.reach_m + 1e-3, False)):
        assert (field.activations(np.zeros((1, 3)), up, distance * up, np.ones(1)) > 0).all() == is_felt


def test_by_default_the_cone_is_the_published_one():
    """50 degrees and 7 cm: at a height of 10 cm it is 18.9 cm wide."""
    field, up = ReceptiveField(), np.array([[0.0, 0, 1]])
    for radius, is_felt in ((0.188, True), (0.190, False)):
        for height in (0.1, -0.1):
            point = np.array([[radius, 0, height]])
            found = field.activations(np.zeros((1, 3)), up, point, np.ones(1))
            assert (found > 0).all() == (is_felt and height > 0) or height < 0


def test_only_taxels_above_the_threshold_make_an_obstacle():
    skin = read_skin()
    activations = np.zeros(len(skin))
    activations[skin.slices["torso"]] = 0.2
    assert obstacles(skin, activations) == []
    activations[skin.slices["torso"].start] = 0.2001
    (obstacle,) = obstacles(skin, activations)
    np.testing.assert_allclose(obstacle.point_m, skin.positions_m[skin.slices["torso"].start])
    assert [one.part for one in obstacles(skin, activations, threshold=0.1)] == ["torso"]


def test_the_histogram_is_the_published_one_of_reach_45_cm():
    """robotology/peripersonal-space: 20 bins of 2.5 cm from -5 to 45 cm, with 100 negatives each."""
    edges_m = -0.05 + 0.025 * np.arange(20)
    touches = {
        -0.05: 480, -0.025: 555, 0.0: 480, 0.025: 160, 0.05: 80, 0.075: 60, 0.1: 50, 0.125: 40, 0.15: 35,
        0.175: 25, 0.2: 15, 0.225: 10, 0.25: 6, 0.275: 3, 0.3: 1,
    }  # fmt: skip
    expected = [touches.get(edge_m, 0) for edge_m in edges_m.round(3).tolist()]
    assert expected == POSITIVES.tolist() and NEGATIVES.tolist() == [100] * 20
    assert (BIN_M, HISTOGRAM_START_M) == (0.025, -0.05)


def test_every_keypoint_is_a_ball_of_three_and_a_half_centimetres():
    up = np.array([[0.0, 0, 1]])
    found = ReceptiveField().activations(np.zeros((1, 3)), up, up * 0.135, np.ones(1))
    np.testing.assert_allclose(found, response(0.1), atol=1e-3)


def test_responses_are_looked_up_in_tenths_of_a_millimetre():
    field, up = ReceptiveField(), np.array([[0.0, 0, 1]])
    heights_m = field.point_radius_m + np.linspace(0.10, 0.11, 1001)
    found = [field.activations(np.zeros((1, 3)), up, up * height, np.ones(1))[0] for height in heights_m]
    assert 99 <= len(np.unique(found)) <= 102
    np.testing.assert_allclose(found, response(heights_m - field.point_radius_m), atol=2e-4)


def test_the_reach_ends_where_a_thousandth_is_left():
    reach_m = ReceptiveField().reach_m - 0.035
    assert response(reach_m + 1e-4) <= 1e-3 < response(reach_m - 1e-6)
