"""Verdicts on made-up results, among them results that must fail a claim."""

import math
from statistics import NormalDist

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hicp_lib.study.claims import verdicts as v
from hicp_lib.study.claims.selecting import Quantity
from hicp_lib.study.claims.statements import Comparison
from tests.study.claims.made_up import LOSES, NAMED, claim, of, rows, verdict

LOST, KEPT, OPEN = (-0.4, -0.5, -0.3), (0.2, 0.1, 0.3), (-0.2, -0.5, 0.1)
UNKNOWN = (-0.4, math.nan, math.nan)
NOTHING = (math.nan, math.nan, math.nan)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"mmpose": LOST, "alphapose": LOST}, v.REPRODUCED),
        ({"mmpose": LOST, "alphapose": KEPT}, v.NOT_REPRODUCED),
        ({"mmpose": OPEN, "alphapose": KEPT}, v.NOT_REPRODUCED),
        ({"mmpose": LOST, "alphapose": OPEN}, v.UNDECIDED),
        ({"mmpose": LOST, "alphapose": UNKNOWN}, v.UNDECIDED),
        ({"mmpose": LOST, "alphapose": NOTHING}, v.UNDECIDED),
        ({"mmpose": LOST, "posenet": LOST}, v.PARTLY),
        ({"mmpose": KEPT}, v.PARTLY),
        ({"posenet": LOST}, v.NOT_TESTABLE),
    ],
)
def test_every_row_must_hold_of_all_the_systems_a_claim_names(write, changes, expected):
    assert verdict(claim(NAMED), write(rows(**changes))).verdict == expected


def test_what_is_partly_tested_says_on_whom_and_what_came_out(write):
    found = verdict(claim(NAMED), write(rows(mmpose=LOST, posenet=KEPT)))
    assert found.reason == "no result of alphapose; what was tested is reproduced"
    assert found.ours == "mmpose -0.4 [-0.5, -0.3]"
    refuted = verdict(claim(NAMED), write(rows(mmpose=KEPT)))
    assert refuted.reason.endswith("what was tested is not reproduced")
    left_open = verdict(claim(NAMED, unit="AP"), write(rows(mmpose=OPEN)))
    assert "what was tested is undecided, the least difference that this run could" in left_open.reason


def test_every_detector_is_at_least_three_and_is_named(write):
    three = {"a": LOST, "b": LOST, "c": LOST}
    found = verdict(claim(LOSES), write(rows(**three)))
    assert found.verdict == v.REPRODUCED and found.ours.startswith("a -0.4 [-0.5, -0.3]; b -0.4")
    two = verdict(claim(LOSES), write(rows(a=LOST, b=LOST) + rows(**{"b-imported": LOST})))
    assert (two.verdict, two.reason) == (
        v.PARTLY,
        "only 2 of at least 3: a, b; what was tested is reproduced",
    )


def test_one_that_contradicts_what_is_said_of_every_detector_is_enough(write):
    found = verdict(claim(LOSES), write(rows(a=LOST, b=KEPT)))
    assert (found.verdict, found.reason) == (v.NOT_REPRODUCED, "only 2 of at least 3: a, b")


def test_a_combination_does_not_count_as_one_more_detector(write):
    results = write(rows(a=LOST, b=LOST) + rows(**{"combined:a+hands": KEPT}))
    assert verdict(claim(LOSES), results).reason.startswith("only 2 of at least 3: a, b;")


def test_the_others_of_a_pair_are_counted_too(write):
    pair = Comparison(">", of("mmpose"), 0.0)
    table = [row | {"other": other} for row in rows(mmpose=KEPT) for other in ("a", "b")]
    assert "only 2 of at least 3: a, b" in verdict(claim(pair), write(table)).reason
    table += [row | {"other": "c"} for row in rows(mmpose=KEPT)]
    assert verdict(claim(pair), write(table)).verdict == v.REPRODUCED


