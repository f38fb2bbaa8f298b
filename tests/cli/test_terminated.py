"""SIGTERM ends a command in one line, with all it started; nothing is half-written, the next run goes on."""

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

COMMAND = [sys.executable, "-c", "from hicp_lib.cli.main import main; main()"]


@pytest.mark.parametrize("to", ["process", "group"])
def test_rendering_ends_with_its_processes(tmp_path, to):
    started = subprocess.Popen(
        [*COMMAND, "scenes", "render", "out", "--n", "500", "--workers", "2"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(CHECKOUT)},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while not list(Path(tmp_path, "out", "images").glob("*.jpg")):
        assert started.poll() is None, started.communicate()
        time.sleep(0.05)
    workers = psutil.Process(started.pid).children(recursive=True)
    assert len(workers) >= 2
    os.kill(started.pid, signal.SIGTERM) if to == "process" else os.killpg(started.pid, signal.SIGTERM)
    errors = started.communicate(timeout=20)[1]
    assert (started.returncode, errors) == (143, "hicp: stopped; run the same command again to continue\n")
    assert not psutil.wait_procs(workers, timeout=10)[1]
    assert not (tmp_path / "out" / "annotations.json").exists()


@pytest.mark.parametrize("closed", ["0<&-", "1>&-", "2>&-", "0<&- 1>&- 2>&-"])
def test_streams_that_the_caller_closed_count_for_nothing(tmp_path, closed):
    (tmp_path / "poses.txt").write_text("0 0 0 0 0 0 0 1\n")
    for name, code in (("poses.txt", 0), ("nothing", 2)):
        started = ["sh", "-c", f'exec "$@" {closed}', "sh", *COMMAND, "inspect", name]
        done = subprocess.run(started, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(CHECKOUT)},
                              capture_output=True, text=True)  # fmt: skip
        assert done.returncode == code and "Traceback" not in done.stderr
        assert bool(done.stdout) == (code == 0 and "1>" not in closed)
        assert bool(done.stderr) == (code == 2 and "2>" not in closed)
