"""The paper's lifting against a loop written from its definition, and the cases it leaves open."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.core.camera import Camera, deproject, project
from hicp_lib.core.keypoints import BODY, FACE, HANDS, INDEX
from hicp_lib.lifting.paper import LIFTED, NO_DEPTH, NOT_DETECTED, OUTSIDE_IMAGE, REASONS, lift

CAMERA = Camera(160, 120, 300.0, 290.0, 81.3, 58.9)
WRIST = INDEX["left_wrist"]
FINGER = INDEX["left_index_4"]


def keypoints(**places_px) -> np.ndarray:
    """One person, (1, 136, 2), with these keypoints only."""
    points = np.full((1, 136, 2), np.nan)
    for name, place in places_px.items():
        points[0, INDEX[name]] = place
    return points


def radius_m(keypoint: int) -> float:
    return 0.020 if keypoint in BODY else 0.003


def by_definition(pixel_px: np.ndarray, keypoint: int, depth_m: np.ndarray) -> np.ndarray:
    """One keypoint, pixel by pixel."""
    column, row = np.floor(np.array(pixel_px) + 0.5)
    pixels = [(v, u) for v, u in np.ndindex(depth_m.shape) if depth_m[v, u] > 0]
    pixels.sort(key=lambda at: (at[0] - row) ** 2 + (at[1] - column) ** 2)
    for v, u in pixels:
        half = int(CAMERA.fx_px * radius_m(keypoint) / depth_m[v, u])
        if max(abs(v - row), abs(u - column)) <= half:
            break
    else:
        return np.full(3, np.nan)
    around = [(v, u) for v, u in pixels if max(abs(v - row), abs(u - column)) <= half]
    return np.median([deproject(CAMERA, [u, v], depth_m[v, u]) for v, u in around], axis=0)


def test_a_radius_given_is_that_of_every_keypoint_or_of_each():
    """A wrist and a finger on a limb 16 mm wide before a wall: a small neighbourhood stays on it."""
    depth_m = np.full((120, 160), 2.0)
    depth_m[:, 76:85] = 0.5  # 4 pixels to each side: 7 mm
    points = keypoints(left_wrist=(80, 60), left_index_4=(80, 60))
    own, small, large = (
        lift(points, depth_m, CAMERA, *radius).points_m[0, [WRIST, FINGER], 2]
        for radius in ((), (0.003,), (np.full(136, 0.020),))
    )
    assert own.tolist() == [2.0, 0.5] and small.tolist() == [0.5, 0.5] and large.tolist() == [2.0, 2.0]


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.2, 0.97]))
def test_every_point_as_the_definition_says(seed, hole_share):
    rng = np.random.default_rng(seed)
    depth_m = np.where(rng.random((48, 64)) < hole_share, 0, rng.uniform(0.4, 3, (48, 64)))
    points = np.full((2, 136, 2), np.nan)
    for keypoint in (0, WRIST, INDEX["left_heel"], FACE[3], FINGER):
        points[:, keypoint] = rng.uniform([-3, -3], [67, 51], (2, 2))
    lifted = lift(points, depth_m, replace(CAMERA, width_px=64, height_px=48))
    for person, keypoint in np.argwhere(lifted.reason == LIFTED):
        expected = by_definition(points[person, keypoint], keypoint, depth_m)
        np.testing.assert_allclose(lifted.points_m[person, keypoint], expected, atol=1e-12)
    for person, keypoint in np.argwhere(lifted.reason == NO_DEPTH):
        assert np.isnan(by_definition(points[person, keypoint], keypoint, depth_m)).all()
    assert (np.isnan(lifted.points_m).any(axis=2) == (lifted.reason != LIFTED)).all()


@settings(deadline=None, max_examples=30)
@given(st.integers(30, 129), st.integers(30, 89), st.floats(0.5, 4.0))
def test_projected_points_come_back(column, row, depth):
    point = deproject(CAMERA, [column, row], depth)
    points = np.broadcast_to(project(CAMERA, point), (1, 136, 2))
    lifted = lift(points, np.full((120, 160), depth), CAMERA)
    assert np.abs(lifted.points_m - point).max() <= 1e-9


def test_reasons():
    depth_m = np.full((120, 160), 1.0)
    depth_m[40:, :80] = np.nan
    nose, eye, ear, wrist = (80.0, 20.0), (-0.51, 20.0), (159.49, 119.49), (30.0, 90.0)
    lifted = lift(keypoints(nose=nose, left_eye=eye, left_ear=ear, left_wrist=wrist), depth_m, CAMERA)
    found = [lifted.reason[0, INDEX[k]] for k in ("nose", "left_eye", "left_ear", "left_wrist", "left_hip")]
    assert found == [LIFTED, OUTSIDE_IMAGE, LIFTED, NO_DEPTH, NOT_DETECTED]
    assert [REASONS[number] for number in found[3:]] == ["no_depth", "not_detected"]


@pytest.mark.parametrize("nothing", [0.0, np.nan, np.inf, -1.0])
def test_pixels_without_depth_do_not_count(nothing):
    depth_m = np.full((120, 160), nothing)
    depth_m[57:60, 79:84] = 1.0
    lifted = lift(keypoints(left_wrist=(80, 60), left_index_4=(80, 64)), depth_m, CAMERA)
    # The hole at the wrist takes its size from one pixel up; the finger's 3 mm reach no pixel.
    np.testing.assert_allclose(lifted.points_m[0, WRIST], deproject(CAMERA, [81, 58], 1.0))
    assert lifted.reason[0, FINGER] == NO_DEPTH


def test_at_the_border_what_lies_inside_counts():
    depth_m = np.full((120, 160), 1.0)
    lifted = lift(keypoints(left_wrist=(0, 0)), depth_m, CAMERA)
    np.testing.assert_allclose(lifted.points_m[0, WRIST], deproject(CAMERA, [3, 3], 1.0))


def test_at_a_depth_step_the_larger_side_wins():
    depth_m = np.full((120, 160), 2.0)
    depth_m[:, 80:] = 1.0
    on_edge = lift(keypoints(left_wrist=(80, 60), right_wrist=(79, 60)), depth_m, CAMERA).points_m[0]
    assert on_edge[WRIST, 2] == 1.0  # columns 74 to 86: seven of thirteen are near
    assert on_edge[INDEX["right_wrist"], 2] == 2.0
    beside = lift(keypoints(left_wrist=(77, 60)), depth_m, CAMERA).points_m[0]
    assert beside[WRIST, 2] == 2.0  # the paper's neighbourhood takes the background beside a limb


def test_whole_numbers_of_metres_and_nobody():
    lifted = lift(np.full((1, 136, 2), 60.0), np.full((120, 160), 2, np.uint16), CAMERA)
    assert (lifted.points_m[..., 2] == 2).all()
    nobody = lift(np.empty((0, 136, 2)), np.ones((120, 160)), CAMERA)
    assert nobody.points_m.shape == (0, 136, 3) and nobody.reason.shape == (0, 136)


def test_people_do_not_matter_to_each_other():
    rng = np.random.default_rng(1)
    depth_m = rng.uniform(0.5, 2, (120, 160)).astype(np.float32)
    points = rng.uniform([0, 0], [160, 120], (3, 136, 2))
    together = lift(points, depth_m, CAMERA).points_m
    for person in range(3):
        alone = lift(points[person : person + 1], depth_m, CAMERA).points_m[0]
        np.testing.assert_array_equal(together[person], alone)


@pytest.mark.parametrize("shape", [(136, 2), (1, 17, 2)])
def test_shapes_are_checked(shape):
    with pytest.raises(ValueError, match="keypoints have shape"):
        lift(np.zeros(shape), np.ones((120, 160)), CAMERA)
    with pytest.raises(ValueError, match="the depth image"):
        lift(np.zeros((1, 136, 2)), np.ones((160, 120)), CAMERA)


def test_hands_and_face_have_the_small_neighbourhood():
    depth_m = np.full((120, 160), 3.0)
    depth_m[:, 79:82] = 0.5  # a finger: 25 pixels wide is the body's neighbourhood, 3 the hand's
    z = lift(np.full((1, 136, 2), (80.0, 60.0)), depth_m, CAMERA).points_m[0, :, 2]
    assert (z[HANDS] == 0.5).all() and (z[FACE] == 0.5).all() and (z[BODY] == 3).all()
