"""Sphinx extension: search finds what pages say, not their code nor what they were made with."""

from typing import Any

from docutils import nodes

_STAMP = "hicp-provenance"  # every page has one, and all say the same


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("builder-inited", _index_prose_only)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _index_prose_only(app: Any) -> None:
    index_page = getattr(app.builder, "index_page", None)  # other formats have none

    def index_prose(name: str, doctree: nodes.document, title: str) -> None:
        taken = [(node.parent, node.parent.index(node), node) for node in doctree.findall(_is_no_prose)]
        for parent, place, _ in reversed(taken):
            del parent[place]
        index_page(name, doctree, title)
        for parent, place, node in taken:
            parent.insert(place, node)

    if index_page:
        app.builder.index_page = index_prose


def _is_no_prose(node: nodes.Node) -> bool:
    is_stamp = isinstance(node, nodes.raw) and _STAMP in node.astext()
    return is_stamp or isinstance(node, (nodes.literal_block, nodes.doctest_block))
