"""Stability and accuracy on keypoints whose errors are known."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.evaluation.space.sightings import spread_and_bias
from hicp_lib.evaluation.space.stability import (
    PARTS,
    LiftedViews,
    counted,
    median_positions,
    within_distance,
)
from hicp_lib.evaluation.statistics.resampling import Draws
from tests.evaluation.still_person import KEYPOINTS, TRUE_M, alone, make_points, make_truth

FAR = [9.0, 0, 0]
NONE = [np.nan] * 3


def along_x(*offsets_m):
    return [[x, 0, 0] for x in offsets_m]


def value(table, part, threshold_m):
    row = table[(table["part"] == part) & (table["threshold_m"] == threshold_m)]
    assert len(row) == 1
    return float(row["value"].iloc[0])


def test_only_the_best_person_with_a_score_above_the_limit_and_a_position_counts():
    points = make_points([[0, 0, 0]] * 4, keypoints=["left_wrist"])
    points.loc[0, "person"] = 1
    points.loc[1, "score"] = 0.1  # not above
    points.loc[2, ["x_m", "y_m", "z_m"]] = np.nan
    assert counted(points)["frame"].tolist() == [3]


def test_median_positions_shrug_off_outliers():
    points = make_points([*along_x(0.01, 0.02, 0.03), FAR, NONE], keypoints=["left_wrist", "right_elbow"])
    medians = median_positions(points).set_index("keypoint")
    assert set(medians.index) == {"left_wrist", "right_elbow"} and (medians["n"] == 4).all()
    at = medians.loc["left_wrist", ["x_m", "y_m", "z_m"]].to_numpy(float)
    np.testing.assert_allclose(at, TRUE_M["left_wrist"] + [0.025, 0, 0], atol=1e-12)


def test_images_without_the_keypoint_count_as_not_within():
    points = make_points([*along_x(0, 0, 0, 0.03, 0.2), NONE])  # the median is the true position
    table = within_distance(
        LiftedViews(points, alone(upper=8)), draws=Draws(0)
    )  # two more images in which nobody is found
    for part in PARTS:
        assert value(table, part, 0.025) == pytest.approx(3 / 8)
        assert value(table, part, 0.05) == pytest.approx(4 / 8)
        assert value(table, part, 0.1) == pytest.approx(4 / 8)
    assert table["found"].to_numpy() == pytest.approx(5 / 8)


def test_a_detector_that_is_always_wrong_alike_is_stable_but_not_accurate():
    points, n = make_points([[0.06, 0, 0]] * 10), alone(upper=10)
    truth = {"upper": make_truth(10)}
    stable = within_distance(LiftedViews(points, n), draws=Draws(0))
    accurate = within_distance(LiftedViews(points, n, truth), draws=Draws(0))
    assert stable["value"].to_numpy() == pytest.approx(1) and set(stable["reference"]) == {"median"}
    assert accurate.groupby("threshold_m")["value"].mean().tolist() == pytest.approx([0, 0, 1])
    row = spread_and_bias(LiftedViews(points, n, truth), draws=Draws(0)).iloc[0]
    assert (row["spread_m"], row["bias_m"], row["error_m"]) == pytest.approx((0, 0.06, 0.06))


def test_spread_without_bias_is_told_from_bias_without_spread():
    offsets = along_x(*np.tile([-0.04, 0.04], 10), 0)
    row = spread_and_bias(
        LiftedViews(make_points(offsets), alone(upper=21), {"upper": make_truth(21)}), draws=Draws(0)
    ).iloc[0]
    assert (row["spread_m"], row["bias_m"], row["error_m"]) == pytest.approx((0.04, 0, 0.04))


def test_a_hand_counts_all_its_keypoints():
    hand = list(PARTS["left hand"])
    points = pd.concat(
        [make_points([[0, 0, 0]] * 3, hand[:7]), make_points([[0, 0, 0], NONE, NONE], hand[7:])]
    )
    table = within_distance(LiftedViews(points, alone(upper=3)), draws=Draws(0))
    assert value(table, "left hand", 0.1) == pytest.approx((7 * 3 + 14) / (21 * 3))
    assert value(table, "right hand", 0.1) == 0  # hands are given, this one was never found


def test_what_a_detector_gives_but_never_finds_counts_as_nought_and_what_it_does_not_give_has_no_row():
    wrist = ["left_wrist"]
    points = pd.concat(
        [make_points([[0, 0, 0]], wrist, detector=name) for name in ("mediapipe", "movenet-thunder", "mine")]
        + [make_points([[0, 0, 0]], wrist, detector="combined:movenet-thunder+mediapipe-hands")]
    )
    table = within_distance(LiftedViews(points, alone(upper=1)), thresholds_m=[0.1], draws=Draws(0))
    parts = table.groupby("detector")["part"].apply(set)
    body = {part for part in PARTS if "hand" not in part}
    assert parts["mediapipe"] == parts["combined:movenet-thunder+mediapipe-hands"] == set(PARTS)
    assert parts["movenet-thunder"] == parts["mine"] == body
    found = table["part"] == "left wrist"
    assert (table["value"][found] == 1).all() and (table["value"][~found] == 0).all()


def test_views_and_detectors_are_kept_apart():
    points = pd.concat(
        [
            make_points(along_x(0, 0, 0, 0.2), view="upper"),
            make_points(along_x(0, 0, 0.2, -0.2), view="lower"),
            make_points(along_x(0, 0), view="lower", detector="openpose-mobilenet", keypoints=["left_wrist"]),
        ]
    )
    table = within_distance(LiftedViews(points, alone(upper=4, lower=4)), draws=Draws(0))
    wrist = table[(table["part"] == "left wrist") & (table["threshold_m"] == 0.1)]
    assert wrist.set_index(["view", "detector"])["value"].to_dict() == pytest.approx(
        {
            ("upper", "mediapipe"): 0.75,
            ("lower", "mediapipe"): 0.5,
            ("lower", "openpose-mobilenet"): 0.5,
            ("upper", "openpose-mobilenet"): 0,
        }
    )


def test_intervals_hold_the_value_and_narrow_with_more_images():
    rng = np.random.default_rng(0)
    widths = []
    for n in (20, 180):
        points = make_points(rng.normal(0, 0.03, (n, 3)), ["left_wrist", "right_wrist"])
        table = within_distance(LiftedViews(points, alone(upper=n)), thresholds_m=[0.05], draws=Draws(300))
        row = table.set_index("part").loc["left wrist"]
        assert row["low"] < row["value"] < row["high"]
        widths.append(row["high"] - row["low"])
    assert 2 < widths[0] / widths[1] < 4.5  # theory: 3


def test_nothing_found_is_a_share_of_zero_and_no_distance():
    points = make_points([NONE] * 3, ["left_wrist"])
    assert (within_distance(LiftedViews(points, alone(upper=3)), draws=Draws(5))["value"] == 0).all()
    distances = spread_and_bias(LiftedViews(points, alone(upper=3), {"upper": make_truth(3)}), draws=Draws(5))
    assert (distances["n_images"] == 0).all() and distances[["spread_m", "bias_m", "error_m"]].isna().all(
        axis=None
    )


def test_parts_name_every_keypoint_once():
    assert len(KEYPOINTS) == len(set(KEYPOINTS)) == 6 + 42


def of_people(apart_m: float, n_people: int = 12, n: int = 10, seed: int = 0):
    """Points and subjects: every person is off by an offset of their own, and steady to a centimetre."""
    rng, people = np.random.default_rng(seed), np.repeat(np.arange(n_people), n)
    offsets_m = apart_m * rng.normal(size=(n_people, 3))[people] + 0.01 * rng.normal(size=(len(people), 3))
    return make_points(offsets_m, ["left_wrist"], subjects=people), {"upper": people}


def test_everybody_is_held_against_a_median_of_their_own():
    points, people = of_people(apart_m=0.2)
    medians = median_positions(points).set_index("subject")
    assert len(medians) == 12 and (medians["n"] == 10).all()
    n = len(people["upper"])
    stable = within_distance(LiftedViews(points, people), draws=Draws(0)).query("part == 'left wrist'")
    assert (stable["value"] > 0.85).all() and (stable["n_people"] == 12).all()
    truth = {"upper": make_truth(n)}
    row = (
        spread_and_bias(LiftedViews(points, people, truth), draws=Draws(0))
        .set_index("part")
        .loc["left wrist"]
    )
    assert row["spread_m"] < 0.02 and row["bias_m"] > 0.2 and row["n_people"] == 12
    # The same frames as if of one person: nothing is steady.
    as_one = within_distance(LiftedViews(points, alone(upper=n)), draws=Draws(0)).query(
        "part == 'left wrist'"
    )
    assert as_one["value"].max() < 0.2


def test_intervals_are_over_people_and_of_a_person_as_if_alone():
    points, people = of_people(apart_m=0.05)
    truth = {"upper": make_truth(120)}
    over_people = within_distance(LiftedViews(points, people, truth), [0.1], draws=Draws(400)).set_index(
        "part"
    )
    over_frames = within_distance(
        LiftedViews(points, alone(upper=120), truth), [0.1], draws=Draws(400)
    ).set_index("part")
    wide, narrow = (table.loc["left wrist", "high"] - table.loc["left wrist", "low"]
                    for table in (over_people, over_frames))  # fmt: skip
    assert wide > 2 * narrow
    first = points[points["subject"] == 0]
    for reference in (None, {"upper": make_truth(10)}):
        tables = [within_distance(LiftedViews(first, {"upper": whose}, reference), draws=Draws(50))
                  for whose in (np.zeros(10, int), np.full(10, 7))]  # fmt: skip
        pd.testing.assert_frame_equal(*tables)
        assert tables[0]["low"].notna().all()


def test_somebody_who_is_never_found_counts_as_not_within_and_has_no_bias():
    points, people = of_people(apart_m=0.05, n_people=11)
    people = {"upper": np.r_[people["upper"], np.full(10, 11)]}
    truth = {"upper": make_truth(120)}
    shares = (
        within_distance(LiftedViews(points, people), [0.1], draws=Draws(100))
        .set_index("part")
        .loc["left wrist"]
    )
    assert shares["value"] == pytest.approx(11 / 12) and shares["n_people"] == 12
    row = (
        spread_and_bias(LiftedViews(points, people, truth), draws=Draws(100))
        .set_index("part")
        .loc["left wrist"]
    )
    without = spread_and_bias(
        LiftedViews(points, {"upper": people["upper"][:110]}, {"upper": make_truth(110)}), draws=Draws(0)
    )
    assert row["bias_m"] == without.set_index("part").loc["left wrist", "bias_m"]
    assert row["bias_m_low"] < row["bias_m"] < row["bias_m_high"]


def test_a_person_found_once_has_no_spread():
    """One of two people is found once: a distance of 0 to a median of one would pull the spread down."""
    people = {"upper": np.repeat([0, 1], 6)}
    offsets = [*along_x(0, 0.02, 0.04, 0.06, 0.08, 0.1), [0.5, 0, 0], *[NONE] * 5]
    points = make_points(offsets, ["left_wrist"], subjects=people["upper"])
    row = spread_and_bias(LiftedViews(points, people, {"upper": make_truth(12)}), draws=Draws(0)).set_index(
        "part"
    )
    alone_m = [0.05, 0.03, 0.01, 0.01, 0.03, 0.05]
    assert row.loc["left wrist", "spread_m"] == pytest.approx(np.median(alone_m))
    assert row.loc["left wrist", "bias_m"] == pytest.approx(0.05)
    assert row.loc["left wrist", "n_people"] == 1


@pytest.mark.parametrize("n_found, known", [(1, False), (9, False), (10, True)])
def test_intervals_of_distances_need_ten_people_in_whom_it_is_found(n_found, known):
    points, people = of_people(apart_m=0.05)
    points.loc[points["subject"] >= n_found, ["x_m", "y_m", "z_m"]] = np.nan
    table = spread_and_bias(LiftedViews(points, people, {"upper": make_truth(120)}), draws=Draws(200))
    row = table.set_index("part").loc["left wrist"]
    assert row["n_people"] == n_found and row[["spread_m", "bias_m", "error_m"]].notna().all()
    for name in ("spread_m", "bias_m", "error_m"):
        assert (row[f"{name}_low"] == row[f"{name}_low"]) == known
    alone = spread_and_bias(
        LiftedViews(points[points["frame"] < 10], {"upper": np.zeros(10, int)}), draws=Draws(200)
    )
    assert alone.set_index("part").loc["left wrist", "spread_m_low"] > 0


def test_a_share_of_all_or_none_is_not_certain():
    shares = within_distance(LiftedViews(*of_people(0.0)), [0.0, 9.0], Draws(50))
    shares = shares[shares["part"] == "left wrist"]
    shares = shares.groupby("threshold_m")[["value", "low", "high"]].first()
    assert shares.loc[9.0].tolist() == pytest.approx([1, 0.025 ** (1 / 12), 1])
    assert shares.loc[0.0].tolist() == pytest.approx([0, 0, 1 - 0.025 ** (1 / 12)])
