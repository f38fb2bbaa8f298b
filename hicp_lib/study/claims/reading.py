"""Verdicts as tables, what of the paper they cover, and since when the claims stand as they are."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pandas as pd

from hicp_lib.core.cache import digest
from hicp_lib.core.files import read_json
from hicp_lib.study.claims.statements import CLAIMS_FILE
from hicp_lib.study.claims.verdicts import NOT_TESTABLE, VERDICTS, Verdict
from hicp_lib.study.provenance import git

BEYOND = "beyond the paper's systems"


def verdict_table(verdicts: Iterable[Verdict]) -> pd.DataFrame:
    """One row per claim.

    Columns `id, section, claim, tested, paper, ours, verdict, why_not, n_comparisons`; of the
    statement beside it `class_tested, class_ours, class_verdict, class_why_not`, "" where there is none.
    """
    rows = []
    for said in verdicts:
        claim, beside = said.claim, said.of_class or Verdict(said.claim, "")
        row = {"id": claim.id, "section": claim.section, "claim": claim.text, "tested": claim.statement}
        row |= {"paper": claim.paper, "ours": said.ours, "verdict": said.verdict, "why_not": said.reason}
        row |= {"class_tested": claim.class_statement, "class_ours": beside.ours}
        row |= {"class_verdict": beside.verdict, "class_why_not": beside.reason}
        rows.append(row | {"n_comparisons": said.n_comparisons})
    return pd.DataFrame(rows)


def for_reading(table: pd.DataFrame, verdict: str) -> pd.DataFrame:
    """The claims with one verdict, for a page.

    `table` from `verdict_table`; columns `section, claim` (with what was tested, and the paper's value),
    `ours` (with what leaves it open; `why not` for what could not be tested), and, where some claim has a
    statement beside it, `BEYOND`.
    """
    rows = table[table["verdict"] == verdict]
    paper = (" Paper: " + rows["paper"] + ".").where(rows["paper"] != "", "")
    shown = rows[["section"]].assign(claim=rows["claim"] + " Tested: " + rows["tested"] + paper)
    if verdict == NOT_TESTABLE:
        shown["why not"] = rows["why_not"]
    else:
        shown["ours"] = rows["ours"] + (" (" + rows["why_not"] + ")").where(rows["why_not"] != "", "")
    if (rows["class_tested"] != "").any():
        open_at = rows[["class_why_not", "class_ours"]].agg(lambda two: ": ".join(filter(None, two)), axis=1)
        of_class = rows["class_tested"] + " " + rows["class_verdict"].str.capitalize() + ": " + open_at
        shown[BEYOND] = of_class.where(rows["class_tested"] != "", "–")
    return shown


def verdict_counts(table: pd.DataFrame, column: str = "verdict") -> dict[str, int]:
    """How many claims got each verdict, by `VERDICTS`; `table` from `verdict_table`."""
    return {verdict: int((table[column] == verdict).sum()) for verdict in VERDICTS}


def coverage(path: Path = CLAIMS_FILE) -> pd.DataFrame:
    """The paper's numbers and orderings, each with the claims that test it or the reason why none does.

    Parameters
    ----------
    path : Path, optional
        In the layout of `data/claims.json`.

    Returns
    -------
    DataFrame
        Columns `section, the paper's, claims`.
    """
    sentences = read_json(path)["sentences"]
    covered = [", ".join(s.get("claims", [])) or f"not covered: {s['reason']}" for s in sentences]
    table = pd.DataFrame(sentences)[["section", "says"]].rename(columns={"says": "the paper's"})
    return table.assign(claims=covered)


def fixed(path: Path = CLAIMS_FILE) -> dict[str, Any]:
    """Version and hash of statements and margins, and since when they are unchanged.

    Parameters
    ----------
    path : Path, optional
        In the layout of `data/claims.json`. Its `recorded` holds the version, a day, and the hash that the
        claims had on that day.

    Returns
    -------
    dict of str to object
        `version`; `sha256` of the canonical form of `tables` and `claims`; `since`: the commit that recorded
        this hash and its day, the recorded day where the history is not at hand, or that they were changed.
    """
    content = read_json(path)
    recorded = content["recorded"]
    sha256 = digest([content["tables"], content["claims"]])
    changed = f"changed after version {recorded['version']}"
    since = recorded["day"] if sha256 == recorded["sha256"] else changed
    if sha256 == recorded["sha256"] and git("rev-parse", "--is-shallow-repository") == "false":
        commits = git("log", f"-S{sha256}", "--format=commit %h of %cs", "--", str(path))
        since = commits.splitlines()[-1] if commits else since
    return {"version": recorded["version"], "sha256": sha256, "since": since}
