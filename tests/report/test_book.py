"""A small book: built offline and checked, again only when something changed, refused when it has a fault."""

from __future__ import annotations

import html
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import matplotlib
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.folders import locked_folder
from hicp_lib.report import book
from hicp_lib.report.build import make_report
from hicp_lib.report.run import Folders, RunError
from tests.core.untrusted import fill
from tests.report.tiny_study import FINISH, MEASURE, START, write_notebook


def test_report_of_two_notebooks(study):
    lines: list[str] = []
    page = make_report("quick", [("scale", "2")], lines.append, sources=study, root=study)
    built = page.parent
    assert page == study / "_build" / "book" / "quick" / "index.html"
    assert "The seed is 3." in page.read_text(), "the profile's parameter reaches the prose"
    assert "<msup>" in (built / "notebooks" / "00_first.html").read_text(), "formulas need no script"
    assert (built / "results" / "quick" / "01_second" / "t.parquet").is_file()
    for name in ("index", "notebooks/00_first", "notebooks/01_second"):
        text = (built / f"{name}.html").read_text()
        assert "What this page was made with" in text
        assert "thebe" not in text.lower()
        assert "plotly" not in text
        assert "fontawesome.js" not in text and "searchindex.js" not in text
    assert str(page) in lines[-1]

    lines.clear()
    make_report("quick", [("scale", "2")], lines.append, sources=study, root=study)
    assert lines[:3] == ["00_first: unchanged", "01_second: unchanged", "book: unchanged"]

    written = page.read_text()
    page.write_text(written + " ")
    make_report("quick", [("scale", "2")], lines.append, sources=study, root=study)
    assert lines[-2] == "book: built", "a page that was changed is built anew"
    assert "The seed is 3." in page.read_text() and not page.read_text().endswith(" ")

    home, sound = study / "book" / "index.md", page.read_text()
    home.write_text(home.read_text() + "\n[Second](../notebooks/01_second.ipynb), [nowhere](nowhere.md)\n")
    with pytest.raises(RunError, match=r"book: book/index.md:\d+: WARNING: .*'nowhere.md'.*1 in all"):
        make_report("quick", [("scale", "2")], lines.append, sources=study, root=study)
    assert page.read_text() == sound, "a book that cannot be built leaves the last one"
    home.write_text("# Home\n\n![](_static/x.png)\n")
    shutil.copy(matplotlib.get_data_path() + "/images/home.png", study / "book" / "_static" / "x.png")
    with pytest.raises(RunError, match=r"book: index.html: image without alt text: _images/x.png"):
        make_report("quick", [("scale", "2")], lines.append, sources=study, root=study)
    home.write_text("# Home\n\n{{ value('00_first', 'none') }}\n")
    with pytest.raises(InputError, match="needs 'none'"):
        make_report("quick", [("scale", "2")], lines.append, sources=study, root=study)
    assert not list(built.parent.glob(".build-*"))


def write_page(study: Path, text: str) -> None:
    (study / "book" / "index.md").write_text(f"# Home\n\n{text}")


SHOWS = """import pandas as pd
name = "{hostile}"
study.table("names", pd.DataFrame({{name: [name, name]}}), name)
study.note([name])
study.value("name", name)
study.value("names", [name])
pd.DataFrame({{name: [name]}})"""


class Elements(HTMLParser):
    """What of a page would run the alert."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple] = []

    def handle_starttag(self, tag: str, attributes: list) -> None:
        self.found += [
            (tag, name, value)
            for name, value in attributes
            if "alert" in (value or "") and (name.startswith("on") or "script:" in value)
        ]


def test_names_of_the_data_are_text_on_every_page(study):
    hostile = "<svg onload=alert(1)></script><script>alert(1)</script>[a](javascript:alert(1))|`{include}`$x$"
    (study / "a" / hostile.replace("/", "")).mkdir(parents=True)
    write_notebook(
        study / "notebooks" / "00_first.ipynb", START, MEASURE, SHOWS.format(hostile=hostile), FINISH
    )
    write_page(
        study,
        '{{ value("00_first", "name") }} {{ raw("00_first", "names") | join(", ") }}\n\n'
        '{% for row in rows("00_first", "names") %}\n{{ row | join }}\n\n{{ row.values() | join }}\n\n'
        '{% endfor %}\n- {{ raw("00_first", "names")[0] }}\n',
    )
    images = str(study / "a" / hostile.replace("/", ""))
    page = make_report("quick", [("images", images)], print, sources=study, root=study)
    for path in page.parent.rglob("*.html"):
        text, elements = path.read_text(), Elements()
        elements.feed(text)
        assert not elements.found, path
        assert not re.search(r"<script[^>]*>alert", text) and "<svg onload" not in text, path
        assert "\\(x\\)" not in text, path  # the name's dollars are no formula's
    shown = html.unescape(re.sub("<[^>]*>", "", page.read_text()))
    assert shown.count(hostile) >= 5


@pytest.mark.parametrize(
    ("profile", "pairs", "expected"),
    [
        ("quik", [], "profile 'quik' is not known; expected one of: full, quick"),
        ("quick", [("sed", "1")], "-p: parameter 'sed' is not known"),
        ("quick", [("images", "/nowhere")], "/nowhere: does not exist; parameter 'images'"),
    ],
)
def test_mistakes_are_told_before_anything_runs(study, profile, pairs, expected):
    with pytest.raises(InputError, match=expected):
        make_report(profile, pairs, print, sources=study, root=study)
    assert not Folders(study, study, profile).results.exists()


def test_two_reports_of_one_profile_do_not_mix(study):
    with locked_folder(Folders(study, study, "quick").executed):
        with pytest.raises(InputError, match="another command writes there"):
            make_report("quick", [], print, sources=study, root=study)


def test_a_book_is_not_shown_for_sources_that_were_edited_while_it_was_built(study, monkeypatch):
    run_sphinx = book._run_sphinx

    def and_edit(*arguments):
        built = run_sphinx(*arguments)
        (study / "book" / "index.md").write_text("# Other\n")
        return built

    monkeypatch.setattr(book, "_run_sphinx", and_edit)
    with pytest.raises(
        RunError, match="book: what it is made of was changed while it was built; run the report"
    ):
        make_report("quick", [], print, sources=study, root=study)
    assert not (study / "_build" / "book" / "quick").exists()
    monkeypatch.undo()
    values = study / "results" / "quick" / "00_first" / "values.json"
    values.write_text('{"seed": 4}')
    with pytest.raises(RunError, match="book: the results of 00_first were changed; run the report again"):
        book.build_book(Folders(study, study, "quick"))


def test_a_report_imports_nothing_from_the_working_folder(study, tmp_path_factory, monkeypatch):
    folder = tmp_path_factory.mktemp("untrusted") / "data"
    marker = fill(folder)
    monkeypatch.chdir(folder)
    fill(study / "notebooks")  # where kernels work
    make_report("quick", [("images", str(folder))], print, sources=study, root=study)
    assert not marker.exists() and not (study / "imported").exists()
