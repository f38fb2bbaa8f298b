"""Verdicts as tables: every claim once, with what stands beside it, and what of the paper is covered."""

import pytest

from hicp_lib.core.files import read_json
from hicp_lib.study.claims import reading
from hicp_lib.study.claims import verdicts as v
from hicp_lib.study.claims.statements import CLAIMS_FILE, Comparison, read_claims
from tests.study.claims.made_up import NAMED, claim, of, rows

KEPT = Comparison(">", of("mmpose"), 0.0)


@pytest.fixture
def table(write):
    results = write(rows(mmpose=(-0.4, -0.5, -0.3), alphapose=(-0.4, -0.5, -0.3)))
    claims = [
        claim(NAMED, paper="-.4", class_tests=(KEPT,), class_statement="It rises."),
        claim(KEPT),
        claim(reason="no robot"),
    ]
    return reading.verdict_table(v.judge_claims(claims, results))


def test_for_reading_every_claim_appears_once(table):
    parts = {verdict: reading.for_reading(table, verdict) for verdict in v.VERDICTS}
    assert {verdict: len(part) for verdict, part in parts.items() if len(part)} == {
        v.REPRODUCED: 1, v.NOT_REPRODUCED: 1, v.NOT_TESTABLE: 1,
    }  # fmt: skip
    assert reading.verdict_counts(table)[v.REPRODUCED] == 1
    assert reading.verdict_counts(table, "class_verdict")[v.NOT_REPRODUCED] == 1
    assert parts[v.REPRODUCED]["claim"].tolist() == ["text Tested: statement Paper: -.4."]
    assert parts[v.NOT_TESTABLE]["why not"].tolist() == ["no robot"]


def test_what_holds_beyond_the_papers_systems_stands_in_a_column_of_its_own(table):
    shown = reading.for_reading(table, v.REPRODUCED)
    assert shown[reading.BEYOND].tolist() == ["It rises. Not reproduced: mmpose -0.4 [-0.5, -0.3]"]
    assert list(reading.for_reading(table, v.NOT_REPRODUCED)) == ["section", "claim", "ours"]


def test_what_leaves_a_claim_open_is_said_beside_its_numbers(write):
    results = write(rows(mmpose=(0.1, -0.1, 0.3)))
    table = reading.verdict_table(v.judge_claims([claim(KEPT)], results))
    (ours,) = reading.for_reading(table, v.UNDECIDED)["ours"]
    assert ours == "mmpose 0.1 [-0.1, 0.3] (the least difference that this run could have seen is 0.2)"


def test_every_number_and_ordering_of_the_paper_has_a_claim_or_a_reason():
    sentences, ids = read_json(CLAIMS_FILE)["sentences"], {claim.id for claim in read_claims()}
    for sentence in sentences:
        assert bool(sentence.get("claims")) != bool(sentence.get("reason")), sentence
        assert set(sentence.get("claims", [])) <= ids, sentence
    covered = reading.coverage()
    assert covered["section"].str.match(r"(III|IV|V)\b").all() and len(covered) == len(sentences)
    tested = {name for names in covered["claims"] for name in names.split(", ")}
    assert tested >= ids, "a claim on no sentence of the paper"
    assert "not covered: no finding" in set(covered["claims"])
