"""Text of data is shown as it is: in Markdown, its tables and links, in HTML and its attributes."""

from __future__ import annotations

import html

import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from hicp_lib.core.escape import escaped

HOSTILE = (
    "<svg onload=alert(1)>", "</script><script>alert(1)</script>", '"><img src=x onerror=alert(1)>',
    "[x](javascript:alert(1))", "![x](x)", "a | b", "`code`", "**bold** _it_ *it*", "{include}`/etc/passwd`",
    "```{eval-rst}\n.. include:: /etc/passwd\n```", "$\\frac{a}{b}$ $$x$$ \\(y\\)", "{{ value }} {% raw %}",
    "# title", "- item", "+ item", "1. item", "---", "> quote", "a\n\nb\r\nc", ":::{note}",
    "% comment", "&lt;b&gt;",
    "(target)=", "[^1]", "<!-- -->", "http://a.org", "a\\|b", "~~~", "\x1b[31m\u202e",
)  # fmt: skip


@pytest.mark.parametrize("text", HOSTILE)
def test_it_is_seen_and_nothing_else(text):
    seen = "".join(c if c.isprintable() else "\ufffd" for c in " ".join(text.split()))
    assert html.unescape(escaped(text)) == seen
    table = MarkdownIt().enable("table").render(f"| a |\n|---|\n| x {escaped(text)} |\n")
    cell = table.partition("<td>")[2].partition("</td>")[0]
    assert html.unescape(cell) == f"x {seen}" and "<" not in cell
    line = MarkdownIt().render(f"In {escaped(text)}")
    assert html.unescape(line.strip()) == f"<p>In {seen}</p>"


@given(st.text(max_size=40))
def test_any_text_stays_one_line_without_markup(text):
    assert not set('<>"|`*[]{}$\\#&;\n') & set(escaped(text).replace("&#", "").replace(";", ""))


def test_numbers_and_usual_names_are_left_alone():
    for text in ("0.71", "-0.5 %", "motion_capture, 12 frames (d435)", "Würfel 3/4"):
        assert escaped(f"a {text}") == f"a {text}"


def test_spaces_at_the_ends_stay_between_what_is_joined():
    assert escaped(", ") == ", " and escaped(" b\n\n ") == " b "
    assert MarkdownIt().render(escaped("  - item")) == "<p> - item</p>\n"
