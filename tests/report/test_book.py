"""A small book: built offline and checked, again only when something changed, refused when it has a fault."""

from __future__ import annotations

import shutil

import matplotlib
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import locked_folder
from hicp_lib.report.build import make_report
from hicp_lib.report.run import Folders, RunError


def test_report_of_two_notebooks(study):
    lines: list[str] = []
    page = make_report("quick", [("scale", "2")], lines.append, sources=study, root=study)
    book = page.parent
    assert page == study / "_build" / "book" / "quick" / "index.html"
    assert "The seed is 3." in page.read_text(), "the profile's parameter reaches the prose"
    assert "mathjax.js" in page.read_text()
    assert (book / "_static" / "mathjax.js").stat().st_size > 1e6
    assert (book / "results" / "quick" / "01_second" / "t.parquet").is_file()
    for name in ("index", "notebooks/00_first", "notebooks/01_second"):
        html = (book / f"{name}.html").read_text()
        assert "What this page was made with" in html
        assert "thebe" not in html.lower()
        assert "plotly" not in html
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
    assert not list(book.parent.glob(".build-*"))


@pytest.mark.parametrize(
    ("profile", "pairs", "expected"),
    [
        ("quik", [], "has no profile 'quik'; choose one of full, quick"),
        ("quick", [("sed", "1")], "-p sed: no notebook has such a parameter"),
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
