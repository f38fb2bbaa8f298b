"""The real notebooks: tidy in git, and whole when run (quick profile)."""

from __future__ import annotations

import ast
import json

import nbformat
import pytest

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.report.checks import book_problems
from hicp_lib.report.notebooks import PARAMETERS_TAG, read_notebooks
from hicp_lib.report.runs import first_problem

NOTEBOOKS = sorted((CHECKOUT / "notebooks").glob("*.ipynb"))
STRIP = "strip it: .venv/bin/jupyter nbconvert --clear-output --inplace notebooks/*.ipynb"


@pytest.fixture(params=NOTEBOOKS, ids=lambda path: path.stem)
def notebook(request):
    nbformat.validate(nbformat.read(request.param, as_version=4))
    return nbformat.read(request.param, as_version=4)


def code_cells(notebook) -> list:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def test_no_output_is_kept_in_git(notebook):
    for cell in code_cells(notebook):
        assert not cell.outputs, STRIP
        assert cell.execution_count is None, STRIP


def test_parameters_are_in_one_cell_near_the_top(notebook):
    tagged = [i for i, cell in enumerate(notebook.cells) if PARAMETERS_TAG in cell.metadata.get("tags", [])]
    assert len(tagged) == 1
    assert tagged[0] <= 3


def test_notebooks_tell_and_the_library_does(notebook):
    code = [cell.source for cell in code_cells(notebook)]
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Lambda)
    assert not [node for source in code for node in ast.walk(ast.parse(source)) if isinstance(node, kinds)]
    lines = [
        line
        for source in code
        for line in source.splitlines()
        if line.strip() and not line.lstrip().startswith("#")
    ]
    assert len(lines) <= 60
    assert 8 <= len(notebook.cells) <= 25
    assert notebook.cells[0].cell_type == "markdown"
    assert notebook.cells[0].source.startswith("# ")
    assert code[-1].rstrip().endswith("study.finish()")


def test_every_cell_of_the_quick_report_ran(book):
    executed = sorted((CHECKOUT / "_build" / "notebooks" / "quick").glob("*.ipynb"))
    assert [path.name for path in executed] == [path.name for path in NOTEBOOKS]
    for path in executed:
        assert first_problem(path) is None


def test_the_quick_report_needs_no_network_and_every_image_has_words(book):
    assert book_problems(book) == []
    pages = {path.stem for path in (book / "notebooks").glob("*.html")}
    assert pages == {path.stem for path in NOTEBOOKS}


def test_results_carry_their_provenance_and_no_number_that_is_none(book):
    for notebook in read_notebooks(CHECKOUT / "notebooks"):
        folder = CHECKOUT / "results" / "quick" / notebook.name
        stamp = json.loads((folder / "provenance.json").read_text())
        assert set(stamp["parameters"]) == set(notebook.defaults)
        for path in folder.glob("*.json"):
            json.loads(path.read_text(), parse_constant=pytest.fail)
