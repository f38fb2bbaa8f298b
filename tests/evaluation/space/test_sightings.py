"""In which images parts are found, and near: shares, and differences on the same images."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.evaluation.space.sightings import ALL_PARTS, FOUND, NEAR_MEDIAN, NEAR_TRUTH, ROW, sightings
from hicp_lib.evaluation.space.stability import LiftedViews
from hicp_lib.evaluation.statistics.proportions import paired_differences, proportions
from tests.evaluation.still_person import alone, make_points, make_truth

NONE = [np.nan] * 3


def of(rows, part, measure, detector="mediapipe"):
    chosen = (rows["part"] == part) & (rows["measure"] == measure) & (rows["detector"] == detector)
    return rows[chosen].sort_values("source_image")["value"].tolist()


def test_an_arm_is_found_with_any_of_its_joints_and_a_hand_with_any_keypoint():
    points = pd.concat(
        [
            make_points([[0, 0, 0], NONE, NONE], ["left_elbow"]),
            make_points([NONE, [0, 0, 0], NONE], ["right_wrist"]),
            make_points([NONE, NONE, [0, 0, 0]], ["left_index_4"]),
        ]
    )
    rows = sightings(LiftedViews(points, alone(upper=4)))
    assert of(rows, "left arm", FOUND) == [1, 0, 0, 0] and of(rows, "right arm", FOUND) == [0, 1, 0, 0]
    assert of(rows, "any arm joint", FOUND) == [1, 1, 0, 0]
    assert of(rows, "left hand", FOUND) == of(rows, "any hand", FOUND) == [0, 0, 1, 0]
    assert of(rows, "right hand", FOUND) == [0, 0, 0, 0]
    assert set(rows["part"]) == set(ALL_PARTS) and not rows["measure"].eq(NEAR_TRUTH).any()


def test_near_is_within_5_cm_of_the_median_or_of_the_truth():
    points = make_points([[0.06, 0, 0]] * 4 + [[0.06, 0.06, 0], NONE], ["left_wrist"])
    rows = sightings(LiftedViews(points, alone(upper=6), {"upper": make_truth(6)}))
    assert of(rows, "left wrist", NEAR_MEDIAN) == [1, 1, 1, 1, 0, 0]
    assert of(rows, "left wrist", NEAR_TRUTH) == [0] * 6
    assert of(rows, "left arm", NEAR_MEDIAN) == pytest.approx([1 / 2] * 4 + [0, 0])


def test_a_detector_that_finds_nobody_in_a_view_is_compared_all_the_same():
    seen, blind = make_points([[0, 0, 0]] * 12), make_points([[0, 0, 0]], view="lower", detector="mine")
    n = alone(upper=12, lower=12)
    rows = sightings(LiftedViews(pd.concat([seen, blind]), n))
    shares = proportions(rows, ROW, "value").set_index(ROW)["value"]
    assert shares["upper", "mine", "robust", "left wrist", FOUND] == 0
    pairs = paired_differences(rows, ["view", "part", "measure"], "detector", "value").set_index(
        ["view", "part", "measure", "pair"]
    )
    row = pairs.loc["upper", "left wrist", FOUND, "mediapipe less mine"]
    assert row["value"] == row["low"] == row["high"] == 1 and row["n_images"] == 12
    assert pairs.loc["lower", "left wrist", FOUND, "mediapipe less mine"]["value"] == pytest.approx(-1 / 12)


def test_near_the_median_is_near_everybodys_own():
    people = np.repeat([0, 1], 3)
    points = make_points([[0, 0, 0]] * 3 + [[0.2, 0, 0]] * 2 + [NONE], ["left_wrist"], subjects=people)
    rows = sightings(LiftedViews(points, {"upper": people}))
    assert of(rows, "left wrist", NEAR_MEDIAN) == [1, 1, 1, 1, 1, 0]
    row = (
        proportions(rows, ROW, "value")
        .set_index(ROW)
        .loc["upper", "mediapipe", "robust", "left wrist", FOUND]
    )
    assert (row["value"], row["n_images"], row["n_people"]) == (5 / 6, 6, 2)
