"""Notebooks of a few lines, to run and to break."""

from __future__ import annotations

from pathlib import Path

from nbformat import read, write
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from hicp_lib.core.files import write_json
from hicp_lib.report.notebooks import read_notebook
from hicp_lib.report.run import Folders, Run

PARAMETERS = 'seed = 0\nscale = 1.5\ndetectors = ["a", "b"]\nimages = ""'
START = """from hicp_lib.study.page import Study
study = Study({name!r}, seed=seed, scale=scale, detectors=detectors, images=images)"""
MEASURE = """import pandas as pd
study.save("t", pd.DataFrame({"x_px": [seed, 2.5]}))
study.value("seed", seed)"""
FINISH = "study.finish()"


def write_notebook(path: Path, *cells: str, parameters: str = PARAMETERS) -> Path:
    """Write a notebook of a title, a parameters cell and code cells; `{name}` becomes its name."""
    notebook = new_notebook()
    notebook.cells = [new_markdown_cell(f"# About {path.stem}\n\nWith $x^2$.")]
    notebook.cells.append(new_code_cell(parameters, metadata={"tags": ["parameters"]}))
    notebook.cells += [new_code_cell(cell.replace("{name!r}", repr(path.stem))) for cell in cells]
    path.parent.mkdir(parents=True, exist_ok=True)
    write(notebook, path)
    return path


def tiny_run(folder: Path, *cells: str, **parameters) -> tuple[Run, Folders]:
    """One notebook of these cells, with its parameters, in a checkout of its own."""
    notebook = read_notebook(write_notebook(folder / "notebooks" / "05_tiny.ipynb", *cells))
    return Run(notebook, notebook.defaults | parameters), Folders(folder, folder, "quick")


def pretend_to_execute(children, run: Run, copy: Path, staging: Path, folders: Folders) -> int:
    """In place of `Children.execute`: leaves what a run leaves, without starting a kernel."""
    notebook = read(run.notebook.path, as_version=4)
    for cell in notebook.cells:
        cell.metadata["papermill"] = {"status": "completed"}
    write(notebook, copy)
    write_json(staging / "results" / run.notebook.name / "provenance.json", {"parameters": run.parameters})
    return 0
