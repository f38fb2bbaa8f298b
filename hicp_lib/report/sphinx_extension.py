"""The book's Sphinx extension: pages load what they use, and nothing that would ask a network."""

from __future__ import annotations

from typing import Any

# Not in `_static`: Jupyter Book loads every script it finds there on every page.
SCRIPTS_DIR = "_scripts"
PLOTLY_PATH = "plotly.js"


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("builder-inited", lambda app: app.config.html_static_path.append(SCRIPTS_DIR))
    app.connect("html-page-context", _choose_scripts, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _choose_scripts(app: Any, page: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Drop thebe, whose script comes from a server; load Plotly where there is a 3D scene."""
    for kind in ("script_files", "css_files"):
        context[kind][:] = [file for file in context[kind] if not _is_thebe(file)]
    if "hicp-scene" in context.get("body", ""):
        app.add_js_file(PLOTLY_PATH)


def _is_thebe(file: Any) -> bool:
    return "thebe" in f"{file.filename} {file.attributes.get('body') or ''}".lower()
