"""Hands found, one by one, and set in proportion to a baseline."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.keypoints import LEFT_HAND, RIGHT_HAND
from hicp_lib.evaluation.ap import hands
from hicp_lib.evaluation.ap.evaluate import evaluate
from hicp_lib.evaluation.ap.hands import INGREDIENTS, compare_hands, hand_oks
from tests.evaluation.made_people import make_annotations, make_detections

N = 12
POINTS = np.random.default_rng(1).uniform(50, 400, (N, 136, 2))


def detections(left, right=()):
    """Everybody's body; exact left and right hands for some people only."""
    points = POINTS.copy()
    for hand, who in ((LEFT_HAND, left), (RIGHT_HAND, right)):
        points[np.ix_(np.setdiff1d(np.arange(N), list(who)), hand)] = np.nan
    return {i: make_detections(points[i : i + 1]) for i in range(N)}


def test_each_labelled_hand_is_judged_by_itself():
    visibility = np.full((N, 136), 2.0)
    visibility[3, LEFT_HAND] = 0
    people = make_annotations(POINTS, range(N), visibility=visibility)
    table = hand_oks(people, detections(left=range(6), right=[0]))
    assert len(table) == 2 * N - 1
    found = table[table["oks"] > 0.5]
    assert sorted(found.loc[found["side"] == "left", "image_id"]) == [0, 1, 2, 4, 5]
    assert found.loc[found["side"] == "right", "image_id"].tolist() == [0]


def test_a_hand_on_the_wrong_side_is_not_found():
    points = POINTS.copy()
    points[:, LEFT_HAND], points[:, RIGHT_HAND] = POINTS[:, RIGHT_HAND], POINTS[:, LEFT_HAND]
    people = make_annotations(POINTS, range(N))
    table = hand_oks(people, {i: make_detections(points[i : i + 1]) for i in range(N)})
    assert table["oks"].max() < 0.1


def test_crowds_and_others_have_no_hands_to_find():
    people = make_annotations(POINTS, range(N), crowd=[0], extras=[{"other": i == 1} for i in range(N)])
    assert set(hand_oks(people, {})["image_id"]) == set(range(2, N))
    assert hand_oks(people, {})["oks"].eq(0).all()


def test_shares_and_ratios_with_intervals_around_them():
    people = make_annotations(POINTS, range(N))
    found = {("basic", "few"): detections(range(4)), ("basic", "many"): detections(range(8), range(2))}
    table = compare_hands({"basic": people}, found, "few", n_resamples=200).set_index("variant")
    assert table.loc["many", ["n_hands", "n_found"]].tolist() == [24, 10]
    assert table.loc["many", "share"] == pytest.approx(10 / 24)
    assert table.loc["many", "ratio"] == pytest.approx(2.5)
    assert table.loc["few", ["ratio", "ratio_low", "ratio_high"]].tolist() == [1, 1, 1]
    low, high = table.loc["many", ["ratio_low", "ratio_high"]]
    assert 1 < low < 2.5 < high
    assert table.loc["many", "AP"] == evaluate(people, found["basic", "many"], "hand").AP


def test_against_a_baseline_that_finds_nothing_there_is_no_ratio():
    people = make_annotations(POINTS, range(N))
    found = {("basic", "none"): {}, ("basic", "many"): detections(range(8))}
    table = compare_hands({"basic": people}, found, "none", n_resamples=20)
    assert table["ratio"].isna().all() and table["share"].tolist() == [0, pytest.approx(8 / 24)]


def test_the_last_ingredient_is_the_combination_as_it_is():
    assert list(INGREDIENTS.values())[-1] == {}


def test_a_hand_is_found_above_one_half(monkeypatch):
    people = make_annotations(POINTS, range(N))
    halves = {"image_id": range(N), "annotation_id": range(1, N + 1), "side": "left"}
    for oks, found in ((0.5, 0), (np.nextafter(0.5, 1), N)):
        monkeypatch.setattr(hands, "hand_oks", lambda *_, oks=oks: pd.DataFrame(halves | {"oks": oks}))
        table = compare_hands({"basic": people}, {("basic", "d"): detections(range(4))}, "d", n_resamples=5)
        assert table["n_found"].tolist() == [found] and table["n_hands"].tolist() == [N]
