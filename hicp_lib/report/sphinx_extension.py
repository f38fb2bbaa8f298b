"""The book's Sphinx extension: pages load what they use, and nothing that would ask a network."""

import re
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging

# Not in `_static`: Jupyter Book loads every script it finds there on every page.
SCRIPTS_DIR = "_scripts"
PLOTLY_PATH = "plotly.js"
PROVENANCE_CLASS = "hicp-provenance"
# TeX that docutils does not know -> what it knows.
_TEX = ((re.compile(r"\\([bB]ig)(?![a-zA-Z])"), r"\\\1l"), (re.compile(r"\\dots(?![a-zA-Z])"), r"\\ldots"))


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (_inline_formula, None), (_displayed_formula, None))
    app.connect("config-inited", _prepare)
    app.connect("builder-inited", _index_prose_only)
    app.connect("html-page-context", _choose_files, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _prepare(app: Any, config: Any) -> None:
    """Offer our scripts; leave out thebe, which Jupyter Book always brings and which loads from a server."""
    config.html_static_path.append(SCRIPTS_DIR)
    for listeners in app.events.listeners.values():
        listeners[:] = [entry for entry in listeners if entry.handler.__module__ != "sphinx_thebe"]


def _choose_files(app: Any, page: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Load Plotly where there is a 3D scene."""
    context["css_files"][:] = [file for file in context["css_files"] if "thebe" not in str(file.filename)]
    if "hicp-scene" in context.get("body", ""):
        app.add_js_file(PLOTLY_PATH)


def _inline_formula(writer: Any, node: nodes.math) -> None:
    """As MathML, which browsers draw and screen readers read without a script."""
    writer.body.append(_mathml(node, as_block=False))
    raise nodes.SkipNode


def _displayed_formula(writer: Any, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="math">{_mathml(node, as_block=True)}</div>')
    raise nodes.SkipNode


def _mathml(node: nodes.Element, as_block: bool) -> str:
    text = node.astext().strip()
    for pattern, known in _TEX:
        text = pattern.sub(known, text)
    try:
        return tex2mathml(text, as_block=as_block)
    except ValueError as error:
        logging.getLogger(__name__).warning("formula %r: %s", text, error, location=node)
        return ""


def _index_prose_only(app: Any) -> None:
    """Search finds what pages say, not their code nor what they were made with, which all of them have."""
    index_page = getattr(app.builder, "index_page", None)  # other formats have none

    def index_prose(name: str, doctree: nodes.document, title: str) -> None:
        prose = doctree.deepcopy()
        for node in list(prose.findall(_is_no_prose)):
            node.parent.remove(node)
        index_page(name, prose, title)

    if index_page:
        app.builder.index_page = index_prose


def _is_no_prose(node: nodes.Node) -> bool:
    is_stamp = isinstance(node, nodes.raw) and PROVENANCE_CLASS in node.astext()
    return is_stamp or isinstance(node, (nodes.literal_block, nodes.doctest_block))
