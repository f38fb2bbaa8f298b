"""Processes that are started import nothing from the working folder, and end with who started them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.children import child_environment, lifeline
from tests.core.untrusted import fill

SPAWN = """
import sys
from functools import partial
from multiprocessing import get_context
from hicp_lib.core.children import safe_start
from hicp_lib.core.executor import run_jobs

sys.path.insert(0, "")  # as Jupyter does
if __name__ == "__main__":
    jobs = [(k, partial(max, k, 1)) for k in range(4)]
    with safe_start():
        manager = get_context("spawn").Manager()
    with manager:
        print(sorted(dict(run_jobs(jobs, 2)).values()), len(manager.dict(a=1)), sys.path[0] == "")
"""


def test_processes_of_who_works_in_an_untrusted_folder_import_nothing_from_it(tmp_path):
    folder = tmp_path / "data"
    marker = fill(folder)
    program = tmp_path / "program.py"
    program.write_text(SPAWN)
    environment = os.environ | {"PYTHONPATH": str(CHECKOUT)}
    done = subprocess.run(
        [sys.executable, program], cwd=folder, env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.stdout == "[1, 1, 2, 3] 1 True\n", done.stderr
    assert not marker.exists(), marker.read_text()


def test_programs_import_nothing_from_the_working_folder(tmp_path):
    marker = fill(tmp_path / "data")
    for arguments in (["-c", "import json, random"], ["-m", "json.tool", "--help"]):
        command = [sys.executable, *arguments]
        subprocess.run(
            command, cwd=tmp_path / "data", env=child_environment(), check=True, capture_output=True
        )
    assert not marker.exists(), marker.read_text()


BUSY = """
import ctypes, os, sys
from pathlib import Path
from hicp_lib.core.children import end_with
end_with(0)
Path(sys.argv[1]).write_text(str(os.getpid()))
ctypes.PyDLL(None).sleep(600)  # a library's call that lets no other thread of Python run
"""
PARENT = """
import subprocess, sys, time
from hicp_lib.core.children import child_environment, lifeline
with lifeline() as stdin:
    command = [sys.executable, "-c", sys.argv[1], sys.argv[2]]
    child = subprocess.Popen(command, stdin=stdin, env=child_environment())
    time.sleep(600)
"""


def wait_for(path: Path) -> psutil.Process:
    limit_s = time.monotonic() + 60
    while not (path.exists() and path.read_text()):
        assert time.monotonic() < limit_s
        time.sleep(0.02)
    return psutil.Process(int(path.read_text()))


def ends_within(process: psutil.Process, limit_s: float) -> bool:
    """Whether it ends, waited for by whoever inherited it or not."""
    limit_s += time.monotonic()
    while time.monotonic() < limit_s:
        try:
            if process.status() == psutil.STATUS_ZOMBIE:
                return True
        except psutil.NoSuchProcess:
            return True
        time.sleep(0.01)
    return False


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a thread has to wait")
def test_a_program_ends_within_a_second_however_its_parent_dies(tmp_path):
    environment = child_environment(PYTHONPATH=str(CHECKOUT))
    parent = subprocess.Popen([sys.executable, "-c", PARENT, BUSY, tmp_path / "pid"], env=environment)
    child = wait_for(tmp_path / "pid")
    time.sleep(0.2)  # it sleeps in the library
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    assert ends_within(child, 1)


def test_a_program_ends_with_the_block_that_holds_its_lifeline(tmp_path):
    code = BUSY.replace("ctypes.PyDLL(None)", "__import__('time')")
    with lifeline() as stdin:
        child = subprocess.Popen([sys.executable, "-c", code, tmp_path / "pid"], stdin=stdin)
        wait_for(tmp_path / "pid")
        assert child.poll() is None
    assert child.wait(10) != 0
