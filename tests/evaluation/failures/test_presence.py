"""Declared present by calibrated scores, and parts of people that are invented."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import COCO_17, HEAD, N_KEYPOINTS
from hicp_lib.evaluation.ap.metric_table import draw_cases
from hicp_lib.evaluation.calibration.curves import split_half
from hicp_lib.evaluation.failures.placed_keypoints import placed_keypoints
from hicp_lib.evaluation.failures.presence import (
    DECISIONS,
    MEASURES,
    declared,
    extended_table,
    false_presence,
    fit_presence,
)
from hicp_lib.evaluation.statistics.resampling import Draws
from tests.evaluation.made_people import CROP, POINTS, make_annotations

N_PEOPLE = 40
NAME = "movenet-thunder"


def study(head_score, invents):
    """Everybody in Headless, and a detection that is right below the head.

    Of those whom `invents` says so, the head is put into the picture, with a score of `head_score`.
    """
    source = make_annotations(np.repeat(POINTS[None], N_PEOPLE, 0), range(N_PEOPLE), first_id=0)
    flags = np.full((N_PEOPLE, N_KEYPOINTS), 2.0)
    flags[:, HEAD] = 0
    about = [
        {"source_id": i, "source_image_id": i, "crop_px": CROP, "cut_side": "top"} for i in range(N_PEOPLE)
    ]
    seen = POINTS - CROP[:2]
    people = make_annotations(
        np.repeat(seen[None], N_PEOPLE, 0), range(N_PEOPLE), visibility=flags, extras=about
    )
    run = {}
    for i in range(N_PEOPLE):
        points, scores = seen.copy(), np.full(N_KEYPOINTS, 0.9)
        points[17:], scores[17:] = np.nan, 0
        if invents(i):
            points[:5], scores[:5] = [320.0, 240.0], head_score
        run[i] = Detections(points[None], scores[None], np.ones(1))
    return {"headless": people}, {("headless", NAME): run}, source


def test_nobody_is_judged_by_a_curve_fitted_to_them():
    rows = pd.DataFrame({"source_image": range(N_PEOPLE), "detector": "a", "keypoint": 9, "score": 0.5})
    rows = rows.assign(given=True, x=0.5, y=0.5, state="visible")
    in_first_half = split_half(rows["source_image"])
    presence = fit_presence(rows.assign(state=np.where(in_first_half, "visible", "outside")))
    assert in_first_half.sum() == N_PEOPLE / 2
    for image in range(N_PEOPLE):
        worth = presence("a", image, np.full(17, 0.5))
        assert worth[9] == (not in_first_half[image])
        assert (np.delete(worth, [9, 10]) == 0.5).all()  # no curve: as it was


def test_a_keypoint_outside_the_picture_declares_itself_absent():
    truth, found, _ = study(0.8, lambda i: i == 0)
    raw, sure = (
        declared(truth, found, presence)["headless", NAME]
        for presence in (None, lambda detector, source, scores: np.full_like(scores, 0.7))
    )
    assert raw[0].scores[0, :6].tolist() == [1] * 6 and (raw[1].scores[0, :5] == 0).all()
    assert sure[0].scores[0, COCO_17].tolist() == [0.7] * 17 and (sure[1].scores[0, :5] == 0).all()
    assert (found["headless", NAME][1].scores[0, :5] == 0.9).all()  # what was found stays


def test_extended_ap_falls_with_invented_heads_and_the_decision_brings_it_back():
    truth, found, source = study(0.8, lambda i: True)
    drawn = draw_cases(truth, found, Draws(20))
    table = extended_table(truth, found, source, drawn, Draws(20)).set_index("measure")
    assert list(table.index) == list(MEASURES) and (table["n_people"] == N_PEOPLE).all()
    plain, given, decided, gained = table["value"]
    assert plain == decided == pytest.approx(1) and given < 0.7
    assert gained == pytest.approx(decided - given)
    assert table["low"].notna().all()


def test_of_crops_that_name_no_source_nothing_is_known_outside():
    truth, found, source = study(0.8, lambda i: False)
    whole = replace(truth["headless"], extras=[{} for _ in range(N_PEOPLE)])
    placed = placed_keypoints({"headless": whole}, found, source)
    assert set(placed["state"]) == {"visible", "unknown"}


def shares(truth, found, source, **options):
    table = false_presence(truth, found, placed_keypoints(truth, found, source), source, **options)
    assert set(table["part"]) == {"head"} and (table["n"] == N_PEOPLE).all()
    return table.set_index("decision")


def test_heads_put_into_the_picture_are_invented_and_those_beyond_it_are_not():
    table = shares(*study(0.8, lambda i: i % 4 == 0), draws=Draws(50))
    assert table.loc[DECISIONS[0], "value"] == 0.25
    assert table.loc[DECISIONS[0], "low"] < 0.25 < table.loc[DECISIONS[0], "high"]
    assert (table["n_found"] == N_PEOPLE).all()


def test_a_score_below_the_threshold_invents_nothing_and_none_seen_is_not_never():
    row = shares(*study(0.2, lambda i: True), draws=Draws(50)).loc[DECISIONS[0]]
    assert (row["value"], row["low"]) == (0, 0) and row["high"] == pytest.approx(1 - 0.025 ** (1 / N_PEOPLE))


def test_calibrated_scores_know_that_a_head_is_never_there_where_it_never_is():
    assert shares(*study(0.8, lambda i: True)).loc[DECISIONS[1], "value"] == 0


def test_one_keypoint_makes_a_head():
    truth, found, source = study(0.8, lambda i: False)
    for people in found["headless", NAME].values():
        people.keypoints_px[0, 3] = 320, 240
    assert shares(truth, found, source).loc[DECISIONS[0], "value"] == 1


def test_somebody_who_is_not_found_counts_and_is_made_up_nothing_for():
    truth, found, source = study(0.8, lambda i: True)
    found["headless", NAME] |= {i: Detections.none() for i in range(30)}
    row = shares(truth, found, source).loc[DECISIONS[0]]
    assert row["value"] == 0.25 and row["n_found"] == 10
