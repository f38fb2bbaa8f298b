"""Detectors side by side: what is compared, on whom, and what resampling draws together."""

from dataclasses import replace

import numpy as np
import pytest

from hicp_lib.evaluation.ap import metric_table as module
from hicp_lib.evaluation.ap.evaluate import evaluate
from hicp_lib.evaluation.ap.metric_table import (
    compare,
    draw_cases,
    head_loss,
    metric_table,
    pairs,
    people_oks,
    same_people,
)
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.formats.annotations import source_images
from tests.evaluation.made_people import make_annotations, make_detections

N = 60


@pytest.fixture
def study():
    """Basic has 60 people, Headless the first 40 of them; a detector that is right in Basic only."""
    rng = np.random.default_rng(3)
    points = rng.uniform(50, 400, (N, 136, 2))
    extras = [{"source_image_id": i // 3} for i in range(N)]
    basic = make_annotations(points, range(N), extras=extras)
    headless = basic.of_images(range(40))
    exact = {i: make_detections(points[i]) for i in range(N)}
    lost = {i: make_detections(points[i] + 200.0 * (i % 2), [1.0 - i % 2 / 2]) for i in range(40)}
    found = {("basic", "mediapipe"): exact, ("headless", "mediapipe"): lost}
    return {"basic": basic, "headless": headless}, found


def test_every_case_has_the_figures_of_a_plain_evaluation(study):
    truth, found = study
    table = compare(truth, found, draws=Draws(20))
    for (subset, group), rows in table.groupby(["subset", "group"]):
        alone = evaluate(truth[subset], found[subset, "mediapipe"], group)
        assert rows.set_index("metric")["value"].to_dict() == alone.metrics()
        assert (rows["low"] <= rows["value"]).all() and (rows["value"] <= rows["high"]).all()
    assert set(table["group"]) == {"body", "hand"}


def test_a_detector_is_not_compared_on_a_group_it_does_not_give(study):
    truth, found = study
    bodies = {("basic", "openpose-mobilenet"): found["basic", "mediapipe"]}
    assert set(compare(truth, bodies, draws=Draws(2))["group"]) == {"body"}
    assert set(people_oks(truth, bodies)["group"]) == {"body"}


def test_the_loss_is_taken_on_the_people_in_both(study):
    truth, found = study
    drawn = draw_cases(*same_people(truth, found), draws=Draws(50))
    row = head_loss(drawn).set_index("group").loc["body"]
    assert row["n_people"] == 40
    assert row["basic"] == pytest.approx(1.0) and row["headless"] == pytest.approx(0.5, abs=0.06)
    assert row["change"] == pytest.approx(row["headless"] - row["basic"])
    assert row["low"] < row["change"] < row["high"] < 0


def test_the_same_people_are_drawn_with_and_without_the_head(study):
    truth, found = study
    people, seen = same_people(truth | {"whole images": truth["basic"]}, found)
    assert {s: len(of.images) for s, of in people.items()} == {
        "basic": 40,
        "headless": 40,
        "whole images": 60,
    }
    assert set(seen["basic", "mediapipe"]) == set(range(40))
    drawn = draw_cases(people, {("basic", "a"): seen["basic", "mediapipe"],
                                ("headless", "a"): seen["basic", "mediapipe"]}, Draws(20))  # fmt: skip
    with_head, without = (drawn[subset, "a", "body"][1] for subset in ("basic", "headless"))
    assert all(np.array_equal(with_head[metric], without[metric]) for metric in with_head)


def test_crops_of_one_image_are_drawn_together(study, monkeypatch):
    truth, found = study
    drawn, plain = [], module.resample
    monkeypatch.setattr(module, "resample", lambda *given: drawn.append(given[-1]) or plain(*given))
    compare(truth, found, draws=Draws(2))
    assert drawn[0] == {i: i // 3 for i in range(N)}


def test_two_detectors_are_compared_on_the_same_draws(study):
    """The better one finds 3 of 60 more: sure of them side by side, lost in two intervals of their own."""
    truth, _ = study
    points = truth["basic"].keypoints_px
    most = {i: make_detections(points[i]) for i in range(N) if i % 2}
    more = most | {i: make_detections(points[i]) for i in (0, 18, 36)}
    drawn = draw_cases(truth, {("basic", "mediapipe"): more, ("basic", "mmpose"): most}, Draws(200))
    table = pairs(drawn).query("group == 'body' and metric == 'AR'").set_index("detector")
    gain = table.loc["mediapipe"]
    assert (gain["other"], gain["pair"]) == ("mmpose", "mediapipe less mmpose")
    assert gain["value"] == pytest.approx(3 / 60) and 0 <= gain["low"] < gain["value"] < gain["high"] < 0.12
    back = table.loc["mmpose", ["value", "low", "high"]].astype(float)
    assert back.tolist() == pytest.approx((-gain[["value", "high", "low"]].astype(float)).tolist())
    alone = metric_table(drawn).query("group == 'body' and metric == 'AR'").set_index("detector")
    assert alone.loc["mediapipe", "low"] < alone.loc["mmpose", "high"]


def test_one_detector_makes_no_pair(study):
    assert pairs(draw_cases(*study, draws=Draws(2))).empty


def test_images_without_a_source_stand_for_themselves(study):
    truth, _ = study
    without = replace(truth["basic"], extras=[{} for _ in range(N)])
    assert source_images(without) == {i: i for i in range(N)}
