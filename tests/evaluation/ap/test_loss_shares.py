"""Whose fault: shares that sum to what is lost, each where it was made."""

from dataclasses import replace

import numpy as np
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import HEAD
from hicp_lib.evaluation.ap.loss_shares import (
    HEAD_SHARES,
    SHARES,
    box_variants,
    head_loss_shares,
    loss_shares,
)
from hicp_lib.evaluation.ap.metric_table import draw_cases, head_loss, same_people
from hicp_lib.evaluation.statistics.resampling import Draws
from tests.evaluation.made_people import make_annotations, make_detections

N = 40
PAIR = ("movenet-lightning", "movenet-multipose")
WHOLE, FOUND_BOXES, TRUE_BOXES, BOTTOM_UP = box_variants(*PAIR)


@pytest.fixture
def drawn():
    """True boxes lose 4 people of 40 and 8 without the head, found ones 4 more; bottom-up none, then 20."""
    points = np.random.default_rng(3).uniform(50, 400, (N, 136, 2))
    basic = make_annotations(points, range(N), extras=[{"source_image_id": i} for i in range(N)])
    truth = {"whole images": basic, "basic": basic, "headless": basic.of_images(range(N))}
    lost = {
        ("basic", WHOLE): 4, ("basic", TRUE_BOXES): 4, ("basic", FOUND_BOXES): 8, ("basic", BOTTOM_UP): 0,
        ("headless", WHOLE): 8, ("headless", TRUE_BOXES): 8, ("headless", FOUND_BOXES): 12,
        ("headless", BOTTOM_UP): 20,
    }  # fmt: skip
    lost |= {("whole images", label): n for (s, label), n in lost.items() if s == "basic"}
    found = {
        case: {i: Detections.none() if i < n else make_detections(points[i]) for i in range(N)}
        for case, n in lost.items()
    }
    return draw_cases(*same_people(truth, found), Draws(200), groups=["body"])


def test_each_share_is_what_is_lost_where_it_was_made(drawn):
    table = loss_shares(drawn, *PAIR).set_index(["subset", "detector", "share"])
    shares = table["value"].round(2).to_dict()
    for subset in ("whole images", "basic"):
        assert shares[subset, FOUND_BOXES, "network"] == pytest.approx(0.1, abs=0.011)
        assert shares[subset, FOUND_BOXES, "person finder"] == pytest.approx(0.1, abs=0.011)
        assert (subset, FOUND_BOXES, "missing head") not in shares
    assert shares["headless", FOUND_BOXES, "missing head"] == pytest.approx(0.1, abs=0.011)
    assert shares["headless", BOTTOM_UP, "missing head"] == pytest.approx(0.5, abs=0.011)
    assert shares["headless", "movenet-multipose less movenet-lightning", "missing head"] == pytest.approx(
        0.4, abs=0.021
    )
    assert not any(share == "person finder" for _, detector, share in shares if detector == BOTTOM_UP)
    assert (table["low"] <= table["value"]).all() and (table["value"] <= table["high"]).all()


def test_the_shares_sum_to_all_that_is_lost(drawn):
    table = loss_shares(drawn, *PAIR)
    for case in (("headless", FOUND_BOXES), ("headless", BOTTOM_UP), ("basic", FOUND_BOXES)):
        rows = table[(table["subset"] == case[0]) & (table["detector"] == case[1])]
        assert set(rows["share"]) <= set(SHARES)
        assert rows["value"].sum() == pytest.approx(1 - drawn[*case, "body"][0].AP)


def test_what_the_head_costs_is_taken_on_the_same_draws(drawn):
    """Who is lost without the head differs from draw to draw less than two intervals apart would say."""
    table = loss_shares(drawn, *PAIR).set_index(["subset", "detector", "share"])
    row = table.loc["headless", FOUND_BOXES, "missing head"]
    of_basic, of_headless = (drawn[s, TRUE_BOXES, "body"][1]["AP"] for s in ("basic", "headless"))
    apart = np.hypot(of_basic.std(), of_headless.std())
    assert row["high"] - row["low"] < 3 * apart and (of_basic >= of_headless).all()


def test_a_run_too_small_for_intervals_has_shares():
    points = np.random.default_rng(3).uniform(50, 400, (4, 136, 2))
    people = make_annotations(points, range(4))
    found = {(s, label): {} for s in ("basic", "headless") for label in (*box_variants(*PAIR),)}
    given = {case: {0: make_detections(points[0])} for case in found}
    table = loss_shares(
        draw_cases({"basic": people, "headless": people}, given, Draws(50), groups=["body"]), *PAIR
    )
    assert table["value"].notna().all() and table["low"].isna().all()


POINTS = np.random.default_rng(5).uniform(50, 400, (N, 136, 2))


def head_shares(basic, headless, headless_area_px2=20_000.0) -> dict[str, float]:
    """Of one detector, from what it finds of the same people with and without their heads."""
    flags = np.full((N, 136), 2.0)
    flags[:, HEAD] = 0
    extras = [{"source_image_id": i, "source_area": 20_000.0} for i in range(N)]
    truth = {
        "basic": make_annotations(POINTS, range(N), extras=extras),
        "headless": make_annotations(
            POINTS, range(N), visibility=flags, areas_px2=headless_area_px2, extras=extras
        ),
    }
    found = {("basic", "mediapipe-pose"): basic, ("headless", "mediapipe-pose"): headless}
    drawn = draw_cases(truth, found, Draws(50))
    table = head_loss_shares(truth, found, drawn, Draws(50)).set_index(["group", "share"])
    assert ((table["low"] <= table["value"] + 1e-12) & (table["value"] <= table["high"] + 1e-12)).all()
    shares = table.loc["body", "value"].to_dict()
    assert list(shares) == ["total", *HEAD_SHARES]
    assert sum(shares[name] for name in HEAD_SHARES) == pytest.approx(shares["total"])
    assert shares["total"] == pytest.approx(-head_loss(drawn)["change"].item())
    return {name: round(value, 6) for name, value in shares.items()}


def off_by(px, n=N, scores=None):
    return {i: make_detections(POINTS[i] + [px, 0], scores and [scores[i]]) for i in range(n)}


def test_the_same_errors_on_a_smaller_person_are_the_areas_share():
    shares = head_shares(off_by(8), off_by(8), headless_area_px2=10_000.0)
    assert shares["area"] > 0.05
    assert shares["ranking"] == shares["detector"] == 0


def test_head_points_that_were_right_are_missed_in_the_score():
    points = POINTS + [15, 0]
    points[:, HEAD] = POINTS[:, HEAD]
    right = {i: make_detections(points[i]) for i in range(N)}
    shares = head_shares(right, right)
    assert shares["head points"] == shares["total"] > 0.05


def test_scores_of_the_head_that_put_the_wrong_ones_first_are_the_rankings_share():
    """One in four is wrong: with the head last, without it first; the keypoints' own scores do not change."""
    detections = {}
    for wrong_score in (0.1, 0.9):
        detections[wrong_score] = {}
        for i in range(N):
            wrong = i % 4 == 0
            one = make_detections(POINTS[i] + 5000.0 * wrong, [wrong_score if wrong else 0.5])
            detections[wrong_score][i] = replace(one, scores=np.full((1, 136), 0.5 - 0.1 * wrong))
    shares = head_shares(detections[0.1], detections[0.9])
    assert shares["ranking"] == shares["total"] > 0.1


def test_who_is_not_found_without_the_head_is_the_detectors_share():
    shares = head_shares(off_by(0), off_by(0, n=N // 2))
    assert shares["detector"] == shares["total"] > 0.4
