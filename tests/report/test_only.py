"""`hicp report --only NOTEBOOK`: that one and what it needs, nothing else, and what was done is said."""

from __future__ import annotations

import os

import pytest

from hicp_lib.cli import main as cli
from hicp_lib.core.environment import usable_cores
from hicp_lib.core.errors import InputError
from hicp_lib.report import build, runs
from hicp_lib.report.build import make_report
from hicp_lib.report.run import Children, Folders, RunError
from hicp_lib.report.runs import n_parallel
from tests.report.tiny_study import FINISH, START, pretend_to_execute, write_notebook


@pytest.fixture
def lines(study, monkeypatch) -> list[str]:
    """What the report says; a third notebook waits for nothing, and none is truly executed."""
    write_notebook(study / "notebooks" / "02_third.ipynb", START, FINISH)
    monkeypatch.setattr(Children, "execute", pretend_to_execute)
    return []


def ran(lines: list[str]) -> list[str]:
    return [line.partition(":")[0] for line in lines if ": running" in line]


def test_it_and_those_it_needs_run_and_no_book_is_built(study, lines):
    assert make_report("quick", [], lines.append, study, study, only="01_second") is None
    assert ran(lines) == ["00_first", "01_second"]
    assert not (study / "_build" / "book").exists()
    assert str(study / "results" / "quick" / "01_second") in lines[-1] and "no book was built" in lines[-1]

    lines.clear()
    make_report("quick", [], lines.append, study, study, only="02_third")
    assert ran(lines) == ["02_third"]
    results = Folders(study, study, "quick").results
    assert sorted(path.name for path in results.iterdir()) == ["00_first", "01_second", "02_third"]


def test_its_key_is_that_of_the_whole_report(study, lines, monkeypatch):
    monkeypatch.setattr(build, "build_book", lambda folders, left_out: (study / "index.html", True))
    make_report("quick", [], lines.append, study, study)
    assert len(ran(lines)) == 3
    lines.clear()
    make_report("quick", [], lines.append, study, study, only="01_second")
    assert lines[:-1] == ["00_first: unchanged", "01_second: unchanged"]
    make_report("quick", [("scale", "2")], lines.append, study, study, only="00_first")
    lines.clear()
    make_report("quick", [], lines.append, study, study)
    assert ran(lines) == ["00_first"], "what ran with other parameters runs again, and nothing else"


def test_of_the_others_neither_mistakes_nor_faults_matter(study, lines):
    bad = study / "notebooks" / "02_third.ipynb"
    write_notebook(bad, START, FINISH, parameters='scan_path = "/nowhere"')
    with pytest.raises(InputError, match="/nowhere"):
        make_report("quick", [], lines.append, study, study)
    make_report("quick", [], lines.append, study, study, only="00_first")
    assert ran(lines) == ["00_first"]


def test_a_name_that_is_no_notebook_lists_those_there_are(study, lines):
    with pytest.raises(
        InputError, match="--only: notebook '03' is not known; expected one of: 00_first, 01_s"
    ):
        make_report("quick", [], lines.append, study, study, only="03")
    assert lines == []


def test_the_command_hands_it_on(monkeypatch, capsys):
    monkeypatch.setattr(build, "make_report", lambda *arguments: print(arguments[0], arguments[-1]))
    assert cli.run(["report", "--only", "05_failure_analysis", "--profile", "quick"]) == 0
    assert capsys.readouterr().out == "quick 05_failure_analysis\n"
    assert cli.run(["report"]) == 0
    assert capsys.readouterr().out == "full None\n"


@pytest.mark.parametrize(
    ("cores", "available_gb", "expected"),
    [(8, 64, 8), (2, 64, 2), (1, 64, 1), (8, 6.5, 3), (8, 4, 2), (8, 3.9, 1), (8, 0.5, 1)],
)
def test_as_many_at_a_time_as_cores_and_memory_allow(monkeypatch, cores, available_gb, expected):
    class Memory:
        available = int(available_gb * 1e9)

    monkeypatch.setattr(runs, "usable_cores", lambda: cores)
    monkeypatch.setattr(runs.psutil, "virtual_memory", lambda: Memory)
    assert n_parallel() == expected


def test_the_cores_that_count_are_those_this_process_may_use(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {3}, raising=False)
    assert usable_cores() == 1
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 6)
    assert usable_cores() == 6
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert usable_cores() == 1


def test_a_report_that_fails_says_so_for_one_notebook_too(study, lines, monkeypatch):
    def fail(children, run, copy, staging, folders) -> int:
        (staging / "log.txt").write_text("no kernel")
        return 1

    monkeypatch.setattr(Children, "execute", fail)
    with pytest.raises(RunError, match="00_first: did not run: no kernel; see "):
        make_report("quick", [], lines.append, study, study, only="01_second")
    assert ran(lines) == ["00_first"]
