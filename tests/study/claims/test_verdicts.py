"""Verdicts on made-up results, among them results that must fail a claim."""

import json

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.detectors.registry import COMBINED
from hicp_lib.study.claims import verdicts as v
from hicp_lib.study.claims.statements import Claim, Comparison, Selection, read_claims

LOSS = Selection("02", "loss", {"group": "body"}, "change", low="low", high="high")


def claim(*tests: Comparison, **more) -> Claim:
    return Claim("c", "IV", "text", "statement", tests=tests, **more)


@pytest.fixture
def write(tmp_path):
    def write_table(rows, parameters=None, notebook="02", table="loss"):
        folder = tmp_path / notebook
        folder.mkdir(exist_ok=True)
        pd.DataFrame(rows).to_parquet(folder / f"{table}.parquet")
        stamp = {"parameters": {"source": "halpe"} if parameters is None else parameters}
        (folder / "provenance.json").write_text(json.dumps(stamp))
        return tmp_path

    return write_table


def rows(**changes: tuple[float, float, float]) -> list[dict]:
    """One row per detector: change, low, high."""
    return [
        {"group": "body", "detector": name.replace("_", "-"), "change": c, "low": low, "high": high}
        for name, (c, low, high) in changes.items()
    ]


def verdict(claims, results):
    return v.judge_claims([claims], results)[0]


LOSES = Comparison("<", LOSS, 0.0)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"a": (-0.4, -0.5, -0.3), "b": (-0.2, -0.3, -0.1)}, v.REPRODUCED),
        ({"a": (-0.4, -0.5, -0.3), "b": (0.2, 0.1, 0.3)}, v.NOT_REPRODUCED),
        ({"a": (-0.4, -0.5, -0.3), "b": (-0.2, -0.5, 0.1)}, v.NOT_TESTABLE),
        ({"a": (0.1, -0.1, 0.2), "b": (0.2, 0.1, 0.3)}, v.NOT_REPRODUCED),
    ],
)
def test_every_row_must_hold(write, changes, expected):
    assert verdict(claim(LOSES), write(rows(**changes))).verdict == expected


def test_evidence_names_each_detector_with_its_interval(write):
    found = verdict(claim(LOSES, unit="AP"), write(rows(a=(-0.4, -0.5, -0.3))))
    assert found.ours == "a -0.4 [-0.5, -0.3] AP"


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
    results = write(rows(a=(-0.4, -0.5, -0.3)), parameters)
    assert verdict(claim(LOSES), results).verdict == expected


def test_a_simulated_recording_is_no_recording_of_a_lab(write, tmp_path):
    recordings = [tmp_path / "upper", tmp_path / "lower"]
    for folder in recordings:
        folder.mkdir()
    given = {"recording": str(recordings[0]), "recording_lower": str(recordings[1])}
    results = write(rows(a=(-0.4, -0.5, -0.3)), given)
    assert verdict(claim(LOSES), results).verdict == v.REPRODUCED
    (recordings[1] / "simulation.json").write_text("{}")
    assert verdict(claim(LOSES), results).verdict == v.ON_RENDERED_DATA


def test_both_sides_of_a_comparison_tell_what_the_data_were(write):
    write(rows(b=(0.4, 0.3, 0.5)), {"source": "rendered"}, notebook="02b")
    results = write(rows(a=(-0.4, -0.5, -0.3)))
    other = Selection("02b", "loss", {}, "change", low="low", high="high")
    assert verdict(claim(Comparison("<", LOSS, other)), results).verdict == v.ON_RENDERED_DATA


def test_without_an_interval_a_claim_stays_open(write):
    unknown = float("nan")
    found = verdict(claim(LOSES), write(rows(a=(-0.4, unknown, unknown))))
    assert (found.verdict, found.ours) == (v.NOT_TESTABLE, "a -0.4")


CLASS = Comparison(
    "<", Selection("02", "loss", {"detector": "@top-down"}, "change", low="low", high="high"), 0.0
)
NAMED = Comparison(
    "<", Selection("02", "loss", {"detector": "mmpose"}, "change", low="low", high="high"), 0.0
)


