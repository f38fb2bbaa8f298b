"""A report may end at any moment: the next one completes, and nothing half-written is ever used."""

from __future__ import annotations

import itertools
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from hicp_lib.core.files import sha256_file
from hicp_lib.report import runs
from hicp_lib.report.run import Folders, Run
from hicp_lib.report.runs import run_all, run_key, why_stale
from tests.report.tiny_study import FINISH, MEASURE, START, pretend_to_execute, tiny_run

_REPORT = """
import sys
from pathlib import Path
from tests.report.tiny_study import FINISH, MEASURE, START, tiny_run
from hicp_lib.core import cache
from hicp_lib.report.runs import run_all
from hicp_lib.study import provenance
provenance.LIBRARY_DIR = cache.LIBRARY_DIR = Path(sys.argv[2])
run, folders = tiny_run(Path(sys.argv[1]), START, MEASURE, FINISH)
run_all([run], folders, print)
"""


def test_killed_at_any_moment_the_next_run_completes(tmp_path, library):
    undisturbed, elsewhere = tiny_run(tmp_path / "undisturbed", START, MEASURE, FINISH)
    start_s = time.perf_counter()
    run_all([undisturbed], elsewhere, print)
    duration_s = time.perf_counter() - start_s

    run, folders = tiny_run(tmp_path / "killed", START, MEASURE, FINISH)
    moments = random.Random(0)
    for _ in range(4):
        (folders.executed / "05_tiny.json").unlink(missing_ok=True)
        _run_and_kill([str(tmp_path / "killed"), str(library)], moments.uniform(0.3, duration_s + 1))
        _assert_whole_or_stale(run, folders)
    run_all([run], folders, print)
    assert why_stale("05_tiny", run_key(run, []), folders) is None
    for name in ("05_tiny/values.json", "05_tiny/t.parquet"):
        assert sha256_file(folders.results / name) == sha256_file(elsewhere.results / name)
    assert not list(folders.executed.glob(".run-*")), "what the killed runs left is removed"


def _run_and_kill(arguments: list[str], delay_s: float) -> None:
    command = [sys.executable, "-c", _REPORT, *arguments]
    process = subprocess.Popen(command, cwd=Path(__file__).parents[2], stdout=subprocess.DEVNULL)
    time.sleep(delay_s)
    try:
        family = psutil.Process(process.pid).children(recursive=True)
    except psutil.NoSuchProcess:
        family = []
    process.send_signal(signal.SIGKILL)
    process.wait()
    _, alive = psutil.wait_procs(family, timeout=20)
    assert not alive, "the kernel outlived the report"


def test_what_the_kernel_started_ends_with_the_reports_process_group(tmp_path, library):
    """As when a terminal is closed, or `timeout` ends a command."""
    begun = tmp_path / "begun"
    cell = f"import subprocess; subprocess.run(['sh', '-c', 'touch {begun}; exec sleep 300'])"
    code = _REPORT.replace("START, MEASURE, FINISH)\nrun_all", "START, sys.argv[3], FINISH)\nrun_all")
    command = [sys.executable, "-c", code, str(tmp_path / "study"), str(library), cell]
    process = subprocess.Popen(command, cwd=Path(__file__).parents[2], start_new_session=True)
    while not begun.exists():
        assert process.poll() is None
        time.sleep(0.05)
    family = psutil.Process(process.pid).children(recursive=True)
    os.killpg(process.pid, signal.SIGTERM)
    process.wait()
    _, alive = psutil.wait_procs(family, timeout=20)
    for one in alive:
        one.kill()
    assert len(family) >= 3 and not alive


class _Killed(BaseException):
    """Stands for the end of the process at one step."""


def _publish(run: Run, folders: Folders, limit: int | None = None) -> int:
    """Run without a kernel, ending at the step numbered `limit` that changes files; the steps taken."""
    taken = 0

    def step(function):
        def counted(*arguments, **keywords):
            nonlocal taken
            if taken == limit:
                raise _Killed
            taken += 1
            return function(*arguments, **keywords)

        return counted

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runs.Children, "execute", pretend_to_execute)
        for module, name in [(os, "replace"), (shutil, "rmtree"), (Path, "unlink"), (Path, "mkdir")]:
            patch.setattr(module, name, step(getattr(module, name)))
        run_all([run], folders, print)
    return taken


def test_ended_at_each_step_of_publishing_the_next_run_completes(tmp_path):
    run, folders = tiny_run(tmp_path, START, FINISH)
    _publish(run, folders)
    for limit in itertools.count():
        renewed = Run(run.notebook, run.parameters | {"seed": limit + 1})
        try:
            _publish(renewed, folders, limit)
            break
        except _Killed:
            _assert_whole_or_stale(renewed, folders)
        _publish(renewed, folders)
        assert why_stale("05_tiny", run_key(renewed, []), folders) is None
    assert limit >= 8, "every step was tried"


def _assert_whole_or_stale(run: Run, folders: Folders) -> None:
    if why_stale("05_tiny", run_key(run, []), folders) is None:
        assert (folders.results / "05_tiny" / "provenance.json").is_file()
        assert (folders.executed / "05_tiny.ipynb").is_file()
