"""The book's Sphinx extension: pages load what they use, and nothing that would ask a network."""

from typing import Any

# Not in `_static`: Jupyter Book loads every script it finds there on every page.
SCRIPTS_DIR = "_scripts"
PLOTLY_PATH = "plotly.js"


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("config-inited", _prepare)
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