def test_undecided_tells_the_smallest_difference_the_run_could_have_seen(write):
    found = verdict(claim(Comparison("<", of("mmpose"), 0.0), unit="AP"), write(rows(mmpose=OPEN)))
    assert found.verdict == v.UNDECIDED
    assert found.reason == "the least difference that this run could have seen is 0.3 AP"
    unknown = verdict(claim(Comparison("<", of("mmpose"), 0.0)), write(rows(mmpose=UNKNOWN)))
    assert unknown.reason == "too few images for an interval, or nothing found"


def test_evidence_shows_what_decides_and_counts_the_rest(write):
    many = {f"d{k}": (-0.1 * k, -0.1 * k - 0.01, -0.1 * k + 0.01) for k in range(1, 10)}
    found = verdict(claim(LOSES, unit="AP"), write(rows(**many)))
    assert found.ours.startswith("d1 -0.1 [-0.11, -0.09]; d2 ") and found.ours.endswith(
        " AP; 3 numbers more; also tested on d7, d8, d9"
    )
    refuted = verdict(claim(LOSES), write(rows(**many | {"bad": KEPT})))
    assert refuted.ours.startswith("bad 0.2 [0.1, 0.3]; also tested on d1, d2")


def test_the_closest_call_is_the_one_whose_worse_end_is_nearest(write):
    table = rows(a=(-0.3, -0.35, -0.25), b=(-0.4, -0.8, -0.1))
    found = verdict(claim(Comparison("<", of("a", "b"), 0.0)), write(table))
    assert found.ours == "b -0.4 [-0.8, -0.1]; a -0.3 [-0.35, -0.25]"


def test_evidence_without_an_interval_has_no_brackets(write):
    made = claim(Comparison("<", of("mmpose"), 0.0), unit="AP")
    assert verdict(made, write(rows(mmpose=(-0.4, -0.4, -0.4)))).ours == "mmpose -0.4 AP"


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ({"source": "rendered"}, v.ON_RENDERED_DATA),
        ({"recording": ""}, v.ON_RENDERED_DATA),
        ({"recording": "mine"}, v.REPRODUCED),
        ({"source": "halpe"}, v.REPRODUCED),
        ({"source": "rendered", "recording": "mine"}, v.ON_RENDERED_DATA),
        ({"source": "halpe", "recording": ""}, v.ON_RENDERED_DATA),
        ({}, v.ON_RENDERED_DATA),
    ],
)
def test_rendered_data_qualify_the_verdict(write, parameters, expected):
    results = write(rows(mmpose=LOST, alphapose=LOST), parameters)
    assert verdict(claim(NAMED), results).verdict == expected


def test_both_sides_of_a_comparison_tell_what_the_data_were(write):
    write(rows(b=(0.4, 0.3, 0.5)), {"source": "rendered"}, notebook="02b")
    results = write(rows(a=LOST))
    other = type(of())("02b", "loss", {"detector": "b"}, "change", low="low", high="high")
    assert verdict(claim(Comparison("<", of("a"), other)), results).verdict == v.ON_RENDERED_DATA


CLASS = Comparison(
    "<", type(of())("02", "loss", {"detector": "@top-down"}, "change", low="low", high="high"), 0.0
)


def test_what_holds_of_a_class_never_stands_in_for_the_named_system(write):
    """The named one was not run; of its class three were, and one of another."""
    table = rows(movenet_thunder=LOST, mediapipe=LOST, movenet_lightning=LOST, posenet=KEPT)
    found = verdict(claim(NAMED, class_tests=(CLASS,), class_statement="Every one."), write(table))
    assert found.verdict == v.NOT_TESTABLE and found.reason.endswith("no result of mmpose, alphapose")
    assert found.of_class.verdict == v.REPRODUCED
    assert all(name in found.of_class.ours for name in ("mediapipe", "movenet-lightning", "movenet-thunder"))


