"""The real notebooks: tidy in git, and whole when run (quick profile)."""

from __future__ import annotations

import ast
import io
import itertools
import json
import re
import tokenize
from pathlib import Path

import nbformat
import pytest

from hicp_lib.core.checkout import CHECKOUT, EARLIER_RESULTS_VARIABLE, RESULTS_VARIABLE
from hicp_lib.core.files import sha256_file
from hicp_lib.report.checks import book_problems
from hicp_lib.report.notebooks import (
    PARAMETERS_TAG,
    check_parameters,
    read_notebook,
    read_notebooks,
    read_profile,
)
from hicp_lib.report.runs import first_problem

NOTEBOOKS = sorted((CHECKOUT / "notebooks").glob("*.ipynb"))
STRIP = "strip it: .venv/bin/jupyter nbconvert --clear-output --inplace notebooks/*.ipynb"

# Tags of a cell that shows rows or arrays of the data, and of the figure that a reader changes first.
SHOWING = LOOK_INSIDE, TRY_IT = "look-inside", "try-it"
# Suffix of a parameter -> how its unit begins.
UNITS = {
    "px": "px",
    "pixels": "px",
    "s": "s",
    "hz": "Hz",
    "deg": "deg",
    "m": "m",
    "score": "score",
    "m_s": "m/s",
}
WITHOUT_EQUATION = ["00_quickstart"]  # it computes nothing that one defines


def pictures(folder: Path) -> dict[str, str]:
    """Figure -> hash of the picture that was saved of it."""
    return {path.stem: sha256_file(path) for path in folder.glob("*.webp")}


@pytest.fixture(params=NOTEBOOKS, ids=lambda path: path.stem)
def path(request) -> Path:
    return request.param


@pytest.fixture
def notebook(path):
    nbformat.validate(nbformat.read(path, as_version=4))
    return nbformat.read(path, as_version=4)


def parameters_cell(path: Path) -> str:
    cells = nbformat.read(path, as_version=4).cells
    return next(cell.source for cell in cells if PARAMETERS_TAG in cell.metadata.get("tags", []))


def comments(path: Path) -> dict[str, str]:
    """Parameter -> the comment lines right above it, as one."""
    found, above = {}, []
    for token in tokenize.generate_tokens(io.StringIO(parameters_cell(path)).readline):
        if token.type == tokenize.COMMENT:
            above.append(token.string.removeprefix("#").strip())
        elif token.type == tokenize.NAME and token.start[1] == 0:
            found[token.string], above = " ".join(above), []
    return found


def to_try(text: str) -> tuple[str, object, object]:
    """The parameter that a page says to change, from which value, and to which."""
    change = r"\*\*Try it:\*\* change `(\w+)` from `(.+?)` to `(.+?)`, run the first two code cells"
    said = re.search(change, text)
    assert said, f"expected `**Try it:** change ... from ... to ..., run ...`, not {text!r}"
    return said[1], ast.literal_eval(said[2]), ast.literal_eval(said[3])


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
    nodes = [node for source in code for node in ast.walk(ast.parse(source))]
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Lambda)
    assert not [node for node in nodes if isinstance(node, kinds)]
    assert 8 <= len(notebook.cells) <= 25
    assert notebook.cells[0].cell_type == "markdown"
    assert notebook.cells[0].source.startswith("# ")
    assert code[-1].rstrip().endswith("study.finish()")


def test_every_parameter_says_its_unit_or_values_and_what_to_try(path):
    notebook, described = read_notebook(path), comments(path)
    assert set(described) == set(notebook.defaults)
    # What a page of the book shows of a line without scrolling
    assert max(len(line) for line in parameters_cell(path).splitlines() if line.startswith("#")) <= 78
    for name, comment in described.items():
        said = re.fullmatch(r"\S.* \[(.+?)\](?:[;,].*)?; try (.+)\.", comment)
        assert said, f"{name}: expected `# What it is [unit or values]; try VALUE.`, not {comment!r}"
        suffix = "m_s" if name.endswith("_m_s") else name.rpartition("_")[2]
        assert said[1].startswith(UNITS.get(suffix, "")), f"{name}: expected [{UNITS.get(suffix)}, ...]"
        tried = ast.literal_eval(said[2])
        check_parameters(notebook, {name: tried}, "what to try")
        assert tried != notebook.defaults[name]


@pytest.mark.parametrize("profile", ["quick", "full", "deep"])
def test_profiles_name_what_there_is(profile):
    notebooks = CHECKOUT / "notebooks"
    assert read_profile(notebooks / "profiles.toml", profile, read_notebooks(notebooks))[1]


