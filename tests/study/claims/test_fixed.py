"""Since when statements and margins stand: no change of one goes unrecorded."""

import json
import subprocess

import pytest

from hicp_lib.core.cache import digest
from hicp_lib.core.files import read_json
from hicp_lib.study import provenance
from hicp_lib.study.claims.fixed import fixed
from hicp_lib.study.claims.statements import CLAIMS_FILE


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
