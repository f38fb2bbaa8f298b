"""Notebooks and pages read the same everywhere: plain Markdown, whose links lead somewhere."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
import pytest

from hicp_lib.core.checkout import CHECKOUT

# Roles, directives, targets and block breaks of MyST, which only Sphinx reads.
RAW_MARKUP = re.compile(r"\{[a-z][a-z:-]*\}`|^ *(?:`{3,}|:{3,})\{|^\+\+\+|^\([\w-]+\)=$", re.MULTILINE)
LINK = re.compile(r"\]\(([^)\s]+)\)")
CITATION = re.compile(r"\[[^]]*\b(?:19|20)\d\d\]\((https://[^)]+)\)")
REFERENCES = CHECKOUT / "book" / "references.md"
PAGES = [*sorted((CHECKOUT / "notebooks").glob("*.ipynb")), *sorted((CHECKOUT / "book").glob("*.md"))]


def prose(path: Path) -> str:
    """The Markdown of a notebook or page."""
    if path.suffix == ".md":
        return path.read_text()
    cells = nbformat.read(path, as_version=4).cells
    return "\n\n".join(cell.source for cell in cells if cell.cell_type == "markdown")


@pytest.mark.parametrize("text", ["see {doc}`x`", "{cite:p}`x`", "```{note}", "+++", "(here)="])
def test_raw_markup_is_recognised(text):
    assert RAW_MARKUP.search(text)


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_a_page_is_plain_markdown_whose_links_lead_to_files(path):
    text = prose(path)
    assert RAW_MARKUP.findall(text) == []
    for target in LINK.findall(text):
        if "{{" in target or target.startswith("https://"):
            continue  # a template's, checked in the built book
        assert (path.parent / target.partition("#")[0]).is_file(), target


def test_what_is_cited_is_in_the_references_and_nothing_else():
    cited = {url for path in PAGES for url in CITATION.findall(prose(path))}
    listed = set(LINK.findall(prose(REFERENCES)))
    assert cited == listed


def test_every_link_of_the_book_leads_to_a_file_in_it(book):
    for page in book.rglob("*.html"):
        for target in re.findall(r'<a [^>]*href="([^"#?:]+)["#?]', page.read_text()):
            assert (page.parent / target).exists(), f"{page.relative_to(book)}: {target}"