def test_what_holds_of_a_class_never_stands_in_for_the_named_system(write):
    """The named one was not run; of its class two were, and one of another."""
    results = write(
        rows(movenet_thunder=(-0.4, -0.5, -0.3), mediapipe=(-0.2, -0.3, -0.1), posenet=(0.4, 0.3, 0.5))
    )
    found = verdict(claim(NAMED, class_tests=(CLASS,), class_statement="Every one."), results)
    assert (found.verdict, found.reason) == (v.NOT_TESTABLE, "mmpose was not run")
    assert found.of_class == (
        "Every one. Reproduced: movenet-thunder -0.4 [-0.5, -0.3]; mediapipe -0.2 [-0.3, -0.1]"
    )


def test_a_class_statement_has_its_own_verdict(write):
    results = write(rows(mmpose=(-0.4, -0.5, -0.3), mediapipe=(0.2, 0.1, 0.3)))
    found = verdict(claim(NAMED, class_tests=(CLASS,), class_statement="Every one."), results)
    assert found.verdict == v.REPRODUCED and found.of_class.startswith("Every one. Not reproduced: ")
    left_open = verdict(
        claim(NAMED, class_tests=(CLASS,), class_statement="Every one."),
        write(rows(mediapipe=(0.0, -0.1, 0.1))),
    )
    assert left_open.of_class.startswith("Every one. Not testable here: the 95 % intervals leave it open")
    assert left_open.of_class.endswith(": mediapipe 0 [-0.1, 0.1]")
    nobody = verdict(
        claim(NAMED, class_tests=(CLASS,), class_statement="Every one."), write(rows(posenet=(1, 1, 1)))
    )
    assert nobody.of_class == "Every one. Not testable here: no top-down detector was run"
    shown = v.for_reading(v.verdict_table([found]), v.REPRODUCED)
    assert shown["of its class"].tolist() == [found.of_class]


def test_what_is_always_rendered_stays_so_when_the_run_had_photographs(write):
    results = write(rows(a=(-0.4, -0.5, -0.3)), {"source": "halpe"})
    assert verdict(claim(LOSES, only_on="rendered people"), results).verdict == v.ON_RENDERED_DATA


def test_a_claim_about_photographs_is_not_tested_on_rendered_people(write):
    results = write(rows(a=(0.4, 0.3, 0.5)), {"source": "rendered"})
    found = verdict(claim(LOSES, only_on="photographs"), results)
    assert found.verdict == v.NOT_TESTABLE
    assert "rendered" in found.reason and "halpe" in found.command
    results = write(rows(a=(0.4, 0.3, 0.5)), {"source": "halpe"})
    assert verdict(claim(LOSES, only_on="photographs"), results).verdict == v.NOT_REPRODUCED


def test_a_detector_that_was_not_run_gives_the_command(write):
    best = Comparison(">", Selection("02", "loss", {"detector": "mmpose"}, "change"), LOSS)
    found = verdict(claim(best), write(rows(a=(-0.4, -0.5, -0.3))))
    assert (found.verdict, found.reason) == (v.NOT_TESTABLE, "mmpose was not run")
    assert found.command.startswith("hicp models use --detector mmpose --model FILE.onnx && hicp report")
    pair = Selection("02", "loss", {"detector": ["a"], "other": ["mediapipe", "mmpose"]}, "change")
    table = rows(a=(-0.4, -0.5, -0.3))
    results = write([row | {"other": "mediapipe", "group": "hand"} for row in table])
    assert verdict(claim(Comparison(">", pair, 0.0)), results).verdict == v.NOT_REPRODUCED
    results = write([row | {"other": "alphapose"} for row in table])
    assert verdict(claim(Comparison(">", pair, 0.0)), results).reason == "mediapipe was not run"


def test_imported_detections_count_as_the_detectors(write):
    results = write(
        [{"group": "body", "detector": "mmpose-imported", "change": 1.0, "low": 0.9, "high": 1.1}]
    )
    above = Comparison(">", Selection("02", "loss", {"detector": "mmpose"}, "change"), 0.5)
    assert verdict(claim(above), results).verdict == v.REPRODUCED


