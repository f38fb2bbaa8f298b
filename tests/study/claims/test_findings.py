"""Every claim is reproduced where the paper is repeated, and not where one of its findings is turned."""

import pytest

from hicp_lib.study.claims import verdicts as v
from hicp_lib.study.claims.statements import read_claims
from hicp_lib.study.claims.verdicts import judge_claims
from tests.study.claims import findings

CLAIMS = {claim.id: claim for claim in read_claims()}
TESTED = sorted(name for name, claim in CLAIMS.items() if claim.tests)
TURNS = [(name, k) for name, turns in findings.OPPOSITES.items() for k in range(len(turns))]


def verdict(name, folder, tables) -> v.Verdict:
    needed = {f"{side.notebook}/{side.table}" for test in CLAIMS[name].tests for side in test.selections}
    findings.write(folder, {table: tables[table] for table in needed})
    return judge_claims([CLAIMS[name]], folder)[0]


@pytest.fixture(scope="module")
def world():
    return findings.world()


@pytest.mark.parametrize("name", TESTED)
def test_a_run_that_repeats_the_paper_reproduces_the_claim(name, world, tmp_path):
    found = verdict(name, tmp_path, world)
    only_rendered = CLAIMS[name].only_on == "rendered people"
    assert found.verdict == (v.ON_RENDERED_DATA if only_rendered else v.REPRODUCED), found


@pytest.mark.parametrize(("name", "k"), TURNS)
def test_a_run_that_finds_the_opposite_does_not(name, k, world, tmp_path):
    found = verdict(name, tmp_path, findings.turned(world, findings.OPPOSITES[name][k]))
    assert found.verdict == v.NOT_REPRODUCED, found


def test_every_claim_has_a_finding_of_the_paper_or_says_why_nothing_can_test_it():
    assert set(findings.OPPOSITES) == set(TESTED)
    assert all(claim.reason for claim in CLAIMS.values() if not claim.tests)


def test_findings_that_contradict_each_other_are_refused(monkeypatch):
    table, labels, value, half = findings.WORLD[2]
    turned = (table, labels | {"detector": labels["other"], "other": labels["detector"]}, value, half)
    monkeypatch.setattr(findings, "WORLD", [*findings.WORLD, turned])
    with pytest.raises(ValueError, match="two findings"):
        findings.world()
