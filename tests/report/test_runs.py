"""Runs are whole or absent, and never stand for anything but what they were made with."""

from __future__ import annotations

import json
import os
from dataclasses import replace

import pytest

from hicp_lib.core import cache
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import sha256_file
from hicp_lib.report.notebooks import read_notebook
from hicp_lib.report.run import Children, Run, RunError
from hicp_lib.report.runs import run_all, run_key, why_stale
from hicp_lib.study import provenance
from tests.report.tiny_study import FINISH, MEASURE, START, pretend_to_execute, tiny_run, write_notebook


def test_a_run_leaves_its_results_and_is_not_repeated(tmp_path):
    run, folders = tiny_run(tmp_path, START, MEASURE, FINISH, seed=4)
    lines: list[str] = []
    run_all([run], folders, lines.append)
    results = folders.results / "05_tiny"
    assert json.loads((results / "values.json").read_text()) == {"seed": 4}
    assert json.loads((results / "provenance.json").read_text())["parameters"]["seed"] == 4
    executed = (folders.executed / "05_tiny.ipynb").stat().st_mtime_ns
    run_all([run], folders, lines.append)
    assert lines[-1] == "05_tiny: unchanged"
    assert (folders.executed / "05_tiny.ipynb").stat().st_mtime_ns == executed

    (results / "values.json").write_text('{"seed": 5}')
    assert why_stale("05_tiny", run_key(run, []), folders) == "its outputs were changed"
    assert not list(folders.executed.glob(".run-*")), "staging folders are removed"


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (
            ("raise ValueError('no\\nluck')", FINISH),
            r"05_tiny: In \[2\] failed: ValueError: no luck; see ",
        ),
        (
            ("import warnings; warnings.warn('odd')",),
            r"05_tiny: In \[2\] wrote to stderr: .*odd",
        ),
        ((START, MEASURE), r"05_tiny: ended without results; its last line must be"),
        (
            ("from hicp_lib.study.page import Study\nstudy = Study({name!r}, seed=9)", FINISH),
            "05_tiny: its results state other parameters",
        ),
        (("import os; os._exit(1)",), "05_tiny: did not run: .*Kernel died"),
    ],
)
def test_a_faulty_run_is_an_error_and_leaves_nothing_half_done(tmp_path, cells, expected):
    run, folders = tiny_run(tmp_path, *cells)
    with pytest.raises(RunError, match=expected) as error:
        run_all([run], folders, print)
    assert "\n" not in str(error.value)
    assert not folders.results.exists()
    assert why_stale("05_tiny", run_key(run, []), folders) == "no complete run yet"
    assert not list(folders.executed.glob("*.ipynb"))


def test_a_failed_run_keeps_the_last_one_but_not_as_fresh(tmp_path):
    run, folders = tiny_run(tmp_path, START, MEASURE, FINISH)
    run_all([run], folders, print)
    before = sha256_file(folders.results / "05_tiny" / "t.parquet")
    worse, _ = tiny_run(tmp_path, START, "1 / 0", FINISH)
    with pytest.raises(RunError, match="ZeroDivisionError"):
        run_all([worse], folders, print)
    assert sha256_file(folders.results / "05_tiny" / "t.parquet") == before
    assert why_stale("05_tiny", run_key(worse, []), folders) == "changed: notebook"


def test_what_a_user_keeps_among_results_stays_and_what_is_no_longer_made_goes(tmp_path, monkeypatch):
    monkeypatch.setattr(Children, "execute", pretend_to_execute)
    run, folders = tiny_run(tmp_path, START, FINISH)
    run_all([run], folders, print)
    results = folders.results / "05_tiny"
    for name in ("notes.txt", "mine/notes.txt"):
        (results / name).parent.mkdir(exist_ok=True)
        (results / name).write_text("mine")
    lines: list[str] = []
    run_all([run], folders, lines.append)
    assert lines == ["05_tiny: unchanged"]

    def with_more(*arguments):
        (arguments[3] / "results" / "05_tiny" / "tables").mkdir(parents=True)
        (arguments[3] / "results" / "05_tiny" / "tables" / "t.csv").write_text("a")
        return pretend_to_execute(*arguments)

    monkeypatch.setattr(Children, "execute", with_more)
    other = replace(run, parameters=run.parameters | {"seed": 1})
    run_all([other], folders, print)
    assert (results / "tables" / "t.csv").is_file()
    monkeypatch.setattr(Children, "execute", pretend_to_execute)
    run_all([run], folders, print)
    left = sorted(path.relative_to(results).as_posix() for path in results.rglob("*"))
    assert left == ["mine", "mine/notes.txt", "notes.txt", "provenance.json"]
    run_all([], folders, print)
    assert sorted(os.listdir(results)) == ["mine", "notes.txt"] and os.listdir(folders.executed) == []


def test_what_libraries_write_to_the_terminal_is_no_fault(tmp_path):
    run, folders = tiny_run(tmp_path, START, "import os; os.write(2, b'native noise\\n');", FINISH)
    run_all([run], folders, print)


def test_a_notebook_waits_for_those_before_it_and_is_skipped_when_they_fail(tmp_path):
    first, folders = tiny_run(tmp_path, "1 / 0", FINISH)
    path = write_notebook(tmp_path / "notebooks" / "06_next.ipynb", START, FINISH)
    second = Run(read_notebook(path), first.parameters, after=("05_tiny",))
    lines: list[str] = []
    with pytest.raises(RunError, match="05_tiny"):
        run_all([first, second], folders, lines.append)
    assert not any(line.startswith("06_next") for line in lines)


