"""A recording's clock and errors, from markers that are discs before a wall."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.camera import transform
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import INDEX
from hicp_lib.evaluation.space.lifting_ablation import N_STEPS
from hicp_lib.evaluation.space.mocap_error import JOINTS, MARKERS, TABLE_JOINTS
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.mocap.synchronisation import ClockOffset
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import TRUTH_FILE, Recording
from hicp_lib.study import mocap as study_mocap
from hicp_lib.study.mocap import (
    Person,
    ablation,
    errors_at_joints,
    find_clock,
    follow_people,
    lift_frames,
    medians_under,
    open_mocap,
)
from hicp_lib.study.registration import Registered, register
from tests.study.marked_wall import CAMERA, OFFSET_S, T_BASE_CAM, T_BASE_MOCAP, laboratory_in, markers_cam


@pytest.fixture
def laboratory(tmp_path) -> tuple[Recording, MotionCapture]:
    return laboratory_in(tmp_path)


def test_what_is_missing_is_said_in_one_line(laboratory):
    recording, mocap = laboratory
    with pytest.raises(InputError, match="has neither clicks.csv .* nor registration.json"):
        register(recording, mocap, OFFSET_S)
    with pytest.raises(InputError, match="has no mocap.tsv"):
        open_mocap(recording)


def test_every_step_is_lifted_where_it_can_be_judged(laboratory):
    recording, _ = laboratory
    pixels, scores = np.full((1, 136, 2), np.nan), np.zeros((1, 136))
    pixels[0, INDEX["left_wrist"]], scores[0, INDEX["left_wrist"]] = (20.0, 120.0), 0.9
    found = dict.fromkeys(("one", "other"), [Detections(pixels, scores, np.ones(1))] * 2)
    points, stepwise = lift_frames(recording, found)
    assert list(points["method"].unique()) == list(stepwise["method"].unique()) == ["robust", "paper"]
    clock = ClockOffset(0.0, 1.0, (0.0, 0.0))
    person = Person(recording, laboratory[1], found, points, stepwise, clock)
    assert ablation([person]) is None
    wrist = {"keypoint": "left_wrist", "x_m": -2.9, "y_m": -1.4, "z_m": 0.4, "u_px": 20.0, "v_px": 120.0}
    truth = pd.DataFrame([{"frame": k, "t_s": 0.0, **wrist, "visible": 2} for k in (0, 1)])
    truth.to_parquet(recording.folder / TRUTH_FILE)
    again, stepwise = lift_frames(recording, found)
    pd.testing.assert_frame_equal(again.reset_index(drop=True), points.reset_index(drop=True))
    assert set(stepwise["detector"]) == {"one"} and set(stepwise["method"]) == set(N_STEPS)
    table, covered = ablation([replace(person, stepwise=stepwise)] * 3)
    assert covered["n"].sum() == 6
    assert table["method"].tolist() == list(N_STEPS) and (table["n_compared"] == 6).all()


def moving_points(times_s: np.ndarray) -> np.ndarray:
    phase = times_s[:, None] + np.arange(4)
    return np.stack(
        [0.3 * np.sin(2 * phase) * np.cos(phase), 0.2 * np.cos(3 * phase), 0.1 * phase % 0.1], axis=2
    )


def test_the_clock_is_found_from_what_all_detectors_lifted():
    camera_s, mocap_s = OFFSET_S + 0.5 + np.arange(150) / 15, np.arange(0, 12, 0.01)
    pairs = np.repeat(moving_points(mocap_s), 2, axis=1)
    names = tuple(name for joint in TABLE_JOINTS for name in MARKERS[joint])
    recording = Recording(None, CAMERA, 1e3, camera_s, [], [], np.tile(np.eye(4), (150, 1, 1)), None)
    tables = []
    for detector, noise_m in (("a", 0.003), ("b", 0.01)):
        points = moving_points(camera_s - OFFSET_S)
        points = points + np.random.default_rng(0).normal(0, noise_m, points.shape)
        table = pd.DataFrame(points.reshape(-1, 3), columns=["x_m", "y_m", "z_m"])
        labels = {"frame": np.repeat(np.arange(150), 4), "keypoint": np.tile(TABLE_JOINTS, 150)}
        tables.append(table.assign(**labels, detector=detector, method="paper", person=0, score=0.9))
    clock = find_clock(recording, MotionCapture(mocap_s, names, pairs, 100.0), pd.concat(tables))
    assert clock.offset_s == pytest.approx(OFFSET_S, abs=0.01)


def test_whoever_has_no_clock_is_left_out_and_the_reason_is_told(laboratory, monkeypatch):
    recording, mocap = laboratory
    clocks = iter([ClockOffset(70.2, 0.9, (70.1, 70.3)), InputError("no clock"), InputError("no clock")])

    def found_clock(*_):
        clock = next(clocks)
        if isinstance(clock, InputError):
            raise clock
        return clock

    (recording.folder / "simulation.json").write_text(json.dumps({"mocap_offset_s": OFFSET_S}))
    monkeypatch.setattr(study_mocap, "find_clock", found_clock)
    monkeypatch.setattr(study_mocap, "open_mocap", lambda _: mocap)
    monkeypatch.setattr(study_mocap, "detect_frames", lambda *_: {"a": [Detections.none()] * 2})
    people, table = follow_people([recording, recording], ["a"])
    assert len(people) == 1 and people[0].clock.offset_s == 70.2
    assert table["left_out"].tolist() == ["", "no clock"] and table["n_frames"].tolist() == [2, 2]
    assert table["off_s"].tolist() == pytest.approx([0.2, np.nan], nan_ok=True)
    with pytest.raises(InputError, match="room: no clock"):
        follow_people([recording], ["a"])


def lifted(places_m: np.ndarray, **columns) -> pd.DataFrame:
    """Joints (6, 3) found in two frames."""
    table = pd.DataFrame(np.tile(places_m, (2, 1)), columns=["x_m", "y_m", "z_m"])
    table = table.assign(frame=np.repeat([0, 1], 6), keypoint=np.tile(JOINTS, 2), person=0, score=0.9)
    return table.assign(**({"detector": "a", "method": "paper"} | columns))


@pytest.fixture
def registered(laboratory) -> Registered:
    recording, mocap = laboratory
    truth = {"T_base_mocap": T_BASE_MOCAP.tolist(), "mocap_offset_s": OFFSET_S}
    (recording.folder / "simulation.json").write_text(json.dumps(truth))
    return register(recording, mocap, OFFSET_S, n_images=2, noise_px=0.0)


MIDDLES_M = transform(T_BASE_CAM, markers_cam()).reshape(6, 2, 3).mean(axis=1)


def test_medians_change_with_the_registration(registered):
    medians = medians_under([registered] * 2, [lifted(MIDDLES_M)] * 2, draws=Draws(20))
    assert set(medians["keypoint"]) == set(TABLE_JOINTS) and (medians["count"] == 4).all()
    worst_m = medians.groupby("registration")["median_m"].max()
    assert worst_m["exact"] < 1e-6 < worst_m["all clicks"] < 0.005
    assert worst_m["paper: eight clicks, camera marker"] > 0.02
    given = replace(registered, fits=registered.fits[-1:])  # a person with a registration the others lack
    one = medians_under([registered, given], [lifted(MIDDLES_M)] * 2, draws=Draws(20))
    counts = one.groupby("registration")[["count", "n_people"]].max()
    assert counts.loc["all clicks"].tolist() == [2, 1]
    assert counts.loc["reprojection of all clicks"].tolist() == [4, 2]


def test_errors_of_all_people_are_one_table_with_frames_numbered_on(registered):
    tables = [lifted(MIDDLES_M), lifted(MIDDLES_M + [0, 0, 0.05])]
    errors = errors_at_joints([registered] * 2, tables)
    assert errors.groupby("subject")["frame"].unique().map(list).tolist() == [[0, 1], [2, 3]]
    means_m = errors.groupby("subject")["error_m"].mean()
    assert means_m[0] < 0.005 and means_m[1] == pytest.approx(0.05, abs=0.005)
    assert {"sight", "distance_m"} <= set(errors.columns)
