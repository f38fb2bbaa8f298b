"""A built page shows files, draws its icons, and names its tables."""

from __future__ import annotations

import pytest
from bs4 import BeautifulSoup
from PIL import Image

from hicp_lib.report.pages import drop_icon_font, finish_page

FIGURE = """<figure class="hicp" id="a"><img src="data:image/webp;base64,AA" alt="A line">
<figcaption>A caption. <span><a href="../results/a.webp" download>WEBP</a></span></figcaption></figure>"""


@pytest.fixture
def book(tmp_path):
    for folder in ("_static/scripts", "_static/styles", "notebooks", "results"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "_static/scripts/fontawesome.js").write_text('{bars:[448,512,["navicon"],"f0c9","M0 96z"]}')
    Image.new("RGB", (30, 20)).save(tmp_path / "results" / "a.webp")
    return tmp_path


def finished(book, body: str, name: str = "notebooks/x.html") -> BeautifulSoup:
    page = BeautifulSoup(body, "html.parser")
    finish_page(page, book / name, book)
    return page


def test_a_figure_shows_its_file_and_leads_to_it(book):
    page = finished(book, FIGURE)
    assert page.img["src"] == page.a["href"] == "../results/a.webp"
    assert (page.img["width"], page.img["height"], page.img["alt"]) == (30, 20, "A line")
    assert page.img.parent["class"] == ["hicp-zoom"]


def test_a_chart_is_told_from_a_picture_by_its_drawing(book):
    (book / "results" / "a.svg").touch()
    assert finished(book, FIGURE).img.parent["class"] == ["hicp-zoom", "hicp-chart"]


def test_scripts_that_can_wait_do(book):
    names = ("doctools", "documentation_options", "togglebutton", "hicp")
    page = finished(book, "".join(f'<script src="../_static/{name}.js?v=1"></script>' for name in names))
    assert [tag.has_attr("defer") for tag in page.find_all("script")] == [True, False, True, False]
    assert finished(book, '<link as="script" href="a.js" rel="preload">').link is None


def test_a_figure_without_a_file_stays_as_it_is(book):
    bare = '<figure class="hicp"><img src="data:image/png;base64,AA" alt="A"></figure>'
    assert str(finished(book, bare)) == str(BeautifulSoup(bare, "html.parser"))
    assert finished(book, '<figure class="hicp"><figcaption>A scene.</figcaption></figure>').a is None


def test_a_heading_keeps_a_name_that_a_figure_has_too(book):
    page = finished(book, f'<section id="a"><h2>A</h2>{FIGURE}</section>')
    assert [tag.name for tag in page.find_all(id="a")] == ["section"]


def test_icons_are_drawn_without_a_script(book):
    scripts = '<script src="s/fontawesome.js"></script><script src="searchindex.js?v=1"></script>'
    icon = '<i class="theme-switch fa-solid fa-bars" data-mode="light"></i>'
    page = finished(book, scripts + icon)
    assert page.find("script") is None
    assert page.svg["data-mode"] == "light" and page.svg.path["d"] == "M0 96z"
    assert [tag["src"] for tag in finished(book, scripts, "search.html").find_all("script")] == [
        "searchindex.js?v=1"
    ]


@pytest.mark.parametrize(
    ("around", "caption"),
    [
        (
            "<figure><div class='hicp-table'>{}</div><figcaption>Both. <a>CSV</a></figcaption></figure>",
            "Both. ",
        ),
        ("<h2>Sizes<a>#</a></h2>{}", "Sizes"),
        ("<h2>Sizes</h2><details><summary>Made with</summary>{}</details>", "Made with"),
    ],
)
def test_a_table_is_told_by_a_caption(book, around, caption):
    page = finished(book, around.format("<table><tr><th></th><th>n</th></tr></table>"))
    assert page.caption.text == caption
    assert page.table.parent["class"] in (["hicp-table"], "hicp-table")
    assert [cell.name for cell in page.tr.find_all(["td", "th"])] == ["td", "th"]


def test_a_style_sheet_stays_where_a_page_needs_it(book):
    sheet = '<link rel="stylesheet" href="sphinx-design.min.css">'
    assert finished(book, sheet).link is None
    assert finished(book, f'{sheet}<div class="sd-card"></div>').link is not None


def test_the_style_sheet_loses_letters_and_nothing_else(book):
    sheet = book / "_static" / "styles" / "pydata-sphinx-theme.css"
    kept = ".toc .fa-bars{font-size:1rem}"
    sheet.write_text('.fa-x:before,.fa-y:before{content:"\\f00d"}' + kept)
    drop_icon_font(book)
    assert sheet.read_text() == kept
