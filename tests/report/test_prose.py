"""Pages take their numbers from result files; a name that is not there stops the build."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.report.prose import Results, render_page


@pytest.fixture
def results(tmp_path: Path) -> Results:
    folder = tmp_path / "results" / "02_x"
    folder.mkdir(parents=True)
    (folder / "values.json").write_text(json.dumps({"ap": 0.98765, "n": 7, "absent": None}))
    (folder / "captions.json").write_text(
        json.dumps({"f": {"file": "f.png", "caption": "A & B", "alt": 'Says "no"'}})
    )
    (folder / "provenance.json").write_text(json.dumps({"wall_s": 1.5}))
    pd.DataFrame({"name": ["a|b"], "ap": [np.nan]}).to_parquet(folder / "t.parquet")
    return Results(tmp_path / "results", "quick")


def rendered(tmp_path: Path, results: Results, text: str) -> str:
    page = tmp_path / "page.md"
    page.write_text(text)
    return render_page(page, results, "quick")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('{{ value("02_x", "ap") }}', "0.98765"),
        ('{{ value("02_x", "n") }}', "7"),
        ('{{ value("02_x", "absent") }}', "not run"),
        ('{% if raw("02_x", "absent") is none %}none{% endif %}', "none"),
        ('{{ stamp("02_x").wall_s }} {{ notebooks | join }} {{ profile }}', "1.5 02_x quick"),
        ('{% for row in rows("02_x", "t") %}{{ row.name }} {{ row.ap }}{% endfor %}', "a&#124;b None"),
        ("$T_{a\\,b}$ {cite}`x` {doc}`y`", "$T_{a\\,b}$ {cite}`x` {doc}`y`"),
    ],
)
def test_pages_are_filled(tmp_path, results, text, expected):
    assert rendered(tmp_path, results, text) == expected


def test_figures_carry_their_words(tmp_path, results):
    page = rendered(tmp_path, results, '{{ figure("02_x", "f") }}')
    assert 'src="results/quick/02_x/f.png" alt="Says &#34;no&#34;"' in page
    assert "<figcaption>A &#38; B" in page
    assert 'href="notebooks/02_x.html#f"' in page


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('{{ value("02_x", "aq") }}', "needs 'aq'; the notebook recorded ap, n, absent"),
        ('{{ value("03_y", "ap") }}', "03_y/values.json: cannot be read"),
        ('{{ rows("02_x", "u") }}', "u.parquet: a page of the book needs this table"),
        ("{{ nothing }}", "page.md: 'nothing' is undefined"),
        ("a\n{% if %}", "page.md, line 2: "),
    ],
)
def test_what_is_not_there_stops_the_build(tmp_path, results, text, expected):
    with pytest.raises(InputError) as error:
        rendered(tmp_path, results, text)
    assert expected in str(error.value)
    assert "\n" not in str(error.value)