def test_a_class_statement_has_its_own_verdict(write):
    def of_class(**changes) -> v.Verdict:
        made = claim(NAMED, class_tests=(CLASS,), class_statement="Every one.")
        return verdict(made, write(rows(**changes))).of_class

    assert of_class(mmpose=LOST, mediapipe=KEPT, alphapose=LOST).verdict == v.NOT_REPRODUCED
    two = of_class(mmpose=LOST, mediapipe=LOST)
    assert (two.verdict, two.reason[:40]) == (v.PARTLY, "only 2 of at least 3: mediapipe, mmpose;")
    nobody = of_class(posenet=KEPT)
    assert (nobody.verdict, nobody.reason) == (
        v.NOT_TESTABLE,
        "02/loss has no result for detector any top-down",
    )


def test_what_is_always_rendered_stays_so_when_the_run_had_photographs(write):
    results = write(rows(mmpose=LOST, alphapose=LOST), {"source": "halpe"})
    assert verdict(claim(NAMED, only_on="rendered people"), results).verdict == v.ON_RENDERED_DATA


def test_a_claim_about_photographs_is_not_tested_on_rendered_people(write):
    table = rows(mmpose=KEPT, alphapose=KEPT)
    found = verdict(claim(NAMED, only_on="photographs"), write(table, {"source": "rendered"}))
    assert found.verdict == v.NOT_TESTABLE
    assert "rendered" in found.reason
    assert verdict(claim(NAMED, only_on="photographs"), write(table)).verdict == v.NOT_REPRODUCED


def test_best_of_all_others(write):
    best = claim(Comparison(">", of("a"), of("b", "c")))
    assert (
        verdict(best, write(rows(a=(3, 2.8, 3.2), b=(1, 0.9, 1.1), c=(2, 1.9, 2.1)))).verdict == v.REPRODUCED
    )
    assert (
        verdict(best, write(rows(a=(2, 1.8, 2.2), b=(3, 2.9, 3.1), c=(1, 1, 1)))).verdict == v.NOT_REPRODUCED
    )
    assert verdict(best, write(rows(a=(3, 2.0, 4.0), b=(2, 1.9, 2.1), c=(1, 1, 1)))).verdict == v.UNDECIDED


def test_rows_are_compared_where_columns_match(write):
    table = [
        {"group": "body", "detector": "a", "joint": joint, "view": view, "change": x, "low": x, "high": x}
        for joint, view, x in [("wrist", "up", 1.0), ("wrist", "low", 2.0), ("elbow", "up", 3.0)]
    ]
    left, right = of("a", name=("joint",)), of("a", name=("joint",))
    left.where["view"], right.where["view"] = "low", "up"
    results = write(table)
    assert verdict(claim(Comparison(">", left, right, match=("joint",))), results).verdict == v.REPRODUCED
    assert verdict(claim(Comparison(">", left, right)), results).verdict == v.NOT_REPRODUCED
    right.where["view"] = "low"
    left.where["joint"], right.where["joint"] = "wrist", ["wrist"]
    none = Comparison(">", left, right, match=("view", "joint"))
    left.where["view"] = "up"
    assert "no two rows of loss agree in view, joint" == verdict(claim(none), results).reason


def test_one_that_is_picked_is_corrected_for_the_choice(write):
    results = write(rows(a=(0.1, 0.0, 0.2), b=(0.3, 0.05, 0.55), c=(0.2, 0.1, 0.3)))
    some = Comparison(">", of("a", "b", "c", greatest=True), 0.0)
    found = verdict(claim(some), results)
    assert (found.verdict, found.n_comparisons, found.ours) == (v.UNDECIDED, 3, "b 0.3 [0.05, 0.55]")
    assert verdict(claim(Comparison(">", of("b"), 0.0)), results).verdict == v.REPRODUCED
    than_best = Comparison("<", of("a", "c", greatest=True), of("a", "b", "c", greatest=True))
    assert verdict(claim(than_best), results).n_comparisons == 6


def test_missing_results_are_not_verdicts(tmp_path):
    assert verdict(claim(LOSES), tmp_path).reason == "02 has no results in this run"


