"""The registrations of a recording, and what each assumption of the paper's costs where only one is wrong."""

import json

import numpy as np
import pytest

from hicp_lib.core.camera import project
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import SIMULATION_FILE, Recording, first_frames
from hicp_lib.study.registration import register, registration_readings
from tests.study.marked_wall import (
    CAMERA,
    CAMERA_MARKER_CAM,
    NAMES,
    OFFSET_S,
    T_BASE_MOCAP,
    displacement_m,
    laboratory_in,
    markers_cam,
)


@pytest.fixture
def laboratory(tmp_path) -> tuple[Recording, MotionCapture]:
    return laboratory_in(tmp_path)


def clicks_csv() -> str:
    pixels = project(CAMERA, markers_cam())
    rows = [f"{k},{n},{u:.2f},{v:.2f}" for k in (0, 1) for n, (u, v) in zip(NAMES, pixels, strict=False)]
    return "frame,marker,u_px,v_px\n" + "\n".join(rows) + "\n"


def test_a_simulated_recording_is_clicked_and_knows_its_transform(laboratory):
    recording, mocap = laboratory
    truth = {"T_base_mocap": T_BASE_MOCAP.tolist(), "mocap_offset_s": OFFSET_S}
    (recording.folder / "simulation.json").write_text(json.dumps(truth))
    found = register(recording, mocap, OFFSET_S, n_images=2, noise_px=0.3)
    assert np.array_equal(found.exact, T_BASE_MOCAP)
    paper, turned, same, every, reprojected = found.fits
    assert [fit.n_points for fit in found.fits] == [8, 8, 8, 24, 24]
    assert len(found.clicks) == 8 and set(found.clicks["frame"]) <= {0, 1}
    assert displacement_m(every.T_base_mocap) < 0.006 and displacement_m(reprojected.T_base_mocap) < 0.006
    assert displacement_m(paper.T_base_mocap) > np.linalg.norm(CAMERA_MARKER_CAM) / 2
    assert displacement_m(turned.T_base_mocap) < displacement_m(paper.T_base_mocap)


def test_a_laboratorys_clicks_are_used_and_nothing_is_said_of_the_truth(laboratory):
    recording, mocap = laboratory
    (recording.folder / "clicks.csv").write_text(clicks_csv())
    found = register(recording, mocap, OFFSET_S)
    assert found.exact is None and len(found.fits) == 5
    assert displacement_m(found.fits[-1].T_base_mocap) < 1e-4
    without = MotionCapture(mocap.times_s, NAMES[:12], mocap.points_m[:, :12], 100.0)
    assert [fit.method for fit in register(recording, without, OFFSET_S).fits] == [
        "Arun: the same eight clicks", "all clicks", "reprojection of all clicks",
    ]  # fmt: skip


def test_clicks_beyond_the_end_of_a_recording_cut_short_are_not_used(laboratory):
    recording, mocap = laboratory
    (recording.folder / "clicks.csv").write_text(clicks_csv())
    found = register(first_frames(recording, 1), mocap, OFFSET_S)
    assert found.fits[-1].n_points == 12 and set(found.clicks["frame"]) == {0}


def test_a_given_transform_is_taken(laboratory):
    recording, mocap = laboratory
    (recording.folder / "registration.json").write_text(json.dumps({"T_base_mocap": T_BASE_MOCAP.tolist()}))
    found = register(recording, mocap, OFFSET_S)
    assert np.array_equal(found.fits[-1].T_base_mocap, T_BASE_MOCAP) and found.clicks.empty


@pytest.fixture
def simulated(laboratory):
    recording, _ = laboratory
    truth = {"T_base_mocap": T_BASE_MOCAP.tolist(), "mocap_offset_s": OFFSET_S}
    (recording.folder / SIMULATION_FILE).write_text(json.dumps(truth))
    return laboratory


def test_where_depth_is_that_of_the_markers_the_camera_marker_costs_its_own_offset(simulated):
    table = registration_readings(
        [register(*simulated, OFFSET_S, 2)] * 2, n_images=2, noise_px=2.0, n_draws=20
    )
    table = table.set_index("reading")
    offset_m = np.linalg.norm(CAMERA_MARKER_CAM)
    assert table.loc["depth of the marker itself", "added_m"] == pytest.approx(offset_m, abs=1e-3)
    assert table.loc["depth of the marker itself", "turned_rad"] < 1e-6
    assert table.loc["camera marker at the optical centre", "added_m"] < table.loc["as written", "added_m"]
    assert table.loc["clicks without error", "turned_rad"] < table.loc["as written", "turned_rad"]
    centred, turned = "turned about the camera, its marker at the optical centre", "turned about the camera"
    assert table.loc[centred, "added_m"] < table.loc[turned, "added_m"] < offset_m
    assert (table["low_m"] <= table["added_m"]).all() and (table["added_m"] <= table["high_m"]).all()
    assert (table["n_draws"] == 40).all() and (table["n_people"] == 2).all()


def test_a_laboratorys_recording_cannot_tell(laboratory):
    (laboratory[0].folder / "clicks.csv").write_text(clicks_csv())
    assert registration_readings([register(*laboratory, OFFSET_S)]) is None