def test_best_of_all_others(write):
    left = Selection("02", "loss", {"detector": "a"}, "change", low="low", high="high")
    right = Selection("02", "loss", {}, "change", low="low", high="high", unlike={"detector": "a"})
    best = claim(Comparison(">", left, right))
    assert (
        verdict(best, write(rows(a=(3, 2.8, 3.2), b=(1, 0.9, 1.1), c=(2, 1.9, 2.1)))).verdict == v.REPRODUCED
    )
    assert verdict(best, write(rows(a=(2, 1.8, 2.2), b=(3, 2.9, 3.1)))).verdict == v.NOT_REPRODUCED
    assert verdict(best, write(rows(a=(3, 2.0, 4.0), b=(2, 1.9, 2.1)))).verdict == v.NOT_TESTABLE


def test_rows_are_compared_where_columns_match(write):
    table = [
        {"detector": "a", "joint": joint, "view": view, "x": x}
        for joint, view, x in [("wrist", "up", 1.0), ("wrist", "low", 2.0), ("elbow", "up", 3.0)]
    ]
    left = Selection("02", "loss", {"view": "low"}, "x", name=("joint",))
    right = Selection("02", "loss", {"view": "up"}, "x", name=("joint",))
    results = write(table)
    assert verdict(claim(Comparison(">", left, right, match=("joint",))), results).verdict == v.REPRODUCED
    assert verdict(claim(Comparison(">", left, right)), results).verdict == v.NOT_REPRODUCED


def test_least_and_greatest_pick_one_row(write):
    results = write(rows(a=(1, 1, 1), b=(3, 3, 3)))
    least = Selection("02", "loss", {}, "change", pick="least")
    greatest = Selection("02", "loss", {}, "change", pick="greatest")
    assert verdict(claim(Comparison("within", least, 1.0, tolerance=0.1)), results).verdict == v.REPRODUCED
    assert (
        verdict(claim(Comparison("within", greatest, 1.0, tolerance=0.1)), results).verdict
        == v.NOT_REPRODUCED
    )


def test_missing_results_and_numbers_are_not_verdicts(write, tmp_path):
    assert "no results" in verdict(claim(LOSES), tmp_path).reason
    results = write(rows(a=(float("nan"), float("nan"), float("nan"))))
    assert verdict(claim(LOSES), results).verdict == v.NOT_TESTABLE


def test_a_claim_without_tests_says_why(tmp_path):
    found = verdict(claim(reason="needs the robot", command="see the page"), tmp_path)
    assert (found.verdict, found.reason, found.command) == (v.NOT_TESTABLE, "needs the robot", "see the page")


def test_a_wrong_column_is_the_claims_files_mistake(write):
    wrong = Comparison("<", Selection("02", "loss", {}, "AQ"), 0.0)
    with pytest.raises(InputError, match="AQ"):
        verdict(claim(wrong), write(rows(a=(1, 1, 1))))


numbers = st.floats(-10, 10)


@given(value=numbers, half=st.floats(0, 5), margin=st.floats(0, 2))
def test_greater_and_less_mirror_each_other(value, half, margin):
    def outcome(relation, sign):
        a = v.Quantity(sign * value, sign * value - half, sign * value + half, {}, "")
        zero = v.Quantity(0, 0, 0, {}, "")
        return v.holds(Comparison(relation, LOSS, 0.0, margin=margin), [(a, zero)])

    assert outcome(">", 1) == outcome("<", -1)
    if outcome(">", 1):
        assert value > margin and outcome("<", 1) is False


@pytest.fixture
def paper_medians():
    """The paper's Tables III and IV as notebook 04 saves its own."""
    paper = read_json(DATA_DIR / "paper.json")["mocap"]
    table = pd.DataFrame(paper["rows"], columns=paper["columns"]).assign(method="paper")
    return table.assign(**{name: table["median_cm"] / 100 for name in ("median_m", "low_m", "high_m")})


def judged_on(write, medians) -> dict[str, str]:
    """Verdicts by id on the claims that rest on motion capture alone, shoulders aside (not in the tables)."""
    results = write(medians, notebook="04_mocap_3d", table="medians")
    claims = [c for c in read_claims() if c.tests and c.tests[0].left.table == "medians"]
    return {o.claim.id: o.verdict for o in v.judge_claims(claims, results) if o.claim.id != "shoulders-worst"}