def test_a_claim_without_tests_says_why(tmp_path):
    found = verdict(claim(reason="needs the robot"), tmp_path)
    assert (found.verdict, found.reason) == (v.NOT_TESTABLE, "needs the robot")


numbers = st.floats(-10, 10)
ZERO = Quantity(0, 0, 0, {}, "")


def about(value: float, half: float) -> Quantity:
    return Quantity(value, value - half, value + half, {}, "")


@given(value=numbers, half=st.floats(0, 5), margin=st.floats(0, 2), n=st.integers(1, 100))
def test_greater_and_less_mirror_each_other(value, half, margin, n):
    def outcome(relation, sign):
        return v.Pair(
            Comparison(relation, of(), 0.0, margin=margin), about(sign * value, half), ZERO
        ).outcome(n)

    assert outcome(">", 1) == outcome("<", -1)
    if outcome(">", 1):
        assert value > margin and outcome("<", 1) is False


@given(value=numbers, half=st.floats(0.01, 5), margin=st.floats(0.01, 2), n=st.integers(1, 100))
def test_more_comparisons_never_decide_what_fewer_left_open_nor_turn_a_verdict(value, half, margin, n):
    for relation in ("<", ">", "similar"):
        pair = v.Pair(Comparison(relation, of(), 0.0, margin=margin), about(value, half), ZERO)
        assert pair.outcome(n) in (pair.outcome(1), None)


def test_intervals_grow_as_those_of_a_normal_distribution():
    pair = v.Pair(LOSES, about(1.0, 1.96), ZERO)
    low, high = pair.interval(10)
    assert high - 1.0 == pytest.approx(1.0 - low) == pytest.approx(NormalDist().inv_cdf(0.9975), rel=1e-4)
    assert pair.interval(1) == pytest.approx((-0.96, 2.96))
    skewed = v.Pair(LOSES, Quantity(1.0, 0.9, 1.5, {}, ""), ZERO).interval(10)
    assert (skewed[1] - 1.0) / (1.0 - skewed[0]) == pytest.approx(5)


def test_a_claim_is_held_to_all_its_comparisons_at_once(write):
    """A difference that one comparison alone would see, in either direction, is not seen among twenty."""
    barely = (0.21, 0.01, 0.41)
    alone = claim(Comparison(">", of("d0"), 0.0)), claim(Comparison("<", of("d0"), 0.0))
    clear = {f"d{k}": (2.0, 1.9, 2.1) for k in range(1, 20)}
    results = write(rows(d0=barely, **clear))
    assert [verdict(made, results).verdict for made in alone] == [v.REPRODUCED, v.NOT_REPRODUCED]
    names = [f"d{k}" for k in range(20)]
    assert verdict(claim(Comparison(">", of(*names), 0.0)), results).verdict == v.UNDECIDED
    minus = write(rows(d0=barely, **{name: (-2.0, -2.1, -1.9) for name in clear}))
    assert verdict(claim(Comparison("<", of(*names), 0.0)), minus).verdict == v.UNDECIDED


@pytest.mark.parametrize(
    ("low", "high", "similar", "greater"),
    [
        (-0.0999, 0.0999, True, False),
        (-0.1, 0.1, None, False),  # the margin itself is not similar
        (-0.10001, 0.1, None, False),
        (-0.1, 0.10001, None, None),
        (0.10001, 0.2, False, True),
        (0.1, 0.2, False, None),  # and not above itself
        (-0.2, -0.1, False, False),
        (-0.2, -0.10001, False, False),
        (0.0, 0.0999, True, False),
        (-0.5, 0.5, None, None),
        (math.nan, math.nan, None, None),
    ],
)
def test_a_margin_is_neither_similar_nor_above(low, high, similar, greater):
    middle = Quantity(low + (high - low) / 2, low, high, {}, "")
    for relation, expected in (("similar", similar), (">", greater)):
        assert v.Pair(Comparison(relation, of(), 0.0, margin=0.1), middle, ZERO).outcome() is expected
