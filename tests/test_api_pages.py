"""The reference of the library: every module and every public function is on a page of the book."""

from __future__ import annotations

import importlib
import io
import re
import sys
from typing import ClassVar

import pytest
from docutils import nodes
from docutils.core import publish_doctree
from docutils.parsers.rst import Directive, directives

from hicp_lib.core.checkout import CHECKOUT
from tests.docstrings import MODULES, public_objects

sys.path.insert(0, str(CHECKOUT / "book" / "_ext"))
from api_reference import pages  # noqa: E402

PAGES = pages(CHECKOUT / "hicp_lib")
WARNING = 2  # docutils' level
PACKAGES = sorted({name.split(".")[1] for name in MODULES if "." in name})


def test_every_package_has_a_page():
    assert sorted(PAGES) == PACKAGES


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_function_is_on_the_page_of_its_package(package):
    text = PAGES[package]
    modules = re.split(r"^\.\. py:module:: (\S+)$", text, flags=re.MULTILINE)
    described = dict(zip(modules[1::2], modules[2::2], strict=True))
    for name in MODULES:
        if not name.startswith(f"hicp_lib.{package}."):
            continue
        objects = list(public_objects(importlib.import_module(name)))
        assert name in described or not objects and MODULES[name].name == "__init__.py", name
        for path, value in objects:
            if not value.__doc__ and "." in path:
                continue
            last = path.rpartition(".")[2]
            assert re.search(rf"^ *\.\. py:\w+:: {last}\b", described[name], re.MULTILINE), f"{name}.{path}"


class _Described(Directive):
    """Stands for Sphinx's directives of the Python domain: what is within is parsed."""

    has_content = True
    optional_arguments = 1
    final_argument_whitespace = True
    option_spec: ClassVar[dict] = {}

    def run(self):
        """The nodes of the content."""
        body = nodes.container()
        self.state.nested_parse(self.content, self.content_offset, body)
        return [body]


def faults(text: str, monkeypatch) -> list[str]:
    """What of reStructuredText Sphinx would warn about, which stops the book."""
    for kind in ("module", "class", "function", "method", "property"):
        monkeypatch.setitem(directives._directives, f"py:{kind}", _Described)
    tree = publish_doctree(
        text, settings_overrides={"warning_stream": io.StringIO(), "report_level": WARNING}
    )
    messages = [*tree.findall(nodes.system_message), *tree.parse_messages]
    return [message.astext() for message in messages if message["level"] >= WARNING]


@pytest.mark.parametrize("package", PACKAGES)
def test_docstrings_are_sound_as_restructuredtext(package, monkeypatch):
    assert faults(PAGES[package], monkeypatch) == []


def test_unsound_text_is_noticed(monkeypatch):
    assert faults(".. py:function:: f()\n\n   A `name of a\n\n   Next.\n", monkeypatch)
    assert faults(".. py:function:: f()\n\n   A `name` of a\n\n   Next.\n", monkeypatch) == []


def test_the_book_has_every_page_and_links_to_every_function(book):
    for name in MODULES:
        package = name.split(".")[1] if "." in name else ""
        for path, _ in public_objects(importlib.import_module(name)):
            html = (book / "api" / f"{package}.html").read_text()
            assert f'id="{name}.{path}"' in html, f"{name}.{path}"
