"""Under the title of a notebook's page stands what of its run is real and what is simulated."""

from __future__ import annotations

import nbformat
import pytest

from hicp_lib.core.files import write_json
from hicp_lib.report.book import _with_data_note
from hicp_lib.report.prose import Results
from tests.report.tiny_study import write_notebook


@pytest.mark.parametrize(
    ("parameters", "note", "expected"),
    [
        (
            {"detectors": ["a"]},
            "rendered people (9 scenes)",
            "**Real detectors · rendered people (9 scenes)**",
        ),
        ({"body": "a"}, "COCO images", "**Real detectors · COCO images**"),
        ({"n_scenes": 9}, "rendered people", "**Rendered people**"),
        ({"detector": "a"}, "recording <b>*x*", "**Real detectors · recording &#60;b&#62;&#42;x&#42;**"),
        ({"detectors": ["a"]}, None, "With $x^2$."),
    ],
)
def test_the_line_under_a_title(tmp_path, parameters, note, expected):
    executed = write_notebook(tmp_path / "executed" / "05_tiny.ipynb", "1")
    folder = tmp_path / "results" / "05_tiny"
    write_json(folder / "values.json", {"n": 1} | ({"data_note": note} if note else {}))
    write_json(folder / "provenance.json", {"parameters": parameters})
    text = _with_data_note(executed, Results(tmp_path / "results", "quick"))
    lines = nbformat.reads(text, as_version=4).cells[0].source.split("\n")
    assert lines[:3] == ["# About 05_tiny", "", expected]
    assert lines[-1] == "With $x^2$."
