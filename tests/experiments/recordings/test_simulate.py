"""Simulated recordings: consistent with the robot and the scene, resumed, a prefix of longer ones."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict

import numpy as np
import pytest

from hicp_lib.core.camera import deproject, project, transform
from hicp_lib.core.errors import InputError
from hicp_lib.core.images import read_image
from hicp_lib.experiments.recordings import open as open_module
from hicp_lib.experiments.recordings import simulate
from hicp_lib.experiments.recordings.open import open_people
from hicp_lib.experiments.recordings.simulate import simulate_recording
from hicp_lib.mocap.synchronisation import interpolate_mocap
from hicp_lib.recordings.check import check_recording
from hicp_lib.recordings.qualisys import read_mocap
from hicp_lib.recordings.recording import (
    read_depth_m,
    read_exact_depth_m,
    read_joints,
    read_rgb,
    read_simulation,
    read_truth,
)
from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub
from hicp_lib.simulation.body.identities import Subject


@pytest.fixture(scope="module")
def lower(tmp_path_factory):
    out = tmp_path_factory.mktemp("recordings") / "lower"
    return simulate_recording(out, "relative-lower", n_frames=2, workers=1, progress=False)


@pytest.fixture(scope="module")
def mocap(tmp_path_factory):
    out = tmp_path_factory.mktemp("recordings") / "mocap"
    return simulate_recording(out, "mocap", n_frames=2, workers=1, progress=False)


def points_of(truth, frame, names):
    rows = truth[truth["frame"] == frame].set_index("keypoint").loc[names]
    return rows[["x_m", "y_m", "z_m"]].to_numpy(), rows[["u_px", "v_px"]].to_numpy(), rows["visible"]


def test_a_simulated_recording_has_nothing_to_be_found(lower):
    assert check_recording(lower.folder) == []
    told, identity = read_simulation(lower), Subject().identity
    assert told["scenario"] == "relative-lower"
    assert told["subject"] == {"seed": 0, "number": 0, "split": "held out"}
    assert told["identity"] == asdict(identity) and told["identity"]["room"] == identity.room


def test_poses_are_those_of_the_joints(lower):
    joints = read_joints(lower)[[f"{joint}_rad" for joint in HEAD_JOINTS]].to_numpy()
    expected = load_icub().T_root_camera(joints, "tilted")
    np.testing.assert_allclose(lower.T_base_cam, expected, atol=1e-8)


def test_keypoints_project_to_where_the_truth_says(lower):
    truth = read_truth(lower)
    assert len(truth) == 2 * 136 and set(truth["visible"]) <= {0, 1, 2}
    for frame in (0, 1):
        points_m, pixels_px, _ = points_of(truth, frame, ["left_wrist", "right_elbow"])
        in_camera = transform(np.linalg.inv(lower.T_base_cam[frame]), points_m)
        np.testing.assert_allclose(project(lower.intrinsics, in_camera), pixels_px, atol=1e-6)


def test_the_person_does_not_move(lower):
    truth = read_truth(lower)
    first, second = (points_of(truth, frame, ["left_wrist", "neck"])[0] for frame in (0, 1))
    np.testing.assert_array_equal(first, second)


def test_depth_lies_on_the_person_a_little_before_the_joint(lower):
    truth = read_truth(lower)
    for frame in (0, 1):
        points_m, pixels_px, visible = points_of(truth, frame, ["left_wrist", "right_wrist"])
        in_sight = visible.to_numpy() == 2
        assert in_sight.any()
        points_m, pixels_px = points_m[in_sight], pixels_px[in_sight]
        for depth_m in (read_exact_depth_m(lower, frame), read_depth_m(lower, frame)):
            column, row = pixels_px.round().astype(int).T
            surface = deproject(lower.intrinsics, pixels_px, depth_m[row, column])
            in_base = transform(lower.T_base_cam[frame], surface)
            assert (np.linalg.norm(in_base - points_m, axis=1) < 0.07).all()


def test_measured_depth_is_the_exact_one_but_for_the_sensor(lower):
    measured, exact = read_depth_m(lower, 0), read_exact_depth_m(lower, 0)
    assert 0.7 < np.isfinite(measured).mean() < np.isfinite(exact).mean()
    difference = np.abs(measured - exact)
    assert 0 < np.nanmedian(difference) < 0.01


def test_a_frame_depends_on_scenario_subject_and_number_only(lower):
    rgb, depth_m, _, truth = simulate.record_frame("relative-lower", Subject(), 1)
    stored = read_rgb(lower, 1).astype(int)
    assert np.abs(stored - rgb).mean() < 3  # JPEG
    np.testing.assert_allclose(read_depth_m(lower, 1), depth_m, atol=0.00051)
    np.testing.assert_allclose(truth["keypoints_m"], points_of(read_truth(lower), 1, slice(None))[0])
    other = simulate.record_frame("relative-lower", Subject(number=1), 1)[0]
    assert np.abs(other.astype(int) - rgb).mean() > 10


def test_finished_frames_are_kept_and_a_shorter_recording_is_a_prefix(lower, tmp_path, monkeypatch):
    out = tmp_path / "again"
    shutil.copytree(lower.folder, out)
    (out / "rgb.txt").unlink()
    (out / ".frames" / "000001.json").unlink()  # as if stopped while writing frame 1
    made = []
    real = simulate.record_frame
    monkeypatch.setattr(simulate, "record_frame", lambda *job: made.append(job[2]) or real(*job))
    simulate_recording(out, "relative-lower", n_frames=2, workers=1, progress=False)
    assert made == [1]
    for name in ("rgb/000001.jpg", "depth/000001.png", "truth.parquet", "groundtruth.txt", "rgb.txt"):
        assert (out / name).read_bytes() == (lower.folder / name).read_bytes()
    shorter = simulate_recording(out, "relative-lower", n_frames=1, workers=1, progress=False)
    assert made == [1] and len(shorter) == 1
    assert [path.name for path in (out / "rgb").iterdir()] == ["000000.jpg"]
    assert len(read_truth(shorter)) == 136


def test_what_was_made_of_somebody_else_is_dropped(lower, tmp_path, monkeypatch):
    out = tmp_path / "other"
    shutil.copytree(lower.folder, out)
    blank = np.zeros((480, 640, 3), np.uint8)
    truth = json.loads((out / ".frames" / "000000.json").read_text())
    fake = blank, np.ones((480, 640)), np.ones((480, 640)), truth
    (out / "mocap.tsv").write_text("of another scenario")
    stamp = json.loads((out / ".frames" / "stamp.json").read_text())
    (out / ".frames" / "stamp.json").write_text(json.dumps(stamp | {"once": ["mocap.tsv", "../mine.txt"]}))
    (tmp_path / "mine.txt").write_text("precious")
    (out / "rgb" / "mine.jpg").write_text("precious")
    monkeypatch.setattr(simulate, "record_frame", lambda *job: fake)
    simulate_recording(out, "relative-lower", n_frames=1, subject=Subject(5), workers=1, progress=False)
    assert read_image(out / "rgb" / "000000.jpg").max() == 0
    assert not (out / "rgb" / "000001.jpg").exists() and not (out / "mocap.tsv").exists()
    assert (tmp_path / "mine.txt").exists() and (out / "rgb" / "mine.jpg").exists()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (dict(name="relative-sideways"), "no scenario"),
        (dict(n_frames=0), "n_frames is 0"),
        (dict(n_frames=101), "expected a whole number from 1 to 100"),
        (dict(workers=0), "workers is 0"),
    ],
)
def test_what_cannot_be_simulated_is_refused(tmp_path, arguments, expected):
    with pytest.raises(InputError, match=expected):
        simulate_recording(tmp_path / "x", **(dict(name="relative-lower") | arguments))
    assert not (tmp_path / "x").exists()


def test_a_folder_with_other_things_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match="holds files not made by this command"):
        simulate_recording(tmp_path, "relative-lower", n_frames=1)


def test_markers_are_around_their_joints_with_the_true_clock_and_frame(mocap):
    told, motion = read_simulation(mocap), read_mocap(mocap.mocap_path)
    stamps_s = mocap.times_s - told["mocap_offset_s"]
    measured = interpolate_mocap(motion.times_s, motion.points_m, stamps_s)
    in_base = transform(np.array(told["T_base_mocap"]), measured)
    truth = read_truth(mocap)
    for frame in (0, 1):
        for joint in ("left_elbow", "right_wrist"):
            side, part = joint.split("_")
            columns = [motion.names.index(f"{part}_{side}_{number}") for number in (1, 2)]
            middle = in_base[frame, columns].mean(axis=0)
            assert np.linalg.norm(middle - points_of(truth, frame, [joint])[0][0]) < 0.03
        camera = in_base[frame, motion.names.index("camera")]
        assert 0.01 < np.linalg.norm(camera - mocap.T_base_cam[frame, :3, 3]) < 0.06


def test_both_files_of_motion_capture_say_the_same(mocap):
    tsv, c3d = (read_mocap(mocap.mocap_path.with_suffix(kind)) for kind in (".tsv", ".c3d"))
    assert tsv.names == c3d.names and len(tsv.names) == 13
    np.testing.assert_allclose(tsv.points_m, c3d.points_m, atol=2e-6)
    assert np.ptp(tsv.times_s) >= np.ptp(mocap.times_s) + 0.9


def test_an_experiment_is_simulated_once_into_the_cache(tmp_path, monkeypatch, lower):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path))
    calls = []

    def copied(folder, scenario, n_frames, subject, **_):
        calls.append((scenario, n_frames, subject.seed))
        shutil.copytree(lower.folder, folder)

    monkeypatch.setattr(simulate, "simulate_recording", copied)
    open_people("relative-lower", n_frames=2)
    assert [len(one) for one in open_people("relative-lower", n_frames=2)] == [2]
    assert calls == [("relative-lower", 2, 0)]
    open_people("relative-lower", n_frames=2, seed=1)
    assert calls[1:] == [("relative-lower", 2, 1)]


def test_what_cannot_be_opened_is_told():
    with pytest.raises(InputError, match="is not a folder"):
        open_people("relative-lower", recording="/no/recording")
    with pytest.raises(InputError, match="no scenario"):
        open_people("sideways")


def test_several_people_are_simulated_a_person_to_a_process_and_opened_in_their_order(tmp_path, monkeypatch):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path))
    people = open_people("relative-lower", n_frames=1, n_people=2)
    assert [read_simulation(one)["subject"]["number"] for one in people] == [0, 1]
    monkeypatch.setattr(open_module, "_simulate", lambda *_, **__: pytest.fail("simulated again"))
    again = open_people("relative-lower", n_frames=1, n_people=2)
    assert [one.folder for one in again] == [one.folder for one in people]
    with pytest.raises(InputError, match="n_people is 0"):
        open_people("relative-lower", n_people=0)


def test_a_labs_people_are_its_folders(lower):
    (one,) = open_people("relative-lower", lower.folder, n_frames=1, n_people=5)
    two = open_people("relative-lower", [lower.folder, str(lower.folder)])
    assert len(one) == 1 and [len(person) for person in two] == [2, 2]
    assert read_truth(one)["frame"].max() == 0
