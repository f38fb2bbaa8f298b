"""Verdicts as tables: every claim once, with what stands beside it, and what of the paper is covered."""

import json
import subprocess

import pytest

from hicp_lib.core.cache import digest
from hicp_lib.core.files import read_json
from hicp_lib.study import provenance
from hicp_lib.study.claims import reading
from hicp_lib.study.claims import verdicts as v
from hicp_lib.study.claims.reading import fixed
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


def test_the_committed_claims_are_those_that_were_recorded():
    content = read_json(CLAIMS_FILE)
    sha256 = digest([content["tables"], content["claims"]])
    assert content["recorded"]["sha256"] == sha256, (
        f"statements or margins changed: `recorded` needs the next version, the day, and {sha256}"
    )


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A repository with a claims file of its own: a function that writes and commits one."""
    monkeypatch.setattr(provenance, "CHECKOUT", tmp_path)
    path = tmp_path / "claims.json"

    def git(*arguments):
        identity = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false")
        return subprocess.run(
            ["git", *identity, *arguments], cwd=tmp_path, capture_output=True, text=True, check=True
        )

    git("init", "-q")

    def write(claims, sentences=(), record=True):
        recorded = {"version": 3, "day": "2020-01-02", "sha256": digest([{}, claims]) if record else "0"}
        content = {"recorded": recorded, "tables": {}, "claims": claims, "sentences": sentences}
        path.write_text(json.dumps(content, indent=1))
        git("add", "-A")
        git("commit", "-q", "-m", "m")
        return path, git("rev-parse", "--short", "HEAD").stdout.strip()

    return write


def test_the_commit_is_the_one_that_recorded_the_present_statements(checkout):
    checkout([{"id": "other"}])
    path, recorded_by = checkout([{"id": "a"}])
    checkout([{"id": "a"}], sentences=[{"says": "more"}])
    found = fixed(path)
    assert found["since"].startswith(f"commit {recorded_by} of 20") and found["version"] == 3


def test_without_a_history_the_recorded_day_stands(checkout, monkeypatch):
    path, _ = checkout([{"id": "a"}])
    monkeypatch.setattr(provenance, "CHECKOUT", None)
    assert fixed(path)["since"] == "2020-01-02"


def test_a_change_that_was_not_recorded_is_told(checkout):
    path, _ = checkout([{"id": "a"}], record=False)
    assert fixed(path)["since"] == "changed after version 3"