def test_every_dependency_is_in_the_key(tmp_path, monkeypatch, library):
    images = tmp_path / "images"
    images.mkdir()
    (images / "1.png").write_bytes(b"1")
    run, _ = tiny_run(tmp_path, START, FINISH, images=str(images))
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "paper.json").write_text("{}")
    (tmp_path / "data" / "detectors.json").write_text('{"weights": {}}')
    lock = tmp_path / "environment.lock"
    lock.write_text("numpy==1")
    for module in (provenance, cache):
        monkeypatch.setattr(module, "DATA_DIR", tmp_path / "data")
    used = library / "study" / "page.py"
    used.write_text('from hicp_lib.core.datafiles import DATA_DIR\npaper = DATA_DIR / "paper.json"\n')
    monkeypatch.setattr(provenance, "LOCK_PATH", lock)
    key = run_key(run, ["x"])
    assert run_key(run, ["x"]) == key

    def changed(run: Run = run, before: tuple[str, ...] = ("x",)) -> list[str]:
        return [part for part, value in run_key(run, list(before)).items() if value != key[part]]

    (library / "other.py").write_text("a = 2")  # no part of what the notebook imports
    (tmp_path / "data" / "other.json").write_text("{}")
    assert changed() == []
    source = used.read_text()
    used.write_text(source + "\n")
    assert changed() == ["library"]
    used.write_text(source)
    (tmp_path / "data" / "paper.json").write_text("[]")
    assert changed() == ["data"]
    (tmp_path / "data" / "paper.json").write_text("{}")
    lock.write_text("numpy==2")
    assert changed() == ["lock"]
    lock.write_text("numpy==1")
    (images / "1.png").write_bytes(b"22")
    assert changed() == ["input files"]
    os.utime(images / "1.png", (0, 0))
    assert changed() == ["input files"]
    (images / "1.png").unlink()
    assert changed() == ["input files"]
    key = run_key(run, ["x"])
    assert changed(Run(run.notebook, run.parameters | {"seed": 1})) == ["parameters"]
    assert changed(before=("y",)) == ["earlier notebooks"]
    monkeypatch.setattr(provenance, "installed_sha256", lambda: "other")
    assert changed() == ["installed packages"]


def edit_library(folder, library) -> None:
    (library / "study" / "page.py").write_text("a = 2")


def edit_notebook(folder, library) -> None:
    write_notebook(folder / "notebooks" / "05_tiny.ipynb", START, MEASURE, FINISH)


def break_notebook(folder, library) -> None:
    (folder / "notebooks" / "05_tiny.ipynb").write_text("{")


def edit_image(folder, library) -> None:
    (folder / "images" / "1.png").write_bytes(b"22")


def edit_earlier_results(folder, library) -> None:
    (folder / "results" / "quick" / "00_earlier" / "provenance.json").write_text("{}")


@pytest.mark.parametrize("when", ["before it is read", "after"])
@pytest.mark.parametrize(
    ("edit", "expected"),
    [
        (edit_library, "library changed while it ran; run the report again"),
        (edit_notebook, "notebook changed while it ran; run the report again"),
        (break_notebook, "is not a notebook"),
        (edit_image, "input files changed while it ran; run the report again"),
        (edit_earlier_results, "earlier notebooks changed while it ran; run the report again"),
    ],
)
def test_what_is_edited_during_the_run_is_not_vouched_for(
    tmp_path, monkeypatch, library, edit, expected, when
):
    (tmp_path / "images").mkdir()
    (tmp_path / "images" / "1.png").write_bytes(b"1")
    run, folders = tiny_run(tmp_path, START, FINISH, images=str(tmp_path / "images"))
    path = write_notebook(tmp_path / "notebooks" / "00_earlier.ipynb", START, FINISH)
    earlier = read_notebook(path)
    run = replace(run, after=("00_earlier",))
    monkeypatch.setattr(Children, "execute", pretend_to_execute)
    both = [Run(earlier, earlier.defaults), run]
    run_all(both, folders, print, only="00_earlier")

    def and_edit(*arguments):
        if when == "after" or edit is break_notebook:
            status = pretend_to_execute(*arguments)
            edit(tmp_path, library)
            return status
        edit(tmp_path, library)
        return pretend_to_execute(*arguments)

    monkeypatch.setattr(Children, "execute", and_edit)
    with pytest.raises((RunError, InputError), match=rf"05_tiny(\.ipynb)?: {expected}") as error:
        run_all(both, folders, print)
    assert "\n" not in str(error.value)
    assert not (folders.results / "05_tiny").exists()
    assert why_stale("05_tiny", run_key(Run(earlier, earlier.defaults), []), folders) == "no complete run yet"


def test_what_was_run_is_what_the_key_names(tmp_path, monkeypatch):
    """Edited before it is read, and back after."""
    run, folders = tiny_run(tmp_path, START, FINISH)

    def swap(*arguments):
        write_notebook(run.notebook.path, START, MEASURE, FINISH)
        status = pretend_to_execute(*arguments)
        write_notebook(run.notebook.path, START, FINISH)
        return status

    monkeypatch.setattr(Children, "execute", swap)
    with pytest.raises(RunError, match="05_tiny: notebook changed while it ran"):
        run_all([run], folders, print)


def test_an_input_that_is_not_there_is_told_before_anything_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(Children, "execute", pretend_to_execute)
    first, folders = tiny_run(tmp_path / "first", START, FINISH)
    run, _ = tiny_run(tmp_path / "second", START, FINISH, images="/nowhere/images")
    several, _ = tiny_run(tmp_path / "third", START, FINISH, images=[str(tmp_path), "/nowhere/too"])
    with pytest.raises(InputError, match="/nowhere/too: does not exist; parameter 'images 1'"):
        run_all([first, several], folders, print)
    with pytest.raises(InputError, match="/nowhere/images: does not exist; parameter 'images'"):
        run_all([first, run], folders, print)
    assert not list(folders.executed.glob("*"))
