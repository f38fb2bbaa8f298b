"""Builds the book from its pages and the executed notebooks: offline, checked, whole or not at all."""

import importlib.resources
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import nbformat

from hicp_lib.core.cache import files_below
from hicp_lib.core.children import child_environment, lifeline
from hicp_lib.core.datafiles import REFERENCE_DIR
from hicp_lib.core.escape import escaped
from hicp_lib.core.files import read_json, sha256_file, write_json
from hicp_lib.report.checks import book_problems
from hicp_lib.report.pages import drop_icon_font, finish_page
from hicp_lib.report.prose import Results, render_page
from hicp_lib.report.run import Folders, RunError
from hicp_lib.report.runs import outputs, read_stamp
from hicp_lib.report.sphinx_extension import PLOTLY_PATH, SCRIPTS_DIR
from hicp_lib.study import provenance

BUILD_LIMIT_S = 900
_SPHINX = "from hicp_lib.core.children import end_with; end_with(0); "
_SPHINX += "from jupyter_book.cli.main import main; main()"
# Links lead to files of the checkout. In the book, `book/` is the top and `notebooks/` lies in it.
_LINK_TO_PAGE, _LINK_TO_NOTEBOOK = ("](../book/", "](../"), ("](../notebooks/", "](notebooks/")
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")


def build_book(folders: Folders, left_out: Mapping[str, str] | None = None) -> tuple[Path, bool]:
    """Build the book of one profile, unless nothing it is made of changed.

    Parameters
    ----------
    folders : Folders
        The sources of its pages, and the profile's executed notebooks and results.
    left_out : dict of str to str, optional
        Why a notebook was not run, by its name; its page says so.

    Returns
    -------
    Path
        Its first page.
    bool
        Whether it was built now.

    Raises
    ------
    RunError
        If Sphinx warns, or the book would need a network or lacks alt text.
    InputError
        If a page uses a result that does not exist.
    """
    book = folders.root / "_build" / "book" / folders.profile
    stamp = book.with_suffix(".json")
    left_out = left_out or {}
    key = _key(folders, left_out)
    if read_stamp(stamp) == {"key": key, "outputs": _hashes(book)}:
        return book / "index.html", False
    book.parent.mkdir(parents=True, exist_ok=True)
    prefix = f".build-{folders.profile}-"
    for left_behind in book.parent.glob(f"{prefix}*"):
        shutil.rmtree(left_behind, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix=prefix, dir=book.parent, ignore_cleanup_errors=True) as temporary:
        staging = Path(temporary)
        _assemble(staging / "source", folders, left_out)
        built = _run_sphinx(staging, book.parent / f"{folders.profile}.log")
        shutil.copytree(folders.results, built / "results" / folders.profile)
        drop_icon_font(built)
        if problems := book_problems(built, partial(finish_page, book=built)):
            raise RunError(f"book: {problems[0]} ({len(problems)} such problems in all)")
        if _key(folders, left_out) != key:
            raise RunError("book: what it is made of was changed while it was built; run the report again")
        stamp.unlink(missing_ok=True)
        shutil.rmtree(book, ignore_errors=True)
        os.replace(built, book)
        write_json(stamp, {"key": key, "outputs": _hashes(book)})
    return book / "index.html", True


def _key(folders: Folders, left_out: Mapping[str, str]) -> str:
    """Digest of all that the book is made of."""
    runs = {path.stem: read_stamp(path) for path in folders.executed.glob("*.json")}
    for name, stamp in runs.items():
        if stamp is None or stamp["outputs"] != outputs(name, folders):
            raise RunError(f"book: the results of {name} were changed; run the report again")
    return provenance.digest(
        {
            "pages": _hashes(folders.sources / "book"),
            "runs": runs,
            "library": provenance.library_sha256(),
            "data": provenance.data_sha256(),
            "reference run": _hashes(REFERENCE_DIR / folders.profile),
            "installed": provenance.installed_sha256(),
            "left out": dict(left_out),
        }
    )


