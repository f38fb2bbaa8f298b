"""Registration from clicked markers: discs before a wall, seen by a moving camera."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from hicp_lib.core.camera import Camera, project, transform
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import write_json
from hicp_lib.mocap.eight_clicks import (
    camera_places,
    register_by_camera_marker,
    register_selected,
    select_markers,
)
from hicp_lib.mocap.registration import (
    REGISTRATION_FILE,
    SEEN,
    lift_clicks,
    measured_markers,
    read_registration,
    register_robustly,
)
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import open_recording
from hicp_lib.recordings.writer import RecordingWriter
from hicp_lib.simulation.sensors.clicks import simulate_clicks

INTRINSICS = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
NAMES = (*(f"m{k}" for k in range(9)), "camera")
MARKERS_CAM = np.array(
    [[-0.4, -0.3, 1.2], [0.1, -0.28, 1.0], [0.5, -0.25, 1.4], [-0.3, 0.05, 0.9], [0.15, 0.1, 1.5],
     [0.45, 0.02, 1.1], [-0.25, 0.3, 1.3], [0.1, 0.28, 1.0], [0.4, 0.3, 1.2]]
)  # fmt: skip
CAMERA_MARKER_CAM = np.array([0.02, -0.03, -0.01])
T_BASE_MOCAP = np.eye(4)
T_BASE_MOCAP[:3, :3] = Rotation.from_euler("xyz", [0.3, -0.2, 2.0]).as_matrix()
T_BASE_MOCAP[:3, 3] = [-1.5, 0.4, 0.2]


def camera_pose(k: int) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", [0.02 * k, 0.03 * k, -0.1]).as_matrix()
    T[:3, 3] = [0.01 * k, 0.02, 0.3]
    return T


def depth_of(points_cam: np.ndarray) -> np.ndarray:
    """A wall at 3 m, and before it a disc of 4 cm about every point."""
    v, u = np.mgrid[: INTRINSICS.height_px, : INTRINSICS.width_px]
    depth = np.full(u.shape, 3.0)
    for centre, point in zip(project(INTRINSICS, points_cam), points_cam, strict=True):
        disc = np.hypot(u - centre[0], v - centre[1]) <= INTRINSICS.fx_px * 0.04 / point[2]
        depth[disc] = np.minimum(depth[disc], point[2])
    return depth


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    """A recording of four frames with its motion capture."""
    writer = RecordingWriter(tmp_path_factory.mktemp("rooms") / "room", INTRINSICS, 10_000.0)
    markers = transform(camera_pose(0), MARKERS_CAM)
    times_s = np.arange(0, 1, 0.01)
    T_mocap_base = np.linalg.inv(T_BASE_MOCAP)
    in_mocap = np.full((len(times_s), 10, 3), np.nan)
    in_mocap[:, :9] = transform(T_mocap_base, markers)
    for k in range(4):
        depth = depth_of(transform(np.linalg.inv(camera_pose(k)), markers))
        writer.add(0.2 * k, np.zeros((240, 320, 3), np.uint8), depth, camera_pose(k))
        in_mocap[20 * k : 20 * k + 20, 9] = transform(T_mocap_base @ camera_pose(k), CAMERA_MARKER_CAM)
    writer.finish()
    recording = open_recording(writer.folder)
    return recording, MotionCapture(times_s, NAMES, in_mocap, 100.0)


@pytest.fixture
def clicks(laboratory) -> pd.DataFrame:
    recording, mocap = laboratory
    rows = []
    for k in range(4):
        points = transform(np.linalg.inv(recording.T_base_cam[k]) @ T_BASE_MOCAP, mocap.points_m[0, :9])
        pixels = project(INTRINSICS, points)
        rows += [(k, name, *pixel) for name, pixel in zip(NAMES, pixels.tolist(), strict=False)]
    return pd.DataFrame(rows, columns=["frame", "marker", "u_px", "v_px"])


def errors_of(registration) -> tuple[float, float]:
    """Angle [rad] from the exact rotation, and largest displacement [m] of the markers."""
    T = registration.T_base_mocap
    angle = Rotation.from_matrix(T[:3, :3].T @ T_BASE_MOCAP[:3, :3]).magnitude()
    points = transform(np.linalg.inv(T_BASE_MOCAP) @ camera_pose(0), MARKERS_CAM)
    moved = transform(T, points) - transform(T_BASE_MOCAP, points)
    return angle, np.linalg.norm(moved, axis=1).max()


def test_clicks_are_lifted_to_where_the_markers_are(laboratory, clicks):
    matched = lift_clicks(laboratory[0], clicks, laboratory[1])
    seen, measured = matched[["x_m", "y_m", "z_m"]], matched[["mocap_x_m", "mocap_y_m", "mocap_z_m"]]
    assert len(matched) == len(clicks)
    # A pixel at 1.5 m is 5 mm.
    assert np.abs(seen.to_numpy() - transform(T_BASE_MOCAP, measured.to_numpy())).max() < 0.004


def test_arun_alone_finds_what_the_markers_say(laboratory, clicks):
    matched = select_markers(lift_clicks(laboratory[0], clicks, laboratory[1]))
    assert len(matched) == 8 and matched["frame"].nunique() <= 2
    registration = register_selected(matched)
    angle, displacement = errors_of(registration)
    assert angle < 0.005 and displacement < 0.005
    assert registration.n_points == 8 and registration.rms_m < 0.004
    assert registration.rms_m < registration.leave_one_out_m * 2


def test_the_papers_translation_is_off_by_where_the_camera_marker_sits(laboratory, clicks):
    recording, mocap = laboratory
    matched = select_markers(lift_clicks(recording, clicks, mocap))
    registration = register_by_camera_marker(matched, *camera_places(recording, mocap))
    assert np.allclose(registration.T_base_mocap[:3, :3], register_selected(matched).T_base_mocap[:3, :3])
    _, displacement = errors_of(registration)
    assert displacement == pytest.approx(np.linalg.norm(CAMERA_MARKER_CAM), abs=0.01)


def test_turned_about_the_camera_errors_along_the_line_of_sight_turn_nothing(laboratory, clicks):
    """Markers that are lifted too near by up to 5 cm, each along its own line of sight."""
    recording, mocap = laboratory
    matched = select_markers(lift_clicks(recording, clicks, mocap))
    marker_m, centre_m = camera_places(recording, mocap)
    centred_m = transform(np.linalg.inv(T_BASE_MOCAP), centre_m)
    sight_m = matched[SEEN].to_numpy() - centre_m[matched["frame"]]
    nearer = np.linspace(0, 0.05, len(matched))[:, None] / np.linalg.norm(sight_m, axis=1, keepdims=True)
    wrong = matched.assign(**dict(zip(SEEN, (matched[SEEN].to_numpy() - nearer * sight_m).T, strict=True)))
    (turned, moved), (turned_less, moved_less) = (
        errors_of(register_by_camera_marker(wrong, centred_m, centre_m, about)) for about in (False, True)
    )
    assert turned > 0.01 and turned_less < 0.005 and moved > 2 * moved_less
    _, moved = errors_of(register_by_camera_marker(matched, marker_m, centre_m, about_camera=True))
    assert moved < np.linalg.norm(CAMERA_MARKER_CAM)


def test_wrong_clicks_do_not_spoil_the_fit_to_many(laboratory, clicks):
    wrong = clicks.copy()
    wrong.loc[::7, "u_px"] += 25
    matched = lift_clicks(laboratory[0], wrong, laboratory[1])
    robust = register_robustly(matched)
    assert errors_of(robust)[1] < 0.004 < 0.02 < errors_of(register_selected(matched))[1]
    assert robust.n_points == len(clicks) - len(wrong[::7])


def test_clicks_on_the_wall_behind_are_not_among_the_eight(laboratory, clicks):
    matched = lift_clicks(laboratory[0], clicks, laboratory[1])
    matched.loc[::4, ["x_m", "y_m", "z_m"]] += [-0.4, 0.9, 1.2]
    eight = select_markers(matched)
    assert len(eight) == 8 and register_selected(eight).rms_m < 0.005


def test_many_clicks_on_the_wall_behind_do_not_spoil_the_fit(laboratory, clicks):
    matched = lift_clicks(laboratory[0], clicks, laboratory[1])
    rng = np.random.default_rng(0)
    behind = rng.random(len(matched)) < 0.4
    matched.loc[behind, ["x_m", "y_m", "z_m"]] += rng.normal(0, 1.0, (behind.sum(), 3)) + [0.5, 0.5, 1.5]
    found = register_robustly(matched)
    assert errors_of(found)[1] < 0.005 and found.n_points == (~behind).sum()


def test_what_cannot_be_matched_is_left_out(laboratory, clicks):
    recording, mocap = laboratory
    points = mocap.points_m.copy()
    points[:, 2] = np.nan
    clicks.loc[clicks["marker"] == "m5", "u_px"] = 400
    matched = lift_clicks(recording, clicks, replace(mocap, points_m=points))
    assert set(NAMES[:9]) - set(matched["marker"]) == {"m2", "m5"}


def test_a_missing_camera_marker_is_refused(laboratory):
    recording, mocap = laboratory
    without = replace(mocap, names=NAMES[:9], points_m=mocap.points_m[:, :9])
    with pytest.raises(InputError, match="no marker 'camera'"):
        camera_places(recording, without)
    mocap = replace(mocap, points_m=np.full_like(mocap.points_m, np.nan))
    with pytest.raises(InputError, match="measured in no frame"):
        camera_places(recording, mocap)


def test_a_given_transform_is_read(tmp_path):
    write_json(tmp_path / REGISTRATION_FILE, {"T_base_mocap": T_BASE_MOCAP.round(5).tolist()})
    read = read_registration(tmp_path / REGISTRATION_FILE)
    assert np.array_equal(read.T_base_mocap, T_BASE_MOCAP.round(5))
    assert (
        read.method == "given" and read.n_points == 0 and np.isnan([read.rms_m, read.leave_one_out_m]).all()
    )


@pytest.mark.parametrize(
    "content",
    ["[]", "{}", '{"T_base_mocap": [[1, 0], [0, 1]]}', '{"T_base_mocap": "eye"}',
     '{"T_base_mocap": [[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]}',
     '{"T_base_mocap": [[1,0,0,0],[0,1,0,0],[0,0,-1,0],[0,0,0,1]]}',
     '{"T_base_mocap": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0.1,0,0,1]]}'],
)  # fmt: skip
def test_what_is_no_rigid_transform_is_refused_in_one_line(tmp_path, content):
    (tmp_path / REGISTRATION_FILE).write_text(content)
    with pytest.raises(InputError, match="T_base_mocap") as error:
        read_registration(tmp_path / REGISTRATION_FILE)
    assert "\n" not in str(error.value)


def test_simulated_clicks_are_on_what_can_be_seen(laboratory):
    recording, mocap = laboratory
    exact = recording.folder / "exact_depth"
    exact.symlink_to(recording.folder / "depth")
    clicks = simulate_clicks(recording, mocap, T_BASE_MOCAP, n_images=3, noise_px=0.5)
    assert clicks["frame"].unique().tolist() == [0, 2, 3]
    assert set(clicks["marker"]) == set(NAMES[:9])
    again = simulate_clicks(recording, mocap, T_BASE_MOCAP, n_images=3, noise_px=0.0)
    offsets = clicks[["u_px", "v_px"]].to_numpy() - again[["u_px", "v_px"]].to_numpy()
    assert 0.3 < offsets.std() < 0.7
    behind = mocap.points_m.copy()
    T_mocap_cam = np.linalg.inv(T_BASE_MOCAP) @ camera_pose(0)
    behind[:, 3] = transform(T_mocap_cam, MARKERS_CAM[3] * 1.2)
    hidden = simulate_clicks(recording, replace(mocap, points_m=behind), T_BASE_MOCAP, 1, 0.0)
    assert set(NAMES[:9]) - set(hidden["marker"]) == {"m3"}


def test_the_offset_is_taken_from_the_cameras_clock(laboratory, clicks):
    """Stamps of the motion capture that are 0.37 s behind, and markers that move meanwhile."""
    recording, mocap = laboratory
    drift_m = mocap.times_s[:, None, None] * [0.1, 0.0, 0.0]
    moving = replace(mocap, points_m=mocap.points_m + drift_m)
    behind = replace(moving, times_s=mocap.times_s - 0.37)
    expected_m = measured_markers(recording, clicks, moving, 0.0)
    np.testing.assert_allclose(measured_markers(recording, clicks, behind, 0.37), expected_m, atol=1e-12)
    assert np.ptp(expected_m[clicks["marker"] == "m0", 0]) == pytest.approx(0.06)  # 0.6 s at 0.1 m/s
    matched = lift_clicks(recording, clicks, behind, 0.37)
    np.testing.assert_allclose(matched[["mocap_x_m", "mocap_y_m", "mocap_z_m"]], expected_m, atol=1e-12)
    eight = select_markers(lift_clicks(recording, clicks, mocap))
    late = replace(mocap, times_s=mocap.times_s - 0.37)
    found, given = (
        register_by_camera_marker(eight, *camera_places(recording, capture, offset_s)).T_base_mocap
        for capture, offset_s in ((mocap, 0.0), (late, 0.37))
    )
    np.testing.assert_allclose(found, given, atol=1e-9)


def test_the_eight_are_of_the_two_images_with_most_markers_and_far_apart(laboratory, clicks):
    matched = lift_clicks(laboratory[0], clicks, laboratory[1])
    matched = matched[~((matched["frame"] == 1) & (matched["marker"] == "m0"))]
    matched = matched[~((matched["frame"] == 3) & matched["marker"].isin(["m1", "m2"]))]
    eight = select_markers(matched)
    assert eight["frame"].isin([0, 2]).all() and len(eight) == 8
    points_m = eight[["mocap_x_m", "mocap_y_m", "mocap_z_m"]].to_numpy()
    apart_m = np.linalg.norm(points_m[:, None] - points_m, axis=2)[np.triu_indices(8, 1)]
    assert apart_m.min() > 0.2  # none of them twice, as a marker that stands still is in two images
    assert (np.diff(eight["frame"]) >= 0).all()


@pytest.mark.parametrize(("off_m", "is_chosen"), [(0.09, True), (0.11, False)])
def test_points_that_keep_their_distances_to_a_decimetre_are_chosen(off_m, is_chosen):
    places_m = np.zeros((8, 3))
    places_m[:, 0] = np.arange(8)
    matched = pd.DataFrame({"frame": 0, "marker": [f"m{k}" for k in range(8)]})
    matched[["mocap_x_m", "mocap_y_m", "mocap_z_m"]] = places_m
    places_m[0, 0] -= off_m
    matched[["x_m", "y_m", "z_m"]] = places_m
    assert ("m0" in set(select_markers(matched)["marker"])) == is_chosen


@pytest.mark.parametrize(("skew", "fits"), [(0.8e-4, True), (1.2e-4, False)])
def test_a_given_rotation_may_be_rounded_and_no_more(tmp_path, skew, fits):
    T = np.eye(4)
    T[0, 1] = skew
    write_json(tmp_path / REGISTRATION_FILE, {"T_base_mocap": T.tolist()})
    if fits:
        assert np.array_equal(read_registration(tmp_path / REGISTRATION_FILE).T_base_mocap, T)
    else:
        with pytest.raises(InputError, match="are not a rotation"):
            read_registration(tmp_path / REGISTRATION_FILE)


@pytest.mark.parametrize(("off_m", "n_points"), [(0.015, 36), (0.03, 35)])
def test_a_click_that_is_two_centimetres_off_is_left_out(off_m, n_points):
    """Beside others that are exact, three standard deviations are nothing, and 2 cm count."""
    rng = np.random.default_rng(0)
    measured_m = rng.uniform(-1, 1, (36, 3))
    matched = pd.DataFrame(measured_m, columns=["mocap_x_m", "mocap_y_m", "mocap_z_m"])
    measured_m[0] += [off_m, 0, 0]
    matched[["x_m", "y_m", "z_m"]] = measured_m
    assert register_robustly(matched).n_points == n_points


def test_a_click_within_three_standard_deviations_is_kept():
    rng = np.random.default_rng(1)
    measured_m = rng.uniform(-1, 1, (200, 3))
    matched = pd.DataFrame(measured_m, columns=["mocap_x_m", "mocap_y_m", "mocap_z_m"])
    noise_m = rng.normal(0, 1, (200, 3))
    noise_m *= 0.02 / np.linalg.norm(noise_m, axis=1, keepdims=True)  # 2 cm each: the median
    noise_m[0] *= 3.5  # of 4.45 medians that are allowed
    noise_m[1] *= 5.5
    matched[["x_m", "y_m", "z_m"]] = measured_m + noise_m
    assert register_robustly(matched).n_points == 199
