"""What the page on scope lists of the paper, and that it leads somewhere."""

import re

import pytest

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json
from hicp_lib.detectors.registry import DETECTORS

PAPER = read_json(DATA_DIR / "paper.json")
STATES = re.findall(r"^\| ([a-z ]+) \| (?!means)", (CHECKOUT / "book" / "scope.md").read_text(), re.MULTILINE)


def numbered(word: str, kind: str) -> list[str]:
    """Numbers of the figures or tables that are listed, those in halves once."""
    found = [re.match(rf"{word} (\w+)[,:]", row["item"]) for row in PAPER["items"] if row["kind"] == kind]
    return list(dict.fromkeys(match[1] for match in found if match))


def test_every_figure_and_table_is_listed_in_order():
    assert numbered(r"Fig\.", "figure") == list("12345678")
    assert numbered("Table", "table") == ["I", "II", "III", "IV"]
    assert {"number", "experiment", "future work"} < {row["kind"] for row in PAPER["items"]}


@pytest.mark.parametrize("row", PAPER["items"], ids=lambda row: row["item"])
def test_an_item_has_a_state_that_the_page_explains_a_reason_and_a_page(row):
    assert set(row) == {"kind", "item", "section", "page", "state", "why"} and row["why"]
    assert row["state"] in STATES
    if row["page"]:
        assert (CHECKOUT / "notebooks" / f"{row['page']}.ipynb").is_file()
    else:
        assert row["state"] in ("left out", "not known")


@pytest.mark.parametrize("number", [row["item"].partition(":")[0] for row in PAPER["items"][:9]])
def test_a_page_that_has_a_figures_counterpart_says_so(number):
    row = next(row for row in PAPER["items"] if row["item"].startswith(number))
    text = (CHECKOUT / "notebooks" / f"{row['page']}.ipynb").read_text()
    digit = re.search(r"\d", number)[0]
    assert re.search(rf"Serves [^(]*\bFigs?\. (?:\d(?:, \d)*(?: and )?)*{digit}\b", text)


def test_points_of_the_body_are_counted_as_in_the_papers_table():
    for name, n_points in PAPER["detectors"]["body_points"].items():
        assert DETECTORS[name].facts.keypoints.startswith(f"{n_points} of the body")
