"""Registration from clicked markers: discs before a wall, seen by a moving camera."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.camera import transform
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
    lift_clicks,
    measured_markers,
    read_registration,
    register_robustly,
)
from hicp_lib.simulation.sensors.clicks import simulate_clicks
from tests.mocap.discs import (
    MARKERS_CAM,
    NAMES,
    T_BASE_MOCAP,
    camera_pose,
    errors_of,
)


def test_clicks_are_lifted_to_where_the_markers_are(laboratory, clicks):
    matched = lift_clicks(laboratory[0], clicks, laboratory[1])
    seen, measured = matched[["x_m", "y_m", "z_m"]], matched[["mocap_x_m", "mocap_y_m", "mocap_z_m"]]
    assert len(matched) == len(clicks)
    # A pixel at 1.5 m is 5 mm.
    assert np.abs(seen.to_numpy() - transform(T_BASE_MOCAP, measured.to_numpy())).max() < 0.004


def test_wrong_clicks_do_not_spoil_the_fit_to_many(laboratory, clicks):
    wrong = clicks.copy()
    wrong.loc[::7, "u_px"] += 25
    matched = lift_clicks(laboratory[0], wrong, laboratory[1])
    robust = register_robustly(matched)
    assert errors_of(robust)[1] < 0.004 < 0.02 < errors_of(register_selected(matched))[1]
    assert robust.n_points == len(clicks) - len(wrong[::7])


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
