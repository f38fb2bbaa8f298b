"""Markers on the body and what cameras around it see of them."""

import numpy as np
import pytest

from hicp_lib.core.keypoints import INDEX
from hicp_lib.core.rotations import rotation
from hicp_lib.simulation.body.model import load_body, pose_body
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.raycast import RayScene
from hicp_lib.simulation.rendering.surfaces import Surface
from hicp_lib.simulation.sensors.markers import (
    CAMERA_MARKER,
    CAMERA_MARKER_M,
    JOINT_MARKERS,
    STANDOFF_M,
    body_scene,
    camera_marker_m,
    marker_vertices,
    markers_m,
)
from hicp_lib.simulation.sensors.motion_capture import (
    QUALISYS,
    MocapSystem,
    count_seeing,
    measure,
    mocap_frame,
    room_cameras_m,
    track_markers,
)

BODY = load_body()
SHAPE = "man_38_07"
EXACT = MocapSystem(noise_m=0, shortest_s=0)
JOINTS = [INDEX[f"{side}_{joint}"] for joint in ("shoulder", "elbow", "wrist") for side in ("left", "right")]


def _markers(shape, pose=None):
    person = pose_body(BODY, shape, pose or {})
    return person, markers_m(person, marker_vertices(shape))


def test_there_are_two_markers_for_each_of_six_joints():
    assert JOINT_MARKERS[:2] == ("shoulder_left_1", "shoulder_left_2") and len(set(JOINT_MARKERS)) == 12
    assert JOINT_MARKERS[-1] == "wrist_right_2" and CAMERA_MARKER == "camera"


@pytest.mark.parametrize("shape", BODY.shape_names)
def test_elbow_and_wrist_are_between_their_two_markers(shape):
    person, markers = _markers(shape)
    first, second = markers[4::2], markers[5::2]
    joints = person.keypoints_m[JOINTS[2:]]
    assert np.linalg.norm((first + second) / 2 - joints, axis=1).max() < 0.02
    towards = [(first - joints), (second - joints)]
    cosine = np.sum(towards[0] * towards[1], axis=1) / np.prod(np.linalg.norm(towards, axis=2), axis=0)
    assert cosine.max() < -0.9  # on opposite sides
    apart_m = np.linalg.norm(first - second, axis=1)
    assert apart_m.min() > 0.05 and apart_m.max() < 0.2


@pytest.mark.parametrize("shape", BODY.shape_names)
def test_both_markers_of_a_shoulder_are_on_its_outer_side(shape):
    person, markers = _markers(shape)
    from_joint = (markers[:4].reshape(2, 2, 3) - person.keypoints_m[JOINTS[:2], None]) * [
        [[1, 1, 1]],
        [[1, -1, 1]],
    ]  # the right one mirrored; axis 1: towards the front, towards the back
    assert (from_joint[:, :, 1] > 0.025).all() and (np.abs(from_joint[:, :, 2]) < 0.02).all()
    assert (from_joint[:, 0, 0] > 0.015).all() and (from_joint[:, 1, 0] < -0.015).all()
    mean_m = np.linalg.norm(from_joint.mean(axis=1), axis=1)  # as the page on simulated sensors says
    assert ((mean_m > 0.035) & (mean_m < 0.065)).all()


def test_markers_lie_off_the_skin_and_follow_the_limb():
    bent = {"lowerarm01.L": np.array([0, -1.5, 0]), "upperarm01.R": np.array([0.6, -0.4, 0.2])}
    straight, at_rest = _markers(SHAPE)
    person, moved = _markers(SHAPE, bent)
    for body, markers in ((straight, at_rest), (person, moved)):
        gaps_m = np.linalg.norm(body.vertices_m[:, None] - markers[None], axis=2).min(axis=0)
        assert np.abs(gaps_m - STANDOFF_M).max() < 0.005
    wrist = [JOINT_MARKERS.index("wrist_left_1"), JOINT_MARKERS.index("wrist_left_2")]
    assert np.linalg.norm(moved[wrist].mean(axis=0) - person.keypoints_m[INDEX["left_wrist"]]) < 0.02
    assert moved[wrist].mean(axis=0)[0] > at_rest[wrist].mean(axis=0)[0] + 0.15  # brought forward


def test_the_marker_on_the_camera_moves_with_it():
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation([0.3, -0.8, 0.1]), [1, 2, 3]
    marker = camera_marker_m(np.stack([np.eye(4), T]))
    assert np.allclose(marker[0], CAMERA_MARKER_M) and 0.01 < np.linalg.norm(marker[0]) < 0.05
    assert np.allclose(T[:3, :3].T @ (marker[1] - T[:3, 3]), CAMERA_MARKER_M)


def test_a_wall_hides_a_marker_from_the_cameras_behind_it():
    person = pose_body(BODY, SHAPE, {}, np.diag([1.0, 1, 1, 1]))
    cameras = np.array([[3.0, 0, 1], [3, 1, 1], [-3, 0, 1]])
    marker = np.array([[1.0, 0, 1]])
    assert count_seeing(body_scene(person), marker, cameras).tolist() == [2]  # the person is before the third
    wall = g.box([1.4, -3, 0], [1.5, 3, 3])
    assert count_seeing(body_scene(person, (wall,)), marker, cameras).tolist() == [0]


