"""Figures of avoidance are drawn from a short run, and say what they show."""

import cv2
import numpy as np
import pandas as pd
import pytest

from hicp_lib.experiments.avoidance.closed_loop import HAND_COLUMNS, Latency, Trial
from hicp_lib.experiments.avoidance.runs import Job, Run
from hicp_lib.robot.home import HOME_M, home_posture
from hicp_lib.robot.kinematics import ARM_JOINTS, load_icub
from hicp_lib.robot.separation import Separation
from hicp_lib.robot.skin import read_skin
from hicp_lib.study.plots.avoidance import (
    clearances,
    filmstrip,
    nearest_views,
    separation_terms,
    sweep_curves,
)


@pytest.fixture(scope="module")
def run() -> Run:
    t = np.arange(40) * 0.02
    angles = np.tile(home_posture(load_icub()).angles("left"), (len(t), 1))
    angles[:, 6] += 0.2 * t
    columns = {"t_s": t, "distance_m": 0.3 - 0.1 * t, "activation": t, "hand_error_m": 0.1 * t}
    columns |= {f"{joint}_rad": angles[:, k] for k, joint in enumerate(ARM_JOINTS)}
    columns |= dict(zip(HAND_COLUMNS, HOME_M["left"], strict=True))
    cycles = pd.DataFrame(columns).assign(activations=[np.full(len(read_skin()), 0.3)] * len(t))
    jpeg = cv2.imencode(".jpg", np.full((240, 320, 3), 90, np.uint8))[1].tobytes()
    empty = {name: [] for name in ("keypoints_px", "scores", "keypoints_m")}
    frames = pd.DataFrame([{"t_s": 0.0, "jpeg": jpeg, "truth_m": np.zeros(408).tolist()} | empty])
    return Run(Job(Trial("sitting, hand"), "mediapipe", Latency(inference_s=0.04)), cycles, frames)


def test_terms_of_the_separation_add_up():
    separations = {"mediapipe": Separation(0.2, 0.06, 0.02, 0.05)}
    terms = separation_terms(separations, "made up")
    values_m = terms.table.set_index("term")["mediapipe"]
    assert values_m["sum"] == pytest.approx(separations["mediapipe"].distance_m)
    assert values_m.drop("sum").sum() == pytest.approx(values_m["sum"])
    (dots,) = [bars.lines[0] for bars in terms.figure.axes[0].containers]
    assert dots.get_xdata().tolist() == pytest.approx((100 * values_m).tolist())
    assert "S_h: person, until the robot stands with 0.13 m before mediapipe" in terms.alt


def test_clearances_and_sweeps_are_drawn_over_people():
    people = pd.DataFrame({"script": "sitting, hand", "subject": range(12), "gains": "ours"})
    people = people.assign(min_distance_m=0.02, reach_m=np.linspace(0, 0.11, 12), detector="mediapipe")
    figure = clearances(people, "made up")
    assert "the highest mean in the first reach is mediapipe, ours 5.5 cm" in " ".join(figure.caption.split())
    assert "mediapipe, ours 5.5" in figure.alt and figure.table["n_people"].tolist() == [12, 12]
    swept = pd.concat(
        [people.assign(latency_s=late_s, min_distance_m=0.05 - late_s / 10) for late_s in (0.0, 0.3)]
    )
    figure = sweep_curves({"latency_s": swept}, "made up")
    assert "mediapipe, ours, from 5.0 to 2.0 cm over latency" in figure.alt
    assert "Largest fall: mediapipe, ours, from 5.0 to 2.0 cm over latency." in figure.caption
    assert figure.figure.axes[0].get_lines()[0].get_xdata().tolist() == [0, 300]


def test_a_strip_shows_the_arm_move(run):
    strip = filmstrip(run, (0.1, 0.6), "made up")
    first, last = (axis.images[0].get_array().astype(float) for axis in strip.figure.axes[2:])
    assert strip.table is None and np.abs(last - first).max() > 100


def test_each_detector_shows_the_last_image_before_the_middle_of_the_near_phase(run):
    grey = {t_s: cv2.imencode(".png", np.full((240, 320, 3), level, np.uint8))[1].tobytes()
            for t_s, level in ((0.0, 10), (3.0, 90), (3.3, 200))}  # fmt: skip
    frames = pd.concat([run.frames.assign(t_s=t_s, jpeg=content) for t_s, content in grey.items()])
    other = Job(Trial("sitting, head"), "movenet-thunder")
    unseeing = Run(Job(run.job.trial, "ground truth"), run.cycles, pd.DataFrame())
    runs = [unseeing, Run(run.job, run.cycles, frames), Run(other, run.cycles, run.frames)]
    figure = nearest_views(runs, "made up")
    axes = np.reshape(figure.figure.axes, (2, 2))
    assert [[len(axis.images) for axis in row] for row in axes] == [[1, 0], [0, 1]]
    assert axes[0, 0].images[0].get_array().max() == 90 and axes[1, 0].get_ylabel() == "sitting, head"
    assert "sitting, hand and sitting, head" in figure.alt
    assert "somebody is found: mediapipe 0 and movenet-thunder 0." in figure.caption
    sure = {"keypoints_px": [120.0, 90.0] * 136, "scores": [0.9] * 136, "keypoints_m": [1.0] * 408}
    there = [Run(run.job, run.cycles, pd.DataFrame([frames.iloc[0].to_dict() | sure]))] * 2
    assert "somebody is found: mediapipe 1." in nearest_views(there, "made up").caption, (
        "the last run is shown"
    )
