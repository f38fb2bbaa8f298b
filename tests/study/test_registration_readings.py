"""What each assumption of the paper's registration costs, where only one of them is wrong."""

import json

import numpy as np
import pytest

from hicp_lib.recordings.recording import SIMULATION_FILE
from hicp_lib.study.registration_readings import registration_readings
from tests.study.test_mocap import CAMERA_MARKER_CAM, OFFSET_S, T_BASE_MOCAP, laboratory  # noqa: F401


@pytest.fixture
def simulated(laboratory):  # noqa: F811
    recording, _ = laboratory
    truth = {"T_base_mocap": T_BASE_MOCAP.tolist(), "mocap_offset_s": OFFSET_S}
    (recording.folder / SIMULATION_FILE).write_text(json.dumps(truth))
    return laboratory


def test_where_depth_is_that_of_the_markers_the_camera_marker_costs_its_own_offset(simulated):
    table = registration_readings(*simulated, OFFSET_S, n_images=2, noise_px=2.0, n_draws=20)
    table = table.set_index("reading")
    offset_m = np.linalg.norm(CAMERA_MARKER_CAM)
    assert table.loc["depth of the marker itself", "added_m"] == pytest.approx(offset_m, abs=1e-3)
    assert table.loc["depth of the marker itself", "turned_rad"] < 1e-6
    assert table.loc["camera marker at the optical centre", "added_m"] < table.loc["as written", "added_m"]
    assert table.loc["clicks without error", "turned_rad"] < table.loc["as written", "turned_rad"]
    centred, turned = "turned about the camera, its marker at the optical centre", "turned about the camera"
    assert table.loc[centred, "added_m"] < table.loc[turned, "added_m"] < offset_m
    assert (table["low_m"] <= table["added_m"]).all() and (table["added_m"] <= table["high_m"]).all()
    assert (table["n_draws"] == 20).all()


def test_a_laboratorys_recording_cannot_tell(laboratory):  # noqa: F811
    assert registration_readings(*laboratory, OFFSET_S) is None
