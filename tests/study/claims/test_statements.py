"""The claims file: its layout, and what is refused."""

import json

import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.study.claims.statements import Claim, Comparison, Selection, read_claims

SOUND = {"id": "a", "section": "IV", "text": "t", "statement": "s", "reason": "no robot"}
SELECTED = {"table": "02/loss", "where": {}, "value": "change"}


def read(tmp_path, claims, tables=None) -> list[Claim]:
    path = tmp_path / "claims.json"
    path.write_text(json.dumps({"tables": tables or {}, "claims": claims}))
    return read_claims(path)


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
        ({"tests": [{"relation": "similar", "left": 1, "right": 2}]}, "needs a margin above 0"),
        ({"tests": [{"relation": "<", "left": SELECTED | {"table": "x"}, "right": 2}]}, "NOTEBOOK/TABLE"),
        ({"reason": "r", "class_statement": "Every one."}, "needs both"),
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
    with pytest.raises(InputError, match=f"this-one.*{message}"):
        read(tmp_path, [full])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], "expected a list of claims, each an object, under the key 'claims'"),
        ({"claims": {}}, "expected a list of claims"),
        ({"claims": [SOUND, 3]}, "expected a list of claims, each an object"),
        ({"claims": [SOUND, SOUND]}, "claim a is there twice; give each its own id"),
        ({"claims": [SOUND, {"section": "IV"}]}, "claim number 1: "),
    ],
)
def test_what_is_no_list_of_claims_is_refused(tmp_path, content, message):
    path = tmp_path / "claims.json"
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=message):
        read_claims(path)


def test_a_selection_takes_each_row_and_names_its_detector_unless_told_otherwise(tmp_path):
    tests = [{"relation": ">", "left": SELECTED, "right": 1}]
    tests.append({"relation": "similar", "left": SELECTED | {"greatest": True}, "right": 2.5, "margin": 0.01})
    (found,) = read(tmp_path, [SOUND | {"tests": tests}])
    first, second = found.tests
    assert first == Comparison(">", Selection("02", "loss", {}, "change", greatest=False, scale=1.0), 1.0)
    assert first.left.name == ("detector",) and first.margin == 0.0
    assert (second.left.greatest, second.right, second.margin) == (True, 2.5, 0.01)


def test_a_table_is_described_once_and_a_selection_adds_to_it(tmp_path):
    tables = {"loss": {"table": "02/loss", "value": "change", "where": {"status": "run"}, "low": "low"}}
    test = {"relation": ">", "left": {"table": "loss", "where": {"detector": "a"}, "low": ""}, "right": 1}
    (found,) = read(tmp_path, [SOUND | {"tests": [test]}], tables)
    where = {"status": "run", "detector": "a"}
    assert found.tests[0].left == Selection("02", "loss", where, "change", low="")


def test_every_detector_is_meant_where_none_is_named_and_none_is_picked():
    def selection(**more):
        return Selection("02", "loss", more.pop("where", {}), "change", **more)

    assert selection().every("detector") and selection(where={"detector": "@top-down"}).every("detector")
    assert not selection(where={"detector": ["a", "@combined"]}).every("detector")
    assert not selection(greatest=True).every("detector")
    assert selection(where={"detector": ["a", "@combined"]}).named("detector") == ["a"]