def test_every_line_of_a_profile_says_what_it_asks_for():
    lines = (CHECKOUT / "notebooks" / "profiles.toml").read_text().split("[after]")[0].splitlines()
    assert [line for line in lines if "=" in line and not re.search(r"  # \S", line)] == []


@pytest.mark.parametrize("name", ["quick", "full"])
def test_the_error_budget_looks_at_what_other_pages_have_rendered(name):
    notebooks = read_notebooks(CHECKOUT / "notebooks")
    changed, _ = read_profile(CHECKOUT / "notebooks" / "profiles.toml", name, notebooks)
    values = {one.name: one.defaults | changed.get(one.name, {}) for one in notebooks}
    budget = values["04b_error_budget"]
    for page, frames in (("03_relative_3d", "n_images"), ("04_mocap_3d", "n_frames")):
        assert budget[frames] == values[page]["n_frames"] and budget["seed"] == values[page]["seed"]
        assert budget["n_people"] <= values[page]["n_people"]
        assert budget["detector"] in values[page]["detectors"]


def test_a_page_shows_data_at_work_and_one_figure_to_try(path, notebook):
    tagged = [cell for tag in SHOWING for cell in notebook.cells if tag in cell.metadata.get("tags", [])]
    assert [cell.cell_type for cell in tagged] == ["code", "code"]
    text, figure = notebook.cells[notebook.cells.index(tagged[1]) - 1], ast.parse(tagged[1].source)
    calls = [node.func.attr for node in ast.walk(figure) if isinstance(node, ast.Call)
             and isinstance(node.func, ast.Attribute)]  # fmt: skip
    assert calls.count("figure") == 1
    name, before, after = to_try(text.source)
    assert name in {node.id for node in ast.walk(figure) if isinstance(node, ast.Name)}
    declared = read_notebook(path)
    assert declared.defaults[name] == before != after
    check_parameters(declared, {name: after}, "Try it")
    first = re.search(r"\*\*Try first\*\* `(\w+)`, under \*(.+)\*\.", notebook.cells[0].source)
    assert first[1] == name
    above = [cell.source for cell in notebook.cells[: notebook.cells.index(tagged[1])]]
    headings = re.findall(r"^## (.+)$", "\n".join(above), re.MULTILINE)
    assert headings[-1] == first[2]


def test_an_equation_stands_before_the_call_that_computes_it(path, notebook):
    texts = [cell.source for cell, after in itertools.pairwise(notebook.cells) if after.cell_type == "code"]
    shown = [text for text in texts if re.search(r"\$\$\n.+\n\$\$", text, re.DOTALL)]
    assert bool(shown) != (path.stem in WITHOUT_EQUATION)
    everywhere = "".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    assert everywhere.count("$$") == "".join(texts).count("$$")


def test_every_cell_of_the_quick_report_ran(book):
    executed = sorted((CHECKOUT / "_build" / "notebooks" / "quick").glob("*.ipynb"))
    assert [path.name for path in executed] == [path.name for path in NOTEBOOKS]
    for path in executed:
        assert first_problem(path) is None


def test_what_shows_the_data_has_output(book):
    for path in NOTEBOOKS:
        executed = nbformat.read(CHECKOUT / "_build" / "notebooks" / "quick" / path.name, as_version=4)
        shown = [cell for cell in executed.cells if LOOK_INSIDE in cell.metadata.get("tags", [])]
        texts = [output.data["text/plain"] for cell in shown for output in cell.outputs]
        assert len(texts) == 1 and len(re.findall(r"\d", texts[0])) >= 10, path.name


def test_the_value_to_try_changes_one_figure(path, notebook, book, tmp_path, monkeypatch):
    monkeypatch.setenv(RESULTS_VARIABLE, str(tmp_path))
    monkeypatch.setenv(EARLIER_RESULTS_VARIABLE, str(CHECKOUT / "results" / "quick"))
    monkeypatch.chdir(path.parent)
    chosen, _ = read_profile(path.with_name("profiles.toml"), "quick", read_notebooks(path.parent))
    parameters, opening, *rest = code_cells(notebook)
    figure = next(cell for cell in rest if TRY_IT in cell.metadata.get("tags", []))
    kernel: dict = {}
    exec(parameters.source, kernel)
    kernel |= chosen.get(path.stem, {})
    for cell in (opening, *rest[: rest.index(figure) + 1]):
        exec(cell.source, kernel)
    before = pictures(tmp_path / path.stem)
    name, _, value = to_try(notebook.cells[notebook.cells.index(figure) - 1].source)
    kernel[name] = value
    for cell in (opening, figure):
        exec(cell.source, kernel)
    after = pictures(tmp_path / path.stem)
    drawn = re.search(r'study\.figure\(\s*"(\w+)"', figure.source)[1]
    assert {name for name in after if after[name] != before[name]} == {drawn}


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
