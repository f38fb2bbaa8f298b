"""The built book in Chromium, from disk: what its pages offer to explore opens, and loads only then."""

from __future__ import annotations

import pytest

from hicp_lib.core.checkout import CHECKOUT
from tests.study.test_explore import find, wait

pytestmark = pytest.mark.browser

NOTEBOOKS = sorted(path.stem for path in (CHECKOUT / "notebooks").glob("*.ipynb"))
OFFERED = {
    "02_evaluation_2d": ["crops"],
    "04_mocap_3d": ["films"],
    "05b_dose_curves": ["doses"],
    "06_hri_avoidance": ["films"],
}
MOST_BYTES = 4_000_000


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_what_a_page_offers_opens(name, book, browser):
    browser.get_log("browser")
    browser.get((book / "notebooks" / f"{name}.html").as_uri())
    loaded = browser.execute_script("return performance.getEntriesByType('resource').map(one => one.name)")
    assert [address for address in loaded if "plotly" in address or "data.js" in address] == []
    places = find(browser, ".hicp-explorer[data-explorer]")
    assert [place.get_attribute("data-explorer") for place in places] == OFFERED.get(name, [])
    for summary in find(browser, ".hicp-explorer summary"):
        browser.execute_script("arguments[0].click()", summary)
        wait(browser, "return document.querySelector('.hicp-explorer svg[role=img]') !== null")
        assert "cannot be explored" not in find(browser, ".hicp-explorer")[0].text
    for scene in find(browser, ".hicp-scene"):
        browser.execute_script("arguments[0].scrollIntoView()", scene)
        wait(browser, "return document.querySelector('.js-plotly-plot .modebar-btn') !== null", 60)
    said = [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert [message for message in said if "pydata-sphinx-theme.js" not in message] == []


def test_claims_can_be_sorted_and_filtered(book, browser):
    browser.get((book / "notebooks" / "07_claims.html").as_uri())
    rows = find(browser, '[data-explorer="table"] tbody tr')
    first, second = find(browser, ".hicp-filter")
    assert len(rows) == sum(int(bar.text.split(" of ")[-1].split()[0]) for bar in (first, second))
    find(browser, ".hicp-filter input[type=search]")[0].send_keys("IV-A")
    shown = [row for row in rows if row.is_displayed()]
    assert 0 < len(shown) < len(rows)


def test_what_is_explored_is_small(book):
    for folder in (book / "results" / "quick").glob("*/*/"):
        assert sum(path.stat().st_size for path in folder.iterdir()) < MOST_BYTES, folder
