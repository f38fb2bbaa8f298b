"""The data of the relative test: which recordings, what is found and lifted in them, and known of them."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.camera import Camera
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import INDEX
from hicp_lib.experiments.recordings.open import data_note
from hicp_lib.recordings.recording import JOINTS_FILE, SIMULATION_FILE, TRUTH_FILE
from hicp_lib.robot.kinematics import HEAD_JOINTS
from hicp_lib.study import mocap
from hicp_lib.study import relative as relative_views
from tests.recordings.writing import RecordingWriter

CAMERA = Camera(width_px=64, height_px=48, fx_px=50, fy_px=50, cx_px=31.5, cy_px=23.5)


@pytest.fixture
def lab(tmp_path):
    """Two recordings of a wall one metre in front of a camera at the origin."""
    for name in ("a/still", "b/still"):
        writer = RecordingWriter(tmp_path / name, CAMERA)
        for time_s in (0.0, 1.0):
            writer.add(time_s, np.zeros((48, 64, 3), np.uint8), np.ones((48, 64)), np.eye(4))
        writer.finish()
    return tmp_path


def one_wrist(u_px: float, v_px: float) -> Detections:
    pixels, scores = np.full((1, 136, 2), np.nan), np.zeros((1, 136))
    pixels[0, INDEX["left_wrist"]], scores[0, INDEX["left_wrist"]] = (u_px, v_px), 0.8
    return Detections(pixels, scores, np.ones(1))


def test_recordings_of_a_lab_are_called_after_their_folders(lab):
    assert list(relative_views.open_views(str(lab / "a/still"))) == ["still"]
    both = relative_views.open_views(str(lab / "a/still"), str(lab / "b/still"))
    assert list(both) == [str(lab / "a/still"), str(lab / "b/still")]  # equal names would not tell them apart
    assert [[len(one) for one in people] for people in both.values()] == [[2], [2]]
    there, _ = relative_views.of_person(both, {}, 0)
    assert data_note({"still": there[str(lab / "a/still")]}) == "recording still"


def test_a_lab_gives_a_folder_of_each_person(lab):
    several = [str(lab / "a/still"), str(lab / "b/still")]
    views = relative_views.open_views(several)
    assert [len(people) for people in views.values()] == [2]
    assert relative_views.subjects_of(views)["still"].tolist() == [0, 0, 1, 1]
    with pytest.raises(
        InputError, match="recording and recording_lower: 2 and 1 folders; give both views of"
    ):
        relative_views.open_views(several, several[0])
    with pytest.raises(InputError, match="no person 2; there are 2, from 0 on"):
        relative_views.of_person(views, {}, 2)


def test_without_a_folder_both_views_are_simulated(monkeypatch):
    asked = []
    monkeypatch.setattr(relative_views, "open_people", lambda *arguments: asked.append(arguments))
    assert list(relative_views.open_views(n_frames=7, n_people=4, seed=3)) == ["upper", "lower"]
    assert asked == [("relative-upper", "", 7, 4, 3), ("relative-lower", "", 7, 4, 3)]


def test_a_folder_that_is_no_recording_is_refused(tmp_path):
    with pytest.raises(InputError, match="camera.json"):
        relative_views.open_views(str(tmp_path))


def test_everything_found_is_lifted_by_every_method(lab, monkeypatch):
    views = relative_views.open_views([str(lab / "a/still"), str(lab / "b/still")])
    given = {0: one_wrist(31.5, 23.5), 1: one_wrist(41.5, 13.5)}
    monkeypatch.setattr(
        mocap, "detect_images",
        lambda detector, paths: {k: SimpleNamespace(detections=given[k]) for k in paths},
    )  # fmt: skip
    found = relative_views.detect_views(views, ["mediapipe"])
    assert list(found) == [("still", "mediapipe")]
    assert [len(of_person) for of_person in found["still", "mediapipe"]] == [2, 2]
    points = relative_views.lift_views(views, found)
    assert list(points.columns[:4]) == ["view", "subject", "detector", "method"]
    of_paper = points[points["method"] == "paper"]
    assert of_paper["frame"].tolist() == [0, 1, 2, 3] and of_paper["subject"].tolist() == [0, 0, 1, 1]
    at = of_paper[["x_m", "y_m", "z_m"]].to_numpy()
    # Half a pixel is 1 cm there.
    np.testing.assert_allclose(at, [[0, 0, 1], [0.2, -0.2, 1]] * 2, atol=0.011)


def test_recordings_of_nobody_are_refused(lab):
    views = relative_views.open_views(str(lab / "a/still"))
    with pytest.raises(InputError, match="still: nobody was found and lifted in any image"):
        relative_views.lift_views(views, {("still", "mediapipe"): [[Detections.none()] * 2]})


def test_truth_joints_and_simulation_are_known_only_where_they_are(lab):
    views = relative_views.open_views(str(lab / "a/still"), str(lab / "b/still"))
    there, _ = relative_views.of_person(views, {}, 0)
    first = next(iter(there.values())).folder
    assert relative_views.robot_body(there) is None and relative_views.true_positions(views) is None
    joints = pd.DataFrame(np.zeros((2, 6)), columns=[f"{name}_rad" for name in HEAD_JOINTS])
    joints.assign(frame=[0, 1], t_s=[0.0, 1]).to_parquet(first / JOINTS_FILE)
    (first / SIMULATION_FILE).write_text('{"scenario": "relative-upper"}')
    truth = [(0, 0.0, "nose", 0.0, 0.0, 0.0, 0.0, 0.0, 2)]
    columns = ["frame", "t_s", "keypoint", "x_m", "y_m", "z_m", "u_px", "v_px", "visible"]
    pd.DataFrame(truth, columns=columns).to_parquet(first / TRUTH_FILE)
    alone = dict(list(views.items())[:1])
    assert relative_views.robot_body(there).vertices_m[:, 2].max() > 0.4  # the head, and the camera on it
    assert relative_views.true_positions(views) is None and set(relative_views.true_positions(alone)) == set(
        alone
    )
    assert relative_views.true_positions(alone)[str(first)]["subject"].tolist() == [0]
    known = dict(list(there.items())[:1])
    assert data_note(known) == "simulated recording (rendered person, simulated D435)" != data_note(there)


def test_parts_may_be_in_the_image_whole_or_partly(lab):
    """A camera of 64 x 48 pixels; both wrists in one image, one of them in the other, twice."""
    views = relative_views.open_views([str(lab / "a/still"), str(lab / "b/still")])
    pixels = {"left_wrist": [(5, 5), (70, 5)] * 2, "right_wrist": [(63, 47), (0, 0)] * 2}
    rows = [(frame, name, *at) for name, places in pixels.items() for frame, at in enumerate(places)]
    truth = {"still": pd.DataFrame(rows, columns=["frame", "keypoint", "u_px", "v_px"])}
    table = relative_views.parts_in_image(views, truth, {"wrists": tuple(pixels), "left": ("left_wrist",)})
    assert table.values.tolist() == [["still", "wrists", 0.5, 0.5], ["still", "left", 0.5, 0.0]]
