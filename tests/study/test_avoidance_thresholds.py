"""What counts as near, moved, back and seen: each threshold at its very value."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.keypoints import INDEX
from hicp_lib.experiments.avoidance.closed_loop import Latency, Trial
from hicp_lib.experiments.avoidance.reaching import LEAVES_S
from hicp_lib.experiments.avoidance.runs import Job, Run
from hicp_lib.robot.loop import AVOIDING, FREE
from hicp_lib.study.avoidance import (
    BACK_M,
    CROSSED_M,
    FIELD_M,
    MOVED_M,
    SURE,
    keypoint_errors,
    measured_times,
    metrics,
    sure_keypoints,
)

PERIOD_S = 0.25
T = np.arange(0, LEAVES_S[1] + 2, PERIOD_S)


def run(distance_m=1.0, away_m=0.0, status=FREE, frames=(), condition="mediapipe") -> Run:
    cycles = {"t_s": T, "distance_m": distance_m, "hand_error_m": away_m, "status": status}
    return Run(
        Job(Trial("sitting, hand"), condition, Latency(inference_s=0.1)),
        pd.DataFrame(cycles),
        pd.DataFrame(frames),
    )


def frame(t_s: float, score: float, time_ms: float = 90.0) -> dict:
    points, scores = np.full((1, 136, 3), np.nan), np.zeros((1, 136))
    points[0, INDEX["left_wrist"]], scores[0, INDEX["left_wrist"]] = 0.1, score
    truth = np.full((136, 3), 5.0)
    truth[INDEX["left_wrist"]] = 0.1
    arrays = {"keypoints_m": points, "scores": scores, "truth_m": truth, "keypoints_px": points[..., :2]}
    flat = {name: array.ravel().tolist() for name, array in arrays.items()}
    return {"t_s": t_s, "time_ms": time_ms, "jpeg": b""} | flat


def row(**cycles) -> pd.Series:
    return metrics([run(**cycles)]).iloc[0]


@pytest.mark.parametrize(("limit_m", "column"), [(0.05, "under_5cm_s"), (0.1, "under_10cm_s")])
def test_time_within_a_distance_is_that_below_it(limit_m, column):
    assert row(distance_m=limit_m)[column] == 0
    assert row(distance_m=np.where(T < 1, limit_m - 1e-9, 1))[column] == pytest.approx(1.0)


def test_reaction_counts_from_the_crossing_to_the_first_motion():
    distance_m = np.select([T < 1, T < 1.25, T < 3], [0.3, CROSSED_M, 0.1], 0.3)
    away_m = np.select([T < 1.5, T < 2], [0.0, MOVED_M], MOVED_M + 1e-9)
    assert row(distance_m=distance_m, away_m=away_m)["reaction_s"] == pytest.approx(2.0 - 1.0)


def test_a_person_who_is_near_for_one_cycle_has_crossed():
    distance_m = np.where(T == 1.5, 0.1, 0.3)
    assert row(distance_m=distance_m, away_m=np.where(T >= 2, 0.1, 0))["reaction_s"] == 2.0 - 1.25


@pytest.mark.parametrize("distance_m", [CROSSED_M, CROSSED_M - 1e-9], ids=["never within", "never outside"])
def test_without_a_crossing_there_is_no_reaction(distance_m):
    assert np.isnan(row(distance_m=distance_m, away_m=np.where(T >= 2, 0.1, 0))["reaction_s"])


def test_the_hand_is_back_at_its_threshold_and_not_before_the_person_left():
    left_s = LEAVES_S[1]
    late = np.where(T < left_s + 1, BACK_M + 1e-9, BACK_M)
    assert row(away_m=late)["back_s"] == pytest.approx(T[T >= left_s + 1][0] - left_s)
    assert row(away_m=np.where(T < 1, 0.1, 0))["back_s"] == 0
    assert np.isnan(row(away_m=BACK_M)["back_s"]) and np.isnan(row(away_m=0.1)["back_s"])


@pytest.mark.parametrize(("distance_m", "expected"), [(FIELD_M, 1), (FIELD_M - 1e-9, 0)])
def test_a_retreat_is_false_from_the_field_on(distance_m, expected):
    assert row(distance_m=distance_m, status=np.where(T == 1, AVOIDING, FREE))["false_retreats"] == expected


def test_blind_is_the_longest_time_without_a_sure_keypoint_while_near():
    distance_m = np.where((T >= 1) & (T <= 5), 0.1, 1.0)
    times_s = np.arange(0, 7, 0.5)
    seen_s = (1.0, 2.0, 3.0)
    frames = [frame(t, 0.9 if t in seen_s else SURE) for t in times_s]
    found = row(distance_m=distance_m, frames=frames)
    assert found["blind_s"] == 1.0  # from 2 s to 3 s; they are looked at from 1.25 s to 3.75 s
    assert found["seen_share"] == pytest.approx(2 / 5)  # of the images from 1.5 s to 3.5 s
    late = [frame(t, 0.9 if t >= 4.5 else SURE) for t in times_s]
    assert row(distance_m=distance_m, frames=late)["blind_s"] == 2.5


def test_a_keypoint_is_sure_above_the_threshold():
    frames = pd.DataFrame([frame(0, SURE), frame(1, SURE + 1e-6)])
    assert [int(sure_keypoints(row)[1].sum()) for _, row in frames.iterrows()] == [0, 1]
    assert keypoint_errors([run(frames=[frame(0, SURE), frame(1, SURE + 1e-6)])])["t_s"].tolist() == [1]


def test_an_image_that_took_as_long_as_the_delay_was_in_time():
    frames = [frame(t, 0.9, time_ms) for t, time_ms in enumerate((5000.0, 100.0, 100.5))]
    shown = measured_times([run(frames=frames)])
    assert shown["within_share"].item() == 0.5 and shown["median_ms"].item() == 100.25
