"""Sphinx extension: formulas as MathML, which browsers draw and screen readers read without a script."""

from typing import Any

from docutils import nodes
from math_core import LatexError, LatexToMathML
from sphinx.util import logging

_CONVERTER = LatexToMathML(fancy_error=False)


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx; `html_math_renderer` chooses it."""
    app.add_html_math_renderer("mathml", (_inline, None), (_displayed, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _inline(writer: Any, node: nodes.math) -> None:
    writer.body.append(_mathml(node, is_block=False))
    raise nodes.SkipNode


def _displayed(writer: Any, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="hicp-formula">{_mathml(node, is_block=True)}</div>')
    raise nodes.SkipNode


def _mathml(node: nodes.Element, is_block: bool) -> str:
    text = node.astext().strip()
    try:
        return _CONVERTER.convert_with_local_state(text, displaystyle=is_block)
    except LatexError as error:
        logging.getLogger(__name__).warning("formula %r: %s", text, error, location=node)
        return ""
