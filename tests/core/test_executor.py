"""Jobs in threads and in processes: all of them, whatever fails on the way; nothing is left running."""

import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path

import cv2
import psutil
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.executor import CLUSTER_VARIABLE, resolved, run_jobs


def write_pid(folder: Path, name: str) -> tuple[int, int, str | None]:
    (folder / name).write_text(f"{os.getpid()}")
    return os.getpid(), cv2.getNumThreads(), os.environ.get("OPENBLAS_NUM_THREADS")


def fail(folder: Path) -> None:
    raise KeyError("a fault")


def end(folder: Path) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def wait_long(folder: Path, name: str) -> None:
    write_pid(folder, name)
    time.sleep(600)


def test_processes_have_one_thread_each_and_share_the_jobs(tmp_path):
    done = dict(
        run_jobs([(k, partial(write_pid, name=f"{k}")) for k in range(6)], workers=2, folder=tmp_path)
    )
    assert sorted(done) == list(range(6))
    assert {pid for pid, *_ in done.values()}.isdisjoint({os.getpid()})
    assert len({pid for pid, *_ in done.values()}) <= 2
    assert {(n_threads, variable) for _, n_threads, variable in done.values()} == {(1, "1")}
    assert {int((tmp_path / f"{k}").read_text()) for k in range(6)} == {pid for pid, *_ in done.values()}


def test_a_single_worker_or_job_is_the_caller(tmp_path):
    for n_jobs, workers in ((3, 1), (1, 4)):
        jobs = [(k, partial(write_pid, name="a")) for k in range(n_jobs)]
        done = dict(run_jobs(jobs, workers, folder=tmp_path))
        assert {pid for pid, *_ in done.values()} == {os.getpid()}


def test_jobs_are_drawn_as_threads_get_free():
    drawn, may_go_on = [], threading.Event()

    def jobs():
        for k in range(100):
            drawn.append(k)
            yield k, lambda k=k: may_go_on.wait(60) and k

    results = run_jobs(jobs(), 2, "threads")
    threading.Timer(0.3, may_go_on.set).start()
    next(results)
    assert len(drawn) == 4
    assert sum(k for _, k in results) <= sum(range(100)) and len(drawn) == 100


@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_a_fault_of_a_job_is_raised_as_it_is(tmp_path, kind):
    jobs = [("a", partial(write_pid, name="a")), ("b", fail), ("c", partial(write_pid, name="c"))]
    with pytest.raises(KeyError, match="a fault"):
        list(run_jobs(jobs, 2, kind, folder=tmp_path))


def test_a_process_that_is_killed_is_told_in_one_line(tmp_path):
    jobs = [("a", end), ("b", partial(write_pid, name="b"))]
    with pytest.raises(InputError, match="^a worker process was killed .* run the same command again"):
        list(run_jobs(jobs, 2, folder=tmp_path))


PROGRAM = """
import sys
from functools import partial
from pathlib import Path
from hicp_lib.core.executor import run_jobs
from tests.core.test_executor import wait_long

if __name__ == "__main__":
    jobs = [(name, partial(wait_long, name=name)) for name in "ab"]
    list(run_jobs(jobs, 2, folder=Path(sys.argv[1])))
"""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_processes_end_with_who_started_them(tmp_path, how):
    """From the keyboard the whole group is interrupted; one that is killed can tell nobody."""
    (tmp_path / "program.py").write_text(PROGRAM)
    started = subprocess.Popen(
        [sys.executable, "program.py", "."],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
        stderr=subprocess.PIPE,
        start_new_session=True,
        text=True,
        # Of tests that run in a shell's background, children would not be interrupted at all.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    while not all((tmp_path / name).exists() and (tmp_path / name).read_text() for name in "ab"):
        assert started.poll() is None, started.communicate()
        time.sleep(0.05)
    workers = [psutil.Process(int((tmp_path / name).read_text())) for name in "ab"]
    os.killpg(started.pid, how) if how == signal.SIGINT else started.kill()
    _, alive = psutil.wait_procs(workers, timeout=30)
    errors = started.communicate(timeout=30)[1]
    assert not alive
    assert errors.count("KeyboardInterrupt") == (how == signal.SIGINT)  # the workers say nothing


def test_who_works(monkeypatch):
    monkeypatch.delenv(CLUSTER_VARIABLE, raising=False)
    assert isinstance(resolved(None), int)
    monkeypatch.setenv(CLUSTER_VARIABLE, "tcp://a:1")
    assert resolved(None) == "tcp://a:1" and resolved(2) == 2
    for wrong in (0, -1, 1.5):
        with pytest.raises(InputError, match="expected a whole number"):
            resolved(wrong)