def test_cameras_around_a_standing_person_see_every_marker_and_from_one_side_only_its_own():
    person, markers = _markers(SHAPE)
    around = count_seeing(body_scene(person), markers, room_cameras_m(QUALISYS, person.heads_m[0]))
    assert around.min() >= 2 and around.max() <= QUALISYS.n_cameras
    left = count_seeing(body_scene(person), markers, np.array([[0.3, 4.0, 1.5], [-0.3, 4.0, 1.5]]))
    seen = {name for name, n in zip(JOINT_MARKERS, left, strict=True) if n == 2}
    assert {"shoulder_left_1", "shoulder_left_2"} <= seen
    assert not {"shoulder_right_1", "shoulder_right_2"} & seen


def test_a_thinned_skin_hides_markers_as_all_of_it_does():
    arms = {"upperarm01.L": np.array([0.9, -0.6, 0.3]), "lowerarm01.L": np.array([0, -1.8, 0])}
    for pose in ({}, arms):
        person, markers = _markers(SHAPE, pose)
        cameras = room_cameras_m(QUALISYS, person.heads_m[0])
        no_coords = np.zeros((len(person.vertices_m), 0))
        whole = g.Mesh(person.vertices_m, BODY.triangles, person.normals, no_coords)
        truth = count_seeing(RayScene([Surface(whole, None)]), markers, cameras)
        found = count_seeing(body_scene(person), markers, cameras)
        assert np.abs(found - truth).max() <= 1 and (found != truth).mean() < 0.1


def test_measured_markers_are_the_true_ones_in_the_systems_frame_with_noise():
    rng = np.random.default_rng(1)
    n = 4000
    points = rng.uniform(-1, 1, (n, 2, 3))
    T = mocap_frame(rng)
    seeing = np.full((n, 2), 3)
    seeing[100:200, 1] = 1
    times_s = np.arange(n) / 100
    found = measure(times_s, ("a", "b"), points, seeing, T, QUALISYS, rng)
    expected = points @ T[:3, :3].T + T[:3, 3]
    error = (found.points_m - expected)[seeing >= 2]
    assert error.std() == pytest.approx(3e-4, rel=0.03) and abs(error.mean()) < 3e-5
    assert np.isnan(found.points_m[100:200, 1]).all() and np.isnan(found.points_m).sum() == 300
    assert found.names == ("a", "b") and found.rate_hz == 100 and np.array_equal(found.times_s, times_s)
    exact = measure(times_s, ("a", "b"), points, np.full((n, 2), 2), T, EXACT, rng)
    assert np.allclose(exact.points_m, expected, atol=1e-12)


def test_short_trajectories_between_dropouts_are_lost():
    seeing = np.zeros((40, 1), int)
    seeing[[3, 4, 5, 6]], seeing[10:15], seeing[38:] = 2, 2, 2
    arguments = (np.arange(40) / 100, ("a",), np.ones((40, 1, 3)), seeing, np.eye(4))
    found = measure(*arguments, QUALISYS, np.random.default_rng(0))
    assert np.flatnonzero(np.isfinite(found.points_m[:, 0, 0])).tolist() == [10, 11, 12, 13, 14]
    kept = measure(*arguments, EXACT, np.random.default_rng(0))
    assert np.isfinite(kept.points_m[:, 0, 0]).sum() == 11


def test_the_mocap_frame_is_upright_and_turned_about_the_vertical():
    frames = [mocap_frame(np.random.default_rng(seed)) for seed in range(20)]
    for T in frames:
        assert np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3)) and np.linalg.det(T[:3, :3]) > 0
        assert T[2, 2] > np.cos(np.radians(1.5)) and abs(T[2, 3]) < 0.02
    assert np.std([np.arctan2(T[1, 0], T[0, 0]) for T in frames]) > 1


def test_following_a_swinging_arm_is_exact_to_a_tenth_of_a_millimetre():
    def person_at(time_s):
        angle = -0.8 - 0.6 * np.sin(2 * np.pi * 0.8 * time_s)
        return pose_body(BODY, SHAPE, {"lowerarm01.L": np.array([0, angle, 0])})

    vertices = marker_vertices(SHAPE)
    times_s = np.arange(50) / 100
    fixed = np.array([[0.5, 0.0, 1.5]])
    cameras = room_cameras_m(QUALISYS, np.zeros(2))
    followed, seeing = track_markers(person_at, vertices, fixed, times_s, cameras)
    assert followed.shape == (50, 13, 3) and seeing.shape == (50, 13)
    for k in (13, 26, 49):
        assert np.abs(followed[k, :12] - markers_m(person_at(times_s[k]), vertices)).max() < 1e-4
    assert np.allclose(followed[:, 12], fixed) and seeing.min() >= 0 and seeing[:, 12].min() >= 4
