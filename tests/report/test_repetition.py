"""A run beside the reference run: which outputs agree, and how nearly."""

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.files import read_json
from hicp_lib.report import prose
from hicp_lib.report.prose import Results, render_page
from hicp_lib.report.repetition import VERDICTS, compare

TABLE = pd.DataFrame(
    {
        "detector": ["a", "b", "c", "d"],
        "ap": [0.5, 0.4, np.nan, 0.8],
        "ap_low": [0.45, 0.35, np.nan, 0.7],
        "ap_high": [0.55, 0.45, np.nan, 0.9],
        "n": [3, 4, 5, 6],
        "time_ms": [1.0, 2.0, 3.0, 4.0],
    }
)


def page(folder: Path, table: pd.DataFrame = TABLE, n: int = 3, time: float = 1.0, **values: object) -> Path:
    """Results of a notebook: three values of which one is measured, a table, a drawing of it, and times."""
    folder.mkdir(parents=True)
    shown = {"times": {"median_time_ms": time, "n": 4}, "ap": 0.5, "why": None} | values
    stamp = {
        "git": {"commit": "c0ffee", "changed_files": 0},
        "machine": {"cpu": "x", "cores": 2},
        "parameters": {"n": n},
    }
    for name, content in (
        ("values", shown),
        ("provenance", stamp),
        ("captions", {"metrics": {}, "curve": {"alt": ""}, "picture": {"alt": ""}, "time": {}}),
    ):
        (folder / f"{name}.json").write_text(json.dumps(content))
    table.to_parquet(folder / "metrics.parquet")
    pd.DataFrame({"x": range(1001)}).to_parquet(folder / "curve.parquet")
    pd.DataFrame({"ms": [time]}).to_parquet(folder / "time.parquet")
    pd.DataFrame({"ms": [time]}).to_parquet(folder / "saved.parquet")
    return folder


@pytest.fixture
def reference(tmp_path, monkeypatch):
    """The reference run of a profile "full", as the tool keeps it of one notebook."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "tools")
    import reference as tool

    page(tmp_path / "made" / "full" / "02_x")
    for module in (prose, tool):
        monkeypatch.setattr(module, "REFERENCE_DIR", tmp_path / "reference")
    monkeypatch.setattr(sys, "argv", ["reference", str(tmp_path / "made" / "full")])
    tool.main()
    return tmp_path / "reference" / "full"


def counts(reference: Path, own: Path) -> list[int]:
    verdicts = compare(reference, own)[0]["verdict"].tolist()
    return [verdicts.count(verdict) for verdict in VERDICTS]


def test_what_is_kept_is_what_pages_show_of_one_commit(reference, tmp_path):
    kept = sorted(path.name for path in (reference / "02_x").iterdir())
    assert kept == ["metrics.parquet", "provenance.json", "values.json"]
    made = tmp_path / "made" / "full"
    import reference as tool

    stamp = made / "02_x" / "provenance.json"
    for key, value, said in (("commit", "decaf", "of 2 commits"), ("changed_files", 2, "03_y with changed")):
        page(made / "03_y")
        other = read_json(stamp)
        other["git"][key] = value
        (made / "03_y" / "provenance.json").write_text(json.dumps(other))
        with pytest.raises(SystemExit, match=said):
            tool.keep(made, reference)
        for path in (made / "03_y").iterdir():
            path.unlink()
        (made / "03_y").rmdir()
    with pytest.raises(SystemExit, match="holds no results"):
        tool.keep(tmp_path / "nowhere", reference)
    assert (reference / "02_x" / "values.json").exists()


def test_the_same_run_is_the_same_whatever_its_times(reference, tmp_path):
    page(tmp_path / "own" / "02_x", time=7.0)
    # Three values, and of four rows the estimate and the count; names, bounds and times are no outputs.
    assert counts(reference, tmp_path / "own") == [11, 0, 0, 0]


@pytest.mark.parametrize(
    ("column", "own", "expected"),
    [
        ("ap", [0.5 + 1e-9, 0.4, np.nan, 0.8], [10, 1, 0, 0]),
        ("ap", [0.53, 0.36, np.nan, 0.8], [9, 0, 2, 0]),
        ("ap", [0.56, 0.4, 0.1, np.nan], [8, 0, 0, 3]),
        ("n", [3, 4, 5, 7], [10, 0, 0, 1]),  # without an interval
        ("n", ["3", "4", "5", "6"], [7, 0, 0, 4]),
        ("ap_low", [0.1, 0.1, np.nan, 0.1], [11, 0, 0, 0]),
    ],
)
def test_how_nearly_an_output_agrees(reference, tmp_path, column, own, expected):
    page(tmp_path / "own" / "02_x", TABLE.assign(**{column: own}))
    assert counts(reference, tmp_path / "own") == expected


def test_what_only_one_run_has_is_outside(reference, tmp_path):
    page(tmp_path / "own" / "02_x", TABLE.iloc[:3], new=1)
    assert counts(reference, tmp_path / "own") == [9, 0, 0, 3]
    (tmp_path / "own" / "02_x" / "metrics.parquet").unlink()
    assert counts(reference, tmp_path / "own") == [3, 0, 0, 9]


def test_other_parameters_are_not_compared(reference, tmp_path):
    page(tmp_path / "own" / "02_x", n=4)
    rows, left_out = compare(reference, tmp_path / "own")
    assert rows.empty and left_out == {"02_x": "was run with other parameters"}
    assert compare(reference, tmp_path / "none")[1] == {"02_x": "was not run"}


def test_the_page_s_figures(reference, tmp_path):
    own = tmp_path / "own"
    page(own / "02_x", TABLE.assign(ap=[0.53, 0.4, np.nan, 0.1]))
    found = Results(own, "full").repetition()
    assert found["stamp"]["git"]["commit"] == "c0ffee"
    text = (CHECKOUT / "book" / "environment.md").read_text().split("## The same")[1].split("For scale")[0]
    (tmp_path / "page.md").write_text(text)
    lines = render_page(tmp_path / "page.md", Results(own, "full"), "full").splitlines()
    assert "**10 of 11** outputs (90.9 %) are within tolerance." in lines
    assert "| 02_x | 11 | 9 | 0 | 1 | 1 |" in lines
    start = lines.index("The first of the 1 outside tolerance:")
    assert lines[start + 4 : start + 6] == ["| 02_x | metrics, ap, row 4 | 0.8000 | 0.1000 |", ""]
    assert Results(own, "quick").repetition() is None
    page(tmp_path / "other" / "02_x", n=4)
    nothing = Results(tmp_path / "other", "full").repetition()
    assert (nothing["counts"], nothing["left_out"]) == ([], {"02_x": "was run with other parameters"})
