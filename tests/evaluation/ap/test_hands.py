"""Hands found, one by one, and set in proportion to a baseline."""

import re
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.keypoints import LEFT_HAND, RIGHT_HAND
from hicp_lib.detectors.registry import make_detector
from hicp_lib.evaluation.ap import hands
from hicp_lib.evaluation.ap.evaluate import evaluate
from hicp_lib.evaluation.ap.hands import INGREDIENTS, compare_hands, thresholds
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.report.notebooks import read_notebooks
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
    some = {("basic", "d"): detections(left=range(6), right=[0])}
    row = compare_hands({"basic": people}, some, some, draws=Draws(5)).iloc[0]
    assert (row["n_hands"], row["n_found"]) == (2 * N - 1, 6)  # of the left ones not the fourth


def test_a_hand_on_the_wrong_side_is_not_found():
    points = POINTS.copy()
    points[:, LEFT_HAND], points[:, RIGHT_HAND] = POINTS[:, RIGHT_HAND], POINTS[:, LEFT_HAND]
    swapped = {("basic", "d"): {i: make_detections(points[i : i + 1]) for i in range(N)}}
    people = {"basic": make_annotations(POINTS, range(N))}
    assert compare_hands(people, swapped, swapped, draws=Draws(5))["n_found"].item() == 0


def test_crowds_have_no_hands_to_find():
    people = make_annotations(POINTS, range(N), crowd=[0, 1])
    everybody = {("basic", "d"): detections(range(N), range(N))}
    row = compare_hands({"basic": people}, everybody, everybody, draws=Draws(5)).iloc[0]
    assert (row["n_hands"], row["n_found"]) == (2 * N - 4, 2 * N - 4)


def test_shares_and_ratios_with_intervals_around_them():
    people = make_annotations(POINTS, range(N))
    found = {("basic", "few"): detections(range(4)), ("basic", "many"): detections(range(8), range(2))}
    few = {("basic", "few"): found["basic", "few"]}
    table = compare_hands({"basic": people}, found, few, draws=Draws(200)).set_index("variant")
    assert table.loc["many", ["n_hands", "n_found"]].tolist() == [24, 10]
    assert table.loc["many", "share"] == pytest.approx(10 / 24)
    assert table.loc["many", "ratio"] == pytest.approx(2.5)
    assert table.loc["few", ["ratio", "ratio_low", "ratio_high"]].tolist() == [1, 1, 1]
    low, high = table.loc["many", ["ratio_low", "ratio_high"]]
    assert 1 < low < 2.5 < high
    ap = [evaluate(people, found["basic", variant], "hand").AP for variant in ("few", "many")]
    assert table["AP"].tolist() == ap
    assert np.isnan(table.loc["few", "step"]) and table.loc["many", "step"] == pytest.approx(ap[1] - ap[0])
    low, high = table.loc["many", ["step_low", "step_high"]]
    assert low < ap[1] - ap[0] < high


def test_against_a_baseline_that_finds_nothing_there_is_no_ratio():
    people = make_annotations(POINTS, range(N))
    found = {("basic", "none"): {}, ("basic", "many"): detections(range(8))}
    table = compare_hands({"basic": people}, found, {("basic", "none"): {}}, draws=Draws(20))
    assert table["ratio"].isna().all() and table["share"].tolist() == [0, pytest.approx(8 / 24)]


def test_steps_change_one_thing_at_a_time_and_end_at_the_default():
    """The first is the plain form: MediaPipe's own thresholds, and nothing of the rules."""
    steps = [made(options) for options in INGREDIENTS.values()]
    assert steps[0]["looks"] == ["image"] and not steps[0]["arbitrate"]
    assert steps[0]["hands"] == make_detector("mediapipe-hands").settings | {"name": "mediapipe-hands"}
    for before, after in pairwise(steps):
        changed = {key for key in before if before[key] != after[key]}
        assert len(changed) == 1, changed
    assert steps[-1] == made({})


def test_no_threshold_was_chosen_on_what_a_notebook_evaluates():
    table = thresholds().set_index("threshold")
    rules = {*made({})["squares"], *made({})["rule"]}
    assert set(table.index) == rules | {"hands_num_hands", "hands_min_score", "min_side_px", "looks"}
    seeds = {int(seed) for chosen in table["chosen"] for seed in re.findall(r"seed (\d+)", chosen)}
    evaluated = {notebook.defaults.get("seed") for notebook in read_notebooks(CHECKOUT / "notebooks")}
    assert seeds and 0 in evaluated and not seeds & evaluated


def made(options: dict) -> dict:
    return make_detector("combined:mediapipe-pose+mediapipe-hands", **options).settings


def test_a_hand_is_found_above_one_half(monkeypatch):
    people = make_annotations(POINTS, range(N))
    halves = {"image_id": range(N), "annotation_id": range(1, N + 1)}
    for oks, found in ((0.5, 0), (np.nextafter(0.5, 1), N)):
        monkeypatch.setattr(
            hands, "person_oks", lambda *_, oks=oks, **__: pd.DataFrame(halves | {"oks": oks})
        )
        some = {("basic", "d"): detections(range(4))}
        table = compare_hands({"basic": people}, some, some, draws=Draws(5))
        assert table["n_found"].tolist() == [found] and table["n_hands"].tolist() == [N]
