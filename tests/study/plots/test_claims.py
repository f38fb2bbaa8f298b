"""The figure of the claims counts what the table says."""

import pandas as pd
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.study.claims.verdicts import VERDICTS
from hicp_lib.study.plots import claims as plots


def test_every_claim_is_counted_once():
    rows = [("IV-A", VERDICTS[0]), ("IV-A", VERDICTS[0]), ("IV-C", VERDICTS[2]), ("III-A", VERDICTS[3])]
    figure = plots.verdicts(pd.DataFrame(rows, columns=["section", "verdict"]))
    counts = figure.table.set_index(["section", "verdict"])["claims"]
    assert counts.sum() == len(rows)
    assert counts["IV-A", VERDICTS[0]] == 2 and counts["IV-C", VERDICTS[0]] == 0
    assert f"2 {VERDICTS[0]}" in figure.caption and "0 reproduced on rendered" in figure.alt


def test_a_section_without_claims_is_refused():
    with pytest.raises(InputError, match='such as "IV-A"'):
        plots.verdicts(pd.DataFrame({"section": [], "verdict": []}))
