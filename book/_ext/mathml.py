"""Sphinx extension: formulas as MathML, which browsers draw and screen readers read without a script."""

import re
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging

# TeX that docutils does not know -> what it knows.
_TEX = (
    (re.compile(r"\\([bB]ig)(?![a-zA-Z])"), r"\\\1l"),
    (re.compile(r"\\dots(?![a-zA-Z])"), r"\\ldots"),
    (re.compile(r"\\operatorname\*"), r"\\operatorname"),  # else the star is drawn
)


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx; `html_math_renderer` chooses it."""
    app.add_html_math_renderer("mathml", (_inline, None), (_displayed, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _inline(writer: Any, node: nodes.math) -> None:
    writer.body.append(_mathml(node, as_block=False))
    raise nodes.SkipNode


def _displayed(writer: Any, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="hicp-formula">{_mathml(node, as_block=True)}</div>')
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