def test_the_papers_own_numbers_bear_out_its_claims(write, paper_medians):
    verdicts = judged_on(write, paper_medians)
    assert len(verdicts) == 8 and set(verdicts.values()) == {v.REPRODUCED}


@pytest.mark.parametrize(
    ("column", "where", "factor", "refuted"),
    [
        ("median_m", "wrist", 3.0, {"wrists-best", "wrists-any", "elbows-worse", "threshold"}),
        ("median_m", "elbow", 0.5, {"elbows-best", "elbows-worse", "detectron2-elbows", "threshold"}),
        ("count", "elbow", 0.0, {"openpose-few", "detectron2-scale"}),
    ],
)
def test_other_numbers_refute_them(write, paper_medians, column, where, factor, refuted):
    changed = paper_medians["keypoint"].str.contains(where) & (
        (paper_medians["min_score"] == 0.3) | (column == "count")
    )
    names = ["median_m", "low_m", "high_m"] if column == "median_m" else ["count"]
    paper_medians.loc[changed, names] *= factor
    verdicts = judged_on(write, paper_medians)
    assert {name for name, verdict in verdicts.items() if verdict == v.NOT_REPRODUCED} == refuted


def test_the_committed_claims_can_be_read():
    claims = read_claims()
    assert all(claim.text and claim.statement and claim.section for claim in claims)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({}, "missing"),
        ({"tests": []}, "neither tests nor a reason"),
        ({"tests": [{"relation": "~", "left": 1, "right": 2}]}, "relation '~' is unknown"),
        ({"tests": [{"relation": "<", "left": 1, "right": 2}]}, "left side must select"),
        ({"tests": [{"relation": "within", "left": 1, "right": 2}]}, "tolerance"),
        (
            {"tests": [{"relation": "<", "left": {"table": "x", "where": {}, "value": "y"}, "right": 2}]},
            "NOTEBOOK/TABLE",
        ),
        ({"reason": "r", "only_on": "robots"}, "only_on"),
        ({"reason": "r", "sort": "x"}, "sort"),
    ],
)
def test_a_malformed_claim_is_named(tmp_path, row, message):
    full = (
        {"id": "this-one", "section": "IV", "text": "t", "statement": "s"} | row
        if row
        else {"id": "this-one"}
    )
    path = tmp_path / "claims.json"
    path.write_text(json.dumps([full]))
    with pytest.raises(InputError, match=f"this-one.*{message}"):
        read_claims(path)


def test_for_reading_every_claim_appears_once(write):
    results = write(rows(a=(-0.4, -0.5, -0.3)))
    claims = [claim(LOSES), claim(reason="no robot", command="buy one")]
    table = v.verdict_table(v.judge_claims(claims, results))
    parts = {verdict: v.for_reading(table, verdict) for verdict in v.VERDICTS}
    assert {verdict: len(part) for verdict, part in parts.items() if len(part)} == {
        v.REPRODUCED: 1, v.NOT_TESTABLE: 1,
    }  # fmt: skip
    assert list(parts[v.REPRODUCED]) == ["section", "claim", "paper", "ours"]
    assert "no robot: buy one" in set(parts[v.NOT_TESTABLE]["why not, and what would test it"])
    assert v.verdict_counts(table)[v.REPRODUCED] == 1


@pytest.mark.parametrize(
    ("low", "high", "within", "greater"),
    [
        (-0.1, 0.1, True, False),  # the tolerance itself is within
        (-0.10001, 0.1, None, False),
        (-0.1, 0.10001, None, None),
        (0.10001, 0.2, False, True),
        (0.1, 0.2, None, None),  # the margin itself is not above it
        (-0.2, -0.1, None, False),
        (-0.2, -0.10001, False, False),
        (0.0, 0.1, True, False),
    ],
)
def test_tolerance_counts_as_within_and_margin_not_as_above(low, high, within, greater):
    pair = [(v.Quantity(0.0, low, high, {}, ""), v.Quantity(0.0, 0.0, 0.0, {}, ""))]
    assert v.holds(Comparison("within", LOSS, 0.0, tolerance=0.1), pair) is within
    assert v.holds(Comparison(">", LOSS, 0.0, margin=0.1), pair) is greater


