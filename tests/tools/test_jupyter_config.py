"""What is saved from JupyterLab: the study's notebooks without their runs, the user's own whole."""

from __future__ import annotations

import copy
from types import SimpleNamespace

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from traitlets.config.loader import PyFileConfigLoader

from hicp_lib.core.checkout import CHECKOUT

CONFIG = PyFileConfigLoader("jupyter_server_config.py", str(CHECKOUT / "tools" / "jupyter")).load_config()
strip_study_notebook = CONFIG.ContentsManager.pre_save_hook


@pytest.fixture
def notebook():
    """As the browser sends it: run, looked at and edited."""
    metadata = {"tags": ["parameters"], "scrolled": True, "mine": 1}
    outputs = [new_output("stream", name="stdout", text="1")]
    cells = [new_markdown_cell("# Title"), new_code_cell("a = 2", metadata=metadata, outputs=outputs)]
    cells[1].execution_count = 3
    language = {"name": "python", "version": "3.11.2", "mimetype": "text/x-python"}
    kernel = {"display_name": "Python 3 (ipykernel)", "language": "python", "name": "python3"}
    return new_notebook(cells=cells, metadata={"kernelspec": kernel, "language_info": language, "mine": 2})


def saved(notebook, root, path="notebooks/01_x.ipynb"):
    model = {"type": "notebook", "content": copy.deepcopy(notebook)}
    strip_study_notebook(model=model, path=path, contents_manager=SimpleNamespace(root_dir=str(root)))
    return model["content"]


def test_a_notebook_of_the_study_is_saved_as_edited_without_its_run(notebook):
    content = saved(notebook, CHECKOUT)
    nbformat.validate(content)
    assert content.cells[0] == notebook.cells[0]
    assert content.cells[1].metadata == {"tags": ["parameters"], "mine": 1}
    assert (content.cells[1].source, content.cells[1].outputs, content.cells[1].execution_count) == (
        "a = 2", [], None,
    )  # fmt: skip
    committed = nbformat.read(CHECKOUT / "notebooks" / "00_quickstart.ipynb", as_version=4)
    assert content.metadata == committed.metadata | {"mine": 2}


@pytest.mark.parametrize("path", ["01_x.ipynb", "book/01_x.ipynb"])
def test_other_notebooks_keep_their_outputs(notebook, path):
    assert saved(notebook, CHECKOUT, path) == notebook


def test_what_is_no_notebook_is_left_alone():
    model = {"type": "file", "content": "text"}
    manager = SimpleNamespace(root_dir=str(CHECKOUT))
    strip_study_notebook(model=model, path="notebooks/profiles.toml", contents_manager=manager)
    assert model == {"type": "file", "content": "text"}