def _hashes(folder: Path) -> dict[str, str]:
    return {path.relative_to(folder).as_posix(): sha256_file(path) for path in files_below(folder)}


def _assemble(source: Path, folders: Folders, left_out: Mapping[str, str]) -> None:
    """Fill the pages, put the executed notebooks and the scripts beside them."""
    shutil.copytree(folders.sources / "book", source)
    results = Results(folders.results, folders.profile)
    footer = provenance.provenance_html(_book_stamp(folders))
    for page in source.rglob("*.md"):
        text = render_page(page, results, folders.profile).replace(*_LINK_TO_NOTEBOOK)
        page.write_text(f"{text}\n\n{footer}\n")
    notebooks = source / "notebooks"
    notebooks.mkdir(exist_ok=True)
    for executed in folders.executed.glob("*.ipynb"):
        (notebooks / executed.name).write_text(_with_data_note(executed, results).replace(*_LINK_TO_PAGE))
    for name, reason in left_out.items():
        _write_stub(folders.sources / "notebooks" / f"{name}.ipynb", notebooks / f"{name}.ipynb", reason)
    scripts = source / SCRIPTS_DIR
    scripts.mkdir(exist_ok=True)
    plotly = importlib.resources.files("plotly") / "package_data" / "plotly.min.js"
    shutil.copy(str(plotly), scripts / PLOTLY_PATH)


def _with_data_note(executed: Path, results: Results) -> str:
    """An executed notebook, with a line under its title on what of its run is real and what is simulated."""
    whole = nbformat.read(executed, as_version=4)
    note = read_json(results.folder / executed.stem / "values.json").get("data_note")
    if note:
        looked = results.stamp(executed.stem)["parameters"].keys() & {"detector", "detectors", "body"}
        title, _, rest = whole.cells[0].source.partition("\n")
        line = f"Real detectors · {escaped(note)}" if looked else escaped(note[0].upper() + note[1:])
        whole.cells[0].source = f"{title}\n\n**{line}**\n{rest}"
    return nbformat.writes(whole)


def _write_stub(original: Path, stub: Path, reason: str) -> None:
    """A page with a notebook's title that says why it was not run."""
    whole = nbformat.read(original, as_version=4)
    title = whole.cells[0].source.splitlines()[0]
    text = nbformat.v4.new_markdown_cell(f"{title}\n\nNot run: {escaped(reason)}.", id="not-run")
    nbformat.write(nbformat.v4.new_notebook(cells=[text], metadata=whole.metadata), stub)


def _book_stamp(folders: Folders) -> dict:
    """The stamp of prose pages: made now, from results of runs that took this long together."""
    results = Results(folders.results, folders.profile)
    stamps = [results.stamp(name) for name in results.notebooks()]
    made = provenance.provenance({"profile": folders.profile})
    providers = {name for stamp in stamps for name in stamp["onnx_providers"]}
    return made | {"onnx_providers": sorted(providers), "wall_s": sum(stamp["wall_s"] for stamp in stamps)}


def _run_sphinx(staging: Path, log: Path) -> Path:
    """Build with every warning an error; the folder of the pages."""
    command = [sys.executable, "-c", _SPHINX]
    command += ["build", str(staging / "source"), "--path-output", str(staging), "-W", "--keep-going", "-q"]
    environment = child_environment(PYTHONNOUSERSITE="1")
    with open(log, "wb") as output, lifeline() as stdin:
        streams: dict[str, Any] = {"stdin": stdin, "stdout": output, "stderr": subprocess.STDOUT}
        done = subprocess.run(command, **streams, timeout=BUILD_LIMIT_S, env=environment, cwd=staging)
    built = staging / "_build" / "html"
    if done.returncode != 0 or not (built / "index.html").is_file():
        lines = _COLOURS.sub("", log.read_text(errors="replace")).splitlines()
        warnings = [line for line in lines if "WARNING" in line or "ERROR" in line] or lines[-1:]
        first = warnings[0].replace(str(staging / "source"), "book") if warnings else "no output"
        raise RunError(f"book: {first} ({len(warnings)} in all; see {log})")
    return built
