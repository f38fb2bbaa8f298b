"""The built pages as readers meet them: in a browser, wide and narrow, light and dark, and on paper."""

from __future__ import annotations

import importlib.resources
from pathlib import Path

import pytest

LIGHT_AND_DARK, WIDTHS_PX = ("light", "dark"), (1280, 390)
MOST_BYTES = 1_200_000
WITHOUT_WORDS = "api/"  # made from docstrings, all in the same way: one of them is looked at
JUDGE = """
  const done = arguments[0];
  axe.run({resultTypes: ["violations"]}).then(
    ({violations}) => done(violations.flatMap(({id, nodes}) => nodes.map(({html}) => `${id}: ${html}`))),
    error => done([`${error}`]),
  );
"""


def pages(book: Path) -> list[Path]:
    found = sorted(path for path in book.rglob("*.html") if "_static" not in path.parts)
    library = [path for path in found if path.parent.name == "api"]
    return [path for path in found if path not in library[1:]]


@pytest.mark.browser
@pytest.mark.parametrize("width_px", WIDTHS_PX)
@pytest.mark.parametrize("mode", LIGHT_AND_DARK)
def test_every_page_can_be_read_by_everybody(book, browser, mode, width_px):
    rules = (importlib.resources.files("axe_playwright_python") / "axe.min.js").read_text()
    browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": ""})
    size = {"width": width_px, "height": 1000, "deviceScaleFactor": 1, "mobile": width_px < 600}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    scheme = [{"name": "prefers-color-scheme", "value": mode}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": scheme})
    problems = []
    for path in pages(book):
        browser.get(path.as_uri())
        browser.execute_script(rules)
        found = browser.execute_async_script(JUDGE)
        wide = browser.execute_script("return document.documentElement.scrollWidth") - width_px
        found += [f"{wide} px wider than the window"] if wide > 0 else []
        found += [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
        problems += [f"{path.relative_to(book)}: {one[:200]}" for one in found]
    assert problems == []
