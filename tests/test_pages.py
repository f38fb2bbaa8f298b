"""The built pages as readers meet them: in a browser, wide and narrow, light and dark, by keys."""

from __future__ import annotations

import importlib.resources
import json
import re
from pathlib import Path

import pytest
from bs4 import BeautifulSoup

MOST_BYTES = 1_200_000  # of a page with all it loads, but for 3D scenes
SCENES = "plotly.js"
# A page is judged as it stays: with its fonts, measured by its own script, colours no longer in transition.
JUDGE = """
  const done = arguments[0];
  const frame = () => new Promise(requestAnimationFrame);
  const transitions = () => document.getAnimations().filter(one => one instanceof CSSTransition);
  document.fonts.ready.then(frame).then(frame)
    .then(() => Promise.allSettled(transitions().map(({finished}) => finished)))
    .then(frame)
    .then(() => axe.run({preload: false, resultTypes: ["violations"]}))
    .then(
      ({violations}) => done(violations.flatMap(({id, nodes}) => nodes.map(({html}) => `${id}: ${html}`))),
      error => done([`${error}`]),
    );
"""
# Rows of a table are alike; the rules take seconds for hundreds of cells.
SHORTEN = "document.querySelectorAll('tr:nth-child(n + 5)').forEach(row => row.remove())"
WIDTH_PX = "return document.documentElement.scrollWidth"
N_SHOWN = "return [...document.querySelectorAll('.cell_input')].filter(code => code.offsetHeight).length"
IS_ENLARGED = "return document.querySelector('dialog.hicp-enlarged')?.open ?? false"


def pages(book: Path) -> list[Path]:
    """All pages, but of those made from docstrings, which are alike, the shortest."""
    found = sorted(path for path in book.rglob("*.html") if "_static" not in path.parts)
    alike = [path for path in found if path.parent.name == "api" or path.stem in ("genindex", "py-modindex")]
    shortest = sorted(alike, key=lambda path: path.stat().st_size)[:1]
    return [path for path in found if path not in alike] + shortest


def look(browser, width_px: int, mode: str) -> None:
    """Give the browser this width and colour scheme."""
    size = {"width": width_px, "height": 1000, "deviceScaleFactor": 1, "mobile": width_px < 600}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    scheme = [{"name": "prefers-color-scheme", "value": mode}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": scheme})


@pytest.mark.browser
@pytest.mark.parametrize("width_px", [1280, 390])
@pytest.mark.parametrize("mode", ["light", "dark"])
def test_every_page_can_be_read_by_everybody(book, browser, mode, width_px):
    rules = (importlib.resources.files("axe_playwright_python") / "axe.min.js").read_text()
    look(browser, width_px, mode)
    problems = []
    for path in pages(book):
        browser.get(path.as_uri())
        wide_px = browser.execute_script(WIDTH_PX) - width_px
        browser.execute_script(SHORTEN)
        browser.execute_script(rules)
        found = browser.execute_async_script(JUDGE)
        found += [f"{wide_px} px wider than the window"] if wide_px > 0 else []
        found += [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
        problems += [f"{path.relative_to(book)}: {one[:200]}" for one in found]
    assert problems == []


@pytest.mark.browser
def test_code_is_shown_when_asked_for_and_on_the_next_page_too(book, browser):
    look(browser, 1280, "light")
    first, second = sorted((book / "notebooks").glob("*.html"))[:2]
    browser.get(first.as_uri())
    n_read = len(browser.find_elements("css selector", ".tag_look-inside, .tag_try-it"))
    assert browser.execute_script(N_SHOWN) == n_read
    browser.find_element("class name", "hicp-show-code").send_keys("\n")
    assert browser.execute_script(N_SHOWN) == len(browser.find_elements("class name", "cell_input")) > n_read
    browser.get(second.as_uri())
    assert browser.execute_script(N_SHOWN) == len(browser.find_elements("class name", "cell_input"))
    browser.find_element("class name", "hicp-show-code").send_keys("\n")


@pytest.mark.browser
def test_a_figure_is_enlarged_and_put_back_by_keys(book, browser):
    look(browser, 390, "light")
    browser.get((book / "notebooks" / "02_evaluation_2d.html").as_uri())
    figure = browser.find_element("css selector", "a.hicp-zoom")
    figure.send_keys("\n")
    assert browser.execute_script(IS_ENLARGED)
    browser.switch_to.active_element.send_keys("\n")
    assert not browser.execute_script(IS_ENLARGED)
    assert browser.switch_to.active_element == figure


def test_no_page_loads_more_than_a_slow_line_carries(book):
    heavy = {}
    for path in book.rglob("*.html"):
        page = BeautifulSoup(path.read_text(), "html.parser")
        links = page.find_all("link", rel=["stylesheet", "preload"])
        named = [str(tag["href"]) for tag in links]
        named += [
            tag["src"] for tag in page.find_all(["script", "img", "video"], src=re.compile("^(?!data:)"))
        ]
        files = {path.parent / name.split("?")[0] for name in named if "{{" not in name}
        n_bytes = path.stat().st_size + sum(one.stat().st_size for one in files if one.name != SCENES)
        n_bytes -= sum(len(str(scene)) for scene in page.find_all(class_="hicp-scene"))
        if n_bytes > MOST_BYTES:
            heavy[path.relative_to(book).as_posix()] = n_bytes
    assert heavy == {}


def test_search_finds_what_pages_say(book):
    text = (book / "searchindex.js").read_text()
    index = json.loads(text.removeprefix("Search.setIndex(").removesuffix(")"))
    assert "notebooks/02_evaluation_2d" in index["docnames"]

    def n_found(word: str) -> int:
        """Of the notebooks' pages."""
        found = index["terms"].get(word, [])
        numbers = found if isinstance(found, list) else [found]
        return sum(index["docnames"][number].startswith("notebooks/") for number in numbers)

    n_notebooks = len(list((book / "notebooks").glob("*.html")))
    assert 0 < n_found("headless") < n_notebooks, "part of a package's name, which every page was made with"
    assert n_found("wall") < n_notebooks, "every stamp's wall time"
    assert n_found("plt") == n_found("groupbi") == 0, "code"


def test_a_table_has_a_caption_and_no_two_parts_of_a_page_have_one_name(book):
    for path in (book / "notebooks").glob("*.html"):
        page = BeautifulSoup(path.read_text(), "html.parser")
        names = [tag["id"] for tag in page.find_all(id=True)]
        assert len(names) == len(set(names)), path
        assert all(table.caption and table.caption.get_text() for table in page.find_all("table")), path
