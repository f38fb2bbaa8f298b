"""Whose fault: shares that sum to what is lost, each where it was made."""

import numpy as np
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.evaluation.ap.loss_shares import SHARES, box_variants, loss_shares
from hicp_lib.evaluation.ap.metric_table import draw_cases, same_people
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
    return draw_cases(*same_people(truth, found), 200, groups=["body"])


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
    table = loss_shares(draw_cases({"basic": people, "headless": people}, given, 50, groups=["body"]), *PAIR)
    assert table["value"].notna().all() and table["low"].isna().all()