def test_evidence_without_an_interval_has_no_brackets(write):
    assert verdict(claim(LOSES), write(rows(a=(-0.4, -0.4, -0.4)))).ours == "a -0.4"


def test_a_detector_that_needs_no_model_is_simply_run(write):
    best = Comparison(">", Selection("02", "loss", {"detector": "openpose-mobilenet"}, "change"), LOSS)
    found = verdict(claim(best), write(rows(a=(-0.4, -0.5, -0.3))))
    assert found.command == "hicp report -p detectors mediapipe,openpose-mobilenet"


def test_the_least_and_the_greatest_row_are_picked_and_scaled(write):
    results = write(rows(a=(-0.4, -0.5, -0.3), b=(0.2, 0.1, 0.3)))
    for pick, expected in (("least", (-400, -500, -300)), ("greatest", (200, 100, 300))):
        (found,) = v.select(Selection("02", "loss", {}, "change", {}, pick, "low", "high", 1000.0), results)
        assert (found.value, found.low, found.high) == pytest.approx(expected)


SOUND = {"id": "a", "section": "IV", "text": "t", "statement": "s", "reason": "no robot"}
SELECTED = {"table": "02/loss", "where": {}, "value": "change"}


def read(tmp_path, content) -> list[Claim]:
    path = tmp_path / "claims.json"
    path.write_text(json.dumps(content))
    return read_claims(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"claims": []}, "expected a list of claims, each an object"),
        ([SOUND, 3], "expected a list of claims, each an object"),
        ([SOUND, SOUND], "claim a is there twice; give each its own id"),
        ([SOUND, {"section": "IV"}], "claim number 1: "),
    ],
)
def test_what_is_no_list_of_claims_is_refused(tmp_path, content, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path, content)


def test_a_selection_takes_each_row_and_names_its_detector_unless_told_otherwise(tmp_path):
    tests = [{"relation": ">", "left": SELECTED, "right": 1}]
    tests.append(
        {"relation": "within", "left": SELECTED | {"pick": "least"}, "right": 2.5, "tolerance": 0.01}
    )
    (found,) = read(tmp_path, [SOUND | {"tests": tests}])
    first, second = found.tests
    assert first == Comparison(">", Selection("02", "loss", {}, "change", pick="each", scale=1.0), 1.0)
    assert first.left.name == ("detector",) and (first.margin, first.tolerance) == (0.0, 0.0)
    assert (second.left.pick, second.right, second.tolerance) == ("least", 2.5, 0.01)
    wrong = [SOUND | {"tests": [{"relation": ">", "left": SELECTED | {"pick": "best"}, "right": 1}]}]
    with pytest.raises(InputError, match="claim a: pick 'best' is unknown"):
        read(tmp_path, wrong)


def test_only_whole_tables_of_numbers_are_selected_from(write):
    """A row whose number is missing or infinite is left out, and nothing else."""
    results = write(rows(a=(-0.4, -0.5, -0.3), b=(float("inf"), 0.1, 0.3), c=(0.0, 0.0, 0.0)))
    found = v.select(Selection("02", "loss", {}, "change", name=("detector",)), results)
    assert [quantity.name for quantity in found] == ["a", "c"]
    assert [(quantity.low, quantity.high) for quantity in found] == [(-0.4, -0.4), (0.0, 0.0)]


def test_labels_are_shown_for_reading():
    assert [v._plain(label) for label in (160.0, 0.25, "left_wrist", 3)] == ["160", "0.25", "left wrist", "3"]


def test_a_combination_is_run_with_its_body_detector(write):
    combined = Selection("02", "loss", {"detector": "mediapipe+openpose-mobilenet"}, "change")
    found = verdict(claim(Comparison(">", combined, LOSS)), write(rows(a=(-0.4, -0.5, -0.3))))
    assert found.reason == "mediapipe+openpose-mobilenet was not run"
    other = Selection("02", "loss", {"detector": f"{COMBINED}openpose-mobilenet"}, "change")
    found = verdict(claim(Comparison(">", other, LOSS)), write(rows(a=(-0.4, -0.5, -0.3))))
    assert found.command == "hicp report -p detectors mediapipe,openpose-mobilenet -p body openpose-mobilenet"
